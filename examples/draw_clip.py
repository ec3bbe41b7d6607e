"""Draw docs/clip.gif, a short, small copy of docs/relit.webp, which `python examples/table.py relit` makes.

python examples/draw_clip.py
"""

from __future__ import annotations

from pathlib import Path

from PIL import Image, ImageSequence

DOCS = Path(__file__).parents[1] / "docs"
EVERY, LAST, FRAME_MS = 6, 78, 350
"""Of the frames, in which the light source moves from left to right."""
WIDTH, COLORS = 420, 112


def main() -> None:
    """Take some frames, shrink them, and give all of them one palette."""
    with Image.open(DOCS / "relit.webp") as clip:
        frames = [frame.convert("RGB") for frame in ImageSequence.Iterator(clip)][:LAST:EVERY]
    height = round(WIDTH * frames[0].height / frames[0].width)
    small = [frame.resize((WIDTH, height), Image.Resampling.LANCZOS) for frame in frames]
    strip = Image.new("RGB", (WIDTH, height * len(small)))
    for index, frame in enumerate(small):
        strip.paste(frame, (0, index * height))
    palette = strip.quantize(COLORS, method=Image.Quantize.MEDIANCUT, kmeans=2)
    plain = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in small]
    plain[0].save(DOCS / "clip.gif", save_all=True, append_images=plain[1:], duration=FRAME_MS, loop=0, optimize=True)


if __name__ == "__main__":
    main()
