"""Draw every picture of the documentation that depends on the weights, one after another.

python examples/draw_all.py

tests/README.md says what the pictures that a browser draws need.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
SCRIPTS = (
    "draw_real.py",
    "draw_example.py",
    "table.py relit",
    "draw_clip.py",
    "draw_inputs.py",
    "draw_exports.py",
    "draw_page.py",
    "draw_web.py",
)


def main() -> None:
    """Run each script; the first that fails ends it."""
    for line in SCRIPTS:
        name, *arguments = line.split()
        print(f"examples/{line} ...", file=sys.stderr, flush=True)
        subprocess.run([sys.executable, str(HERE / name), *arguments], check=True)


if __name__ == "__main__":
    main()
