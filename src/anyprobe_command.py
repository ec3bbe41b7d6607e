"""The installed command: outside the package, whose import takes half a second that Ctrl-C may fall into."""

from __future__ import annotations

import os
import sys


def main() -> None:
    """Run the command line; ended while it is imported, it says so in one line."""
    if sys.argv[1:2] == ["video"]:  # a second BLAS thread would spin on a core that frames need
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        from anyprobe.cli.app import main as run

        run()
    except (ImportError, MemoryError) as error:  # of what it imports; a command's own are said there
        said = " ".join(str(error).split())[:200] or "memory is short"
        print(f"anyprobe: cannot be loaded ({said}); reinstall it", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("anyprobe: interrupted", file=sys.stderr)
        sys.exit(130)
