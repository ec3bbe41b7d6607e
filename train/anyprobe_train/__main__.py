"""python -m anyprobe_train: the command line."""

from anyprobe_train.cli.app import main

if __name__ == "__main__":
    main()
