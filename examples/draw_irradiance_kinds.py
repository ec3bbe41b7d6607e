"""Draw docs/irradiance_kinds.png: the kinds of irradiance images of the paper's Fig. 4.

    python examples/draw_irradiance_kinds.py

One of our own shapes in one of our own rooms, from smooth to rough. Eq. 5's irradiance follows
the material from the mirror's sharpness to the mean light; the two others stay as they are.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from anyprobe.core.color import luminance, to_bytes
from anyprobe.core.frames import world_from_camera
from anyprobe.core.response import response
from anyprobe.core.sampling import hammersley
from anyprobe.dataset.procedural_light import room
from anyprobe.light.octahedral import build_pyramid
from anyprobe.render.integrate import NUM_LAMPS, shade
from anyprobe.render.rivals import grey_mirror, uniform_irradiance
from anyprobe.render.shapes import lathe
from anyprobe.render.surface import frame_object, see
from anyprobe.scatter.brdf import Material

ALPHAS = (0.05, 0.1, 0.2, 0.35, 0.5, 1.0)
ROWS = ("photo", "importance-\nweighted", "uniform", "grey mirror")
TILE = 120
SUPERSAMPLE = 2
LEFT, TOP = 88, 22
CHUNK = 512


def main(path: Path) -> None:
    """Shade every tile, develop them all with one exposure, write the sheet."""
    mesh = lathe(np.random.default_rng(0), rows=120)
    camera = frame_object(
        mesh, world_from_camera(-0.5, 0.25), fov_deg=24.0, margin=1.08, size=TILE * SUPERSAMPLE
    )
    surface = see(mesh, camera)
    map_from_camera = camera.world_from_camera.astype(np.float32)
    n, wo = surface.normals @ map_from_camera.T, surface.wo @ map_from_camera.T
    radiance, u = room(np.random.default_rng(17)), hammersley(1024)
    pyramid, lit = build_pyramid(radiance), build_pyramid(radiance, lamps=NUM_LAMPS)

    def everywhere(shader):
        some = [shader(n[i : i + CHUNK], wo[i : i + CHUNK]) for i in range(0, len(n), CHUNK)]
        return np.concatenate(some)

    def both(alpha):
        material = Material(albedo=np.array([0.72, 0.76, 0.68]), f0=np.full(3, 0.05), alpha=alpha)

        def shader(n, wo):
            shading = shade(lit, n, wo, alpha, u)
            return np.stack([shading.radiance(material), shading.irradiance], axis=1)

        return np.moveaxis(everywhere(shader), 1, 0)

    photos, weighted = zip(*(both(alpha) for alpha in ALPHAS), strict=True)
    even = everywhere(lambda n, wo: uniform_irradiance(pyramid, n, u))
    grey = everywhere(lambda n, wo: grey_mirror(pyramid, n, wo))
    rows = (photos, weighted, (even,) * len(ALPHAS), (grey,) * len(ALPHAS))
    gain = 0.28 / float(luminance(np.concatenate(photos)).mean())
    sheet = Image.new("RGB", (LEFT + TILE * len(ALPHAS), TOP + TILE * len(ROWS)), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(13)
    for column, alpha in enumerate(ALPHAS):
        centre = LEFT + TILE * (column + 0.5)
        draw.text((centre, TOP / 2), f"alpha {alpha:g}", fill="black", font=font, anchor="mm")
    for row, (name, images) in enumerate(zip(ROWS, rows, strict=True)):
        draw.multiline_text((6, TOP + TILE * (row + 0.5)), name, fill="black", font=font, anchor="lm")
        for column, image in enumerate(images):
            tile = Image.fromarray(to_bytes(_develop(image * gain, surface.mask)))
            sheet.paste(tile, (LEFT + TILE * column, TOP + TILE * row))
    sheet.save(path, optimize=True)


def _develop(radiance: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Display values [TILE, TILE, 3] over white of the radiance [P, 3] in the mask."""
    picture = np.ones((*mask.shape, 3), np.float32)
    picture[mask] = response(radiance)
    return picture.reshape(TILE, SUPERSAMPLE, TILE, SUPERSAMPLE, 3).mean(axis=(1, 3))


if __name__ == "__main__":
    main(Path(__file__).parents[1] / "docs" / "irradiance_kinds.png")
