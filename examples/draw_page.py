"""Draw docs/serve/page.png: the page of `anyprobe serve` with its example, in a headless Chromium.

    python examples/draw_page.py

tests/README.md says what the browser needs.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
PICTURE = ROOT / "docs" / "serve" / "page.png"
STEPS = ROOT / "tests" / "browser" / "page_picture.mjs"
WINDOW = (1280, 900)


def main() -> None:
    sys.path.insert(0, str(ROOT / "tests"))
    from support.browser import run_steps

    command = [sys.executable, "-m", "anyprobe", "serve", "--port", "0", "--workers", "1"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as server:
        try:
            url = re.search(r"http://\S+/", server.stderr.readline())[0]
            footer = run_steps(STEPS, url, {"picture": str(PICTURE)}, viewport=WINDOW)
        finally:
            server.terminate()
    print(f"{PICTURE.relative_to(ROOT)}: {footer.strip()}")


if __name__ == "__main__":
    main()
