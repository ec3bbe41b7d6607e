"""python -m anyprobe: the command line."""

from anyprobe.cli.app import main

if __name__ == "__main__":
    main()
