"""The installed command: outside the package, whose import takes half a second that Ctrl-C may fall into."""

from __future__ import annotations

import sys


def main() -> None:
    """Run the command line; ended while it is imported, it says so in one line."""
    try:
        from anyprobe.cli.app import main as run

        run()
    except KeyboardInterrupt:
        print("anyprobe: interrupted", file=sys.stderr)
        sys.exit(130)
