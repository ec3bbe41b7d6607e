"""What a frozen first stage makes of training surfaces, kept: true normals beside estimated ones.

The second stage learns from reflectance maps, not from photos. The errors that it must live with are those of this
file: of whole surfaces at once, so that they are correlated over the object as they are in a photo.

    python -m research.second_stage first-stage --data DATA --first training/lift.pt
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional as F

from anyprobe.files.atomic import atomic_path
from anyprobe.learning.dataset.distributions import draw_material
from anyprobe.learning.dataset.lighting import Illuminator
from anyprobe.learning.dataset.pairs import Batch, PairConfig, PairSource
from anyprobe.learning.dataset.surfaces import SurfaceConfig, SurfaceSet, build_surfaces
from anyprobe.learning.nets.light_net import LightNet
from anyprobe.learning.train.checkpoint import load_init_weights
from anyprobe.learning.train.config import LightConfig, lift
from anyprobe.learning.train.dataloader import load_assets
from anyprobe.learning.train.lift import Lift

SIZE = 32
"""Side of the kept pictures."""
SURFACES = SurfaceConfig(
    views=4,
    own_views=1,
    procedural=60,
    figures=100,
    parts=30,
    stretch=0.2,
    tilt_deg=20.0,
    bend=0.4,
    relief=0.55,
    seed=77,
)
PLAIN = ("given_normals", "surroundings", "merged_surroundings", "joined", "shape_augment", "textured", "two_materials")
"""Settings of PairConfig that are left out."""
LIGHTS = 160
"""Lit materials that all photos share; each has another colour in every photo."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SeenSurfaces:
    """N surfaces, each as it is and as the first stage took it for in one photo.

    true, estimated [N, 3, 32, 32]: normals in the camera's frame, the true ones zero outside the object, the
    estimated ones unit; mask [N, 32, 32]: coverage by the mask of the photo, with its errors; tan_half [N];
    root_alpha, estimated_root_alpha [N]: of the material in that photo; metal [N].
    """

    true: np.ndarray
    estimated: np.ndarray
    mask: np.ndarray
    tan_half: np.ndarray
    root_alpha: np.ndarray
    estimated_root_alpha: np.ndarray
    metal: np.ndarray

    def save(self, path: Path) -> None:
        """As one file that `load` maps."""
        with atomic_path(path) as temporary, open(temporary, "wb") as stream:
            np.savez(stream, **{one.name: getattr(self, one.name) for one in fields(self)})

    @classmethod
    def load(cls, path: Path) -> SeenSurfaces:
        """What save wrote."""
        with np.load(path) as stored:
            return cls(**{one.name: stored[one.name] for one in fields(cls)})


def look_at_surfaces(
    net: LightNet, illuminator: Illuminator, surfaces: SurfaceSet, config: PairConfig, steps: int
) -> SeenSurfaces:
    """Photos of surfaces under drawn light and materials, and what the net makes of them, `steps` batches."""
    rng = np.random.default_rng((config.seed, 3))
    source = PairSource(illuminator, surfaces, config)
    pool = [illuminator.draw(rng) for _ in range(LIGHTS)]
    parts = [_one_batch(net, source, pool, step) for step in range(steps)]
    return SeenSurfaces(**{name: np.concatenate([part[name] for part in parts]) for name in parts[0]})


@torch.no_grad()
def _one_batch(net: LightNet, source: PairSource, pool: list, step: int) -> dict[str, np.ndarray]:
    config = source.config
    rng, again = (np.random.default_rng((config.seed, 4, step)) for _ in range(2))
    chosen = [pool[i] for i in rng.choice(len(pool), config.batch)]
    index = rng.integers(len(source.surfaces.normals), size=config.batch)
    again.choice(len(pool), config.batch), again.integers(len(source.surfaces.normals), size=config.batch)
    normals = torch.from_numpy(np.asarray(source.surfaces.normals[index])).float()
    tan_half = source.surfaces.tan_half[index]
    batch = source.compose(chosen, normals, tan_half, rng)
    materials = [draw_material(again, lit.alpha) for lit in chosen]  # compose draws them first
    estimated, root_alpha = estimate_surface(net, batch)
    return {
        "true": _thin(normals.numpy(), normals.shape[-1] // SIZE).astype(np.float16),
        "estimated": estimated.numpy().astype(np.float16),
        "mask": pooled(batch.photo[:, 3:], SIZE)[:, 0].numpy().astype(np.float16),
        "tan_half": np.asarray(tan_half, np.float32),
        "root_alpha": batch.alpha.sqrt().numpy(),
        "estimated_root_alpha": root_alpha.numpy(),
        "metal": np.array([not one.albedo.any() for one in materials]),
    }


def estimate_surface(net: LightNet, batch: Batch) -> tuple[torch.Tensor, torch.Tensor]:
    """Unit normals [N, 3, 32, 32] and root alpha [N] that a net makes of photos alone."""
    guess = net(batch.photo, batch.tan_half[:, None])
    return F.normalize(pooled(guess.normals, SIZE), dim=1), guess.features.root_alpha[:, 0]


def pooled(pictures: torch.Tensor, size: int) -> torch.Tensor:
    """Means of squares: [N, C, S, S] to [N, C, size, size]."""
    return F.avg_pool2d(pictures, pictures.shape[-1] // size)


def make_seen_surfaces(data: Path, folder: Path, first: Path, steps: int) -> None:
    """Make first_stage.npz in the folder of the second stage's run.

    first: weights of `anyprobe weights --keep`. steps: batches of 32 photos.
    """
    store = load_assets(LightConfig(), data)
    maps = [asset.radiance for asset in store.maps.values()]
    surfaces = build_surfaces(list(store.shapes.values()), SURFACES, folder / "cache")
    nets = Lift.networks()
    load_init_weights(nets, first)
    config = replace(lift().pairs, seed=311, batch=32, **dict.fromkeys(PLAIN, 0.0))
    illuminator = Illuminator(maps, compiled=False)
    seen = look_at_surfaces(nets["light"].eval(), illuminator, surfaces, config, steps)
    seen.save(folder / "first_stage.npz")


def _thin(pictures: np.ndarray, every: int) -> np.ndarray:
    """Of so many pixels of pictures [..., H, W] along either side, the one nearest their middle."""
    return pictures[..., every // 2 :: every, every // 2 :: every]
