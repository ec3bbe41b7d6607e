"""Photos of held-out shapes under held-out maps, with their objects' true masks."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from anyprobe_train.dataset.asset_store import AssetStore
from anyprobe_train.mask_network.composites import draw_scene
from anyprobe_train.mask_network.examples import cover_box, inside_click, unasked_target
from anyprobe_train.mask_network.foregrounds import TexturePool, ViewSource
from research.masks.cases import Case, make_case

SIZE = 480
"""Longer side of the rendered photos; the network sees them at 160."""

SCENES_PER_VIEW = 3
TEXTURES = 80


def rendered_cases(store: AssetStore, count: int, seed: int) -> Iterator[Case]:
    """Scenes of held-out shapes and maps, each with one object that is meant without a prompt."""
    textures = TexturePool(seed, TEXTURES, [asset.radiance for asset in store.maps.values()])
    yield from drawn_cases(ViewSource(store, textures, seed, size=384, real_share=1.0), count, seed)


def drawn_cases(views: ViewSource, count: int, seed: int) -> Iterator[Case]:
    """Scenes of these views, each with one object that is meant without a prompt."""
    rng = np.random.default_rng((seed, 4))
    made = drawn = 0
    while made < count:
        if drawn % SCENES_PER_VIEW == 0:
            view = views.view(drawn // SCENES_PER_VIEW)
        drawn += 1
        scene = draw_scene(rng, view, views.textures, SIZE)
        target = unasked_target(scene)
        if target is None:
            continue
        top, bottom, left, right = scene.bounds
        cover = scene.covers[target]
        x, y = inside_click(rng, cover)
        x0, y0, x1, y1 = cover_box(cover)
        yield make_case(
            f"scene-{seed}-{made}",
            scene.photo[:, top:bottom, left:right].permute(1, 2, 0).numpy(),
            cover[top:bottom, left:right].numpy(),
            (x - left, y - top),
            (x0 - left, y0 - top, x1 - left, y1 - top),
        )
        made += 1
