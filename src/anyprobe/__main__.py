"""python -m anyprobe: the command line."""

from anyprobe_command import main

if __name__ == "__main__":
    main()
