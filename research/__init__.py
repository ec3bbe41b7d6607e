"""Research on anyprobe: run from a clone as `python -m research.NAME`; not part of the installed package."""
