"""Draw web/pictures: the examples of web/examples, built with the packed package, in a headless Chromium.

    python examples/draw_web.py [three fiber babylon]

tests/README.md says what the browser needs; npm fetches what the examples name.
"""

from __future__ import annotations

import base64
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

ROOT = Path(__file__).parents[1]
WEB = ROOT / "web"
NAMES = ("three", "fiber", "babylon")
SIZE = (480, 360)
ISOLATED = {"Cross-Origin-Opener-Policy": "same-origin", "Cross-Origin-Embedder-Policy": "require-corp"}


def draw(site: Path) -> Image.Image:
    """What an example's canvas shows."""
    from support.browser import run_steps, serve

    with serve({"/": site}, headers=ISOLATED) as url:
        drawn = run_steps("package_example.mjs", url, {"page": "index.html"}, timeout_s=400)["drawn"]
    return Image.frombytes("RGBA", (drawn["width"], drawn["height"]), base64.b64decode(drawn["rgba"]))


def main() -> None:
    sys.path.insert(0, str(ROOT / "tests"))
    from support.bundlers import build_example, pack

    with TemporaryDirectory() as kept:
        packed = pack(WEB, Path(kept))
        for name in sys.argv[1:] or NAMES:
            folder = Path(kept) / name
            folder.mkdir()
            path = WEB / "pictures" / f"{name}.webp"
            drawn = draw(build_example(name, packed, folder)).convert("RGB")
            drawn.resize(SIZE, Image.Resampling.LANCZOS).save(path, quality=80)
            print(path.relative_to(ROOT))


if __name__ == "__main__":
    main()
