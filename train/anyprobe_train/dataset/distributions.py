"""Priors of materials and cameras: the paper's, "metal and non-metal from diffuse to specular", and the real world's:
reflectances of objects, and the exposure and white balance that phones choose.

The latter are given by their quantiles at PROBABILITIES, between which the logarithm is linear, so that drawing from
them and their density are both exact. They are our own and follow these measurements:

- the 100 measured materials of MERL (Matusik et al., A Data-Driven Reflectance Model, SIGGRAPH 2003), as fitted by
  Bagher, Soler and Holzschuch (Accurate fitting of measured reflectances using a Shifted Gamma micro-facet
  distribution, EGSR 2012, Table 2): quantiles .1 .25 .5 .75 .9 of the diffuse part's luminance, of 39 dull dielectrics
  .014 .051 .116 .207 .246, of 31 glossy ones .013 .031 .060 .129 .223; of the lobe's width, the square root of their
  alpha: dull .22 .27 .37 .46 .53, glossy .012 .022 .035 .075 .13, 21 metals and metallic paints .009 .016 .079 .17 .33;
- light reflectance values of finished surfaces (SLL/CIBSE Lighting Guide 11, 2001; DIAL evo and Osram's tables): white
  paint, plaster and tiles .7-.8, light wood .3-.6, concrete .2-.3, brick .1-.2, dark wood .1-.2, black .04-.1.

The two disagree on whites: MERL's white paint has .35 and its Teflon .27, where spectrophotometers have .8 and .95. So
the middle of the dull materials follows MERL, sheen included, and the upper tenths follow the tables.
"""

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.scatter.materials import Material

ALPHA_MIN = 0.01
SPECULAR_BELOW = 0.5
"""Border between specular and diffuse materials in the paper [GGX alpha]."""

METALS = (  # linear Rec. 709 reflectance at normal incidence
    (1.00, 0.77, 0.34),  # gold
    (0.96, 0.64, 0.54),  # copper
    (0.97, 0.96, 0.92),  # silver
    (0.91, 0.92, 0.92),  # aluminium
    (0.56, 0.57, 0.58),  # iron
    (0.55, 0.56, 0.55),  # chromium
    (0.89, 0.79, 0.43),  # brass
)


def f0_from_ior(ior):
    """Compute a dielectric's reflectance at normal incidence in air: ((n - 1) / (n + 1))^2."""
    return ((ior - 1.0) / (ior + 1.0)) ** 2


def draw_alpha(rng: np.random.Generator, specular: bool) -> float:
    """Draw a GGX width: log-uniform in [0.01, 0.5) for specular, uniform in [0.5, 1] for diffuse."""
    if specular:
        return float(np.exp(rng.uniform(np.log(ALPHA_MIN), np.log(SPECULAR_BELOW))))
    return float(rng.uniform(SPECULAR_BELOW, 1.0))


METAL_SHARE = 0.4


def draw_material(rng: np.random.Generator, alpha: float, metal: bool | None = None) -> Material:
    """Draw a metal with a slightly varied tabulated f0, or a dielectric; METAL_SHARE decides unless `metal` does.

    Dielectrics have an index of refraction in [1.3, 1.8] and an albedo that is
    white to dark, often grey, sometimes strongly coloured.
    """
    drawn = rng.random() < METAL_SHARE
    if drawn if metal is None else metal:
        f0 = np.array(METALS[rng.integers(len(METALS))]) * rng.uniform(0.75, 1.0) + rng.normal(0, 0.02, 3)
        return Material(albedo=np.zeros(3, np.float32), f0=np.clip(f0, 0.2, 1.0).astype(np.float32), alpha=alpha)
    f0 = np.full(3, f0_from_ior(rng.uniform(1.3, 1.8)), np.float32)
    value = rng.uniform(0.08, 0.9)
    tint = np.exp(rng.normal(0.0, rng.choice([0.03, 0.15, 0.6]), size=3))
    albedo = np.clip(value * tint / tint.max(), 0.01, 0.95).astype(np.float32)
    return Material(albedo=albedo, f0=f0, alpha=alpha)


KINDS = ("metal", "smooth", "rough", "painted")
"""Kinds of materials: bare metal; glossy plastic, glaze, varnish, polished stone; unglazed clay, wood, stone, rubber,
matte plastic; paint."""
SHARES = (0.2, 0.25, 0.35, 0.2)
"""Share of each kind among photographed objects, our own estimate: nobody has counted them."""

PROBABILITIES = (0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0)
ALPHA = np.array(
    [
        (0.01, 0.02, 0.04, 0.10, 0.22, 0.40, 0.80),
        (0.01, 0.015, 0.025, 0.045, 0.10, 0.18, 0.30),
        (0.25, 0.32, 0.40, 0.52, 0.68, 0.82, 1.00),
        (0.05, 0.12, 0.22, 0.32, 0.45, 0.60, 0.90),
    ]
)
"""Quantiles of the GGX width, one row per kind."""
ALBEDO = np.array(
    [
        (1e-9,) * 7,
        (0.005, 0.03, 0.08, 0.16, 0.30, 0.55, 0.85),
        (0.02, 0.08, 0.14, 0.23, 0.36, 0.60, 0.88),
        (0.03, 0.08, 0.20, 0.42, 0.66, 0.80, 0.88),
    ]
)
"""Quantiles of the diffuse albedo's luminance; metals have none."""
MAX_ALBEDO = 0.92
"""Largest albedo of a channel: barium sulphate aside, nothing reflects more than fresh snow."""

IOR, IOR_SPREAD, IOR_RANGE = 1.5, 0.06, (1.35, 1.75)
"""Mean, standard deviation and bounds of a dielectric's index of refraction: plastics 1.46-1.59, glazes and glass
1.5-1.6, resins 1.5 (Polyanskiy, refractiveindex.info)."""
METAL_SHARES = (0.08, 0.10, 0.10, 0.22, 0.20, 0.15, 0.15)
"""Shares of METALS, in their order; a polished surface loses up to a fifth of the table's f0."""

TINTS = (0.25, 0.5, 0.25)
"""Shares of nearly grey, natural and pigmented colours among dielectrics. Natural reflectance rises with the
wavelength: MERL's dull materials have ln R/G of .05 .28 .93 and ln B/G of -.58 -.12 -.02 at their quartiles."""

KEY, KEY_SPREAD = 0.18, 0.35
"""Median of the radiance that the meter's mean is brought to, and the standard deviation of its logarithm (half a
stop): 18 % grey (ISO 2720's K of 12.5 is 12.7 %); a photo's mean display value is near .42 by it."""
PHOTO_KEY = 0.22
"""The same of whole photos, whose frame is metered as it is seen: objects in 85 real photos have a mean linear radiance
of .09 .13 .23 .29 .39 (10 25 50 75 90 %), frames of .16 .20 .24 .34 .43."""
OBJECT_WEIGHT = (0.2, 0.8)
"""Range of the object's weight in the meter's mean: centre-weighted meters give their middle 60-80 % (Nikon: 75), which
an object fills in part."""
OBJECT_RANGE = (0.01, 0.9)
"""Bounds of the object's mean radiance: a photo beyond them gets the gain that brings it to the nearer one."""
FRAME_DEG = 33.0
"""Half the field of view that a phone meters [degrees]: 26 mm equivalent, 65 x 51 degrees."""
FRAME_POWER = 0.45
"""Exponent of luminance in the meter's mean: meters average display values, so that light sources count less."""

ADAPTED = (0.3, 0.9)
"""Range of the exponent by which white balance removes the light's colour; a map's photographer removed a part
before."""
BALANCE_ERROR = (0.06, 0.03, 0.08)
"""Standard deviations of the logarithm of the gains, RGB: 3 degrees, as methods of colour constancy err by 1.8 (Barron
and Tsai, Fast Fourier Color Constancy, CVPR 2017) to 6 (grey world) in the mean."""


def draw_kinds(rng: np.random.Generator, count: int) -> np.ndarray:
    """Draw N indices into KINDS, by SHARES."""
    return rng.choice(len(KINDS), count, p=SHARES)


def draw_alphas(rng: np.random.Generator, kind: np.ndarray) -> np.ndarray:
    """Draw the GGX widths [N] of kinds [N]."""
    return _quantile(ALPHA, kind, rng.random(len(kind)))


def draw_colors(
    rng: np.random.Generator, kind: np.ndarray, rank: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Draw albedo and f0, [N, 3] each, of kinds [N]; rank [N] in [0, 1), how bright each is among its kind, is drawn
    if not given."""
    count = len(kind)
    rank = rng.random(count) if rank is None else rank
    value = _quantile(ALBEDO, kind, rank)
    albedo = _tinted(value, _draw_tints(rng, value))
    order = np.argsort(luminance(np.array(METALS)))
    upto = np.cumsum(np.array(METAL_SHARES)[order])
    which = order[np.minimum(np.searchsorted(upto, rank, side="right"), len(METALS) - 1)]
    metal = np.array(METALS)[which] * rng.uniform(0.8, 1.0, (count, 1))
    ior = np.clip(rng.normal(IOR, IOR_SPREAD, (count, 1)), *IOR_RANGE)
    bare = (kind == 0)[:, None]
    f0 = np.where(bare, metal, f0_from_ior(ior))
    return np.where(bare, 0.0, albedo).astype(np.float32), f0.astype(np.float32)


def draw_one(rng: np.random.Generator, kind: int, alpha: float, rank: float | None = None) -> Material:
    """Draw one material of a kind and a width; rank as in draw_colors."""
    ranks = None if rank is None else np.array([rank])
    albedo, f0 = draw_colors(rng, np.array([kind]), ranks)
    return Material(albedo=albedo[0], f0=f0[0], alpha=alpha)


def draw_metering(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Draw the weight of the object in the meter's mean and the radiance that this mean is brought to, [N] each."""
    return rng.uniform(*OBJECT_WEIGHT, count), KEY * np.exp(rng.normal(0.0, KEY_SPREAD, count))


def frame_level(seen: np.ndarray) -> np.ndarray:
    """Return the metered luminance [...] of the frame around an object; seen: luminance [..., H, 2H] of a map."""
    height = seen.shape[-2]
    weights = pixel_solid_angles(height) * (-pixel_directions(height)[..., 2] > np.cos(np.radians(FRAME_DEG)))
    weights = (weights / weights.sum()).astype(np.float32)
    return ((np.asarray(seen) ** FRAME_POWER) * weights).sum(axis=(-2, -1)) ** (1.0 / FRAME_POWER)


def metered_gain(object_mean, frame, weight, key):
    """Return the gain [...] from radiance to exposure units that brings the mean of object and frame to the key.

    object_mean: mean luminance of the object. frame: frame_level. weight, key: draw_metering.
    """
    power = FRAME_POWER
    mean = weight * np.maximum(object_mean, 1e-6) ** power + (1.0 - weight) * np.maximum(frame, 1e-6) ** power
    return key / mean ** (1.0 / power)


def seen_level(seen: np.ndarray) -> float:
    """Return the metered luminance of pixels of a picture, of any shape."""
    return float((seen**FRAME_POWER).mean() ** (1.0 / FRAME_POWER))


def draw_photo_gain(rng: np.random.Generator, object_mean: float, frame: float, spread: float = 0.4) -> float:
    """Draw the gain from radiance to exposure units of a whole photo, whose object is neither black nor burnt out.

    object_mean: mean luminance of the object. frame: seen_level of the photo. spread: standard deviation of ln of the
    radiance that the meter's mean is brought to; world.look.draw_look calls it with this default.
    """
    (weight,), _ = draw_metering(rng, 1)
    key = PHOTO_KEY * float(np.exp(rng.normal(0.0, spread)))
    gain = float(metered_gain(object_mean, frame, weight, key))
    return gain * float(np.clip(object_mean * gain, *OBJECT_RANGE)) / max(object_mean * gain, 1e-9)


def draw_white_balance(rng: np.random.Generator, ambient: np.ndarray) -> np.ndarray:
    """Draw white-balance gains [N, 3], of luminance 1 for white, of cameras in light of mean colours ambient [N, 3]."""
    grey = np.maximum(ambient / np.maximum(luminance(ambient), 1e-9)[:, None], 0.05)
    adapted = rng.uniform(*ADAPTED, (len(ambient), 1))
    gains = np.exp(rng.normal(0.0, BALANCE_ERROR, ambient.shape)) * grey**-adapted
    return (gains / luminance(gains)[:, None]).astype(np.float32)


def _quantile(table: np.ndarray, kind: np.ndarray, rank: np.ndarray) -> np.ndarray:
    rows = np.stack([np.interp(rank, PROBABILITIES, row) for row in np.log(table)])
    return np.exp(rows[kind, np.arange(len(kind))])


def _draw_tints(rng: np.random.Generator, value: np.ndarray) -> np.ndarray:
    """Draw colour factors [N, 3] of any luminance; nearly white materials are nearly grey."""
    count = len(value)
    which = rng.choice(3, count, p=TINTS)[:, None]
    warm = np.abs(rng.normal(0.0, 0.45, (count, 1)))
    natural = np.concatenate([warm, np.zeros_like(warm), -warm], axis=1) + rng.normal(0.0, 0.08, (count, 3))
    spread = np.where(which == 0, 0.04, 0.6) * rng.normal(0.0, 1.0, (count, 3))
    paler = np.clip(1.3 - 1.3 * value, 0.2, 1.0)[:, None]
    return np.exp(paler * np.where(which == 1, natural, spread))


def _tinted(value: np.ndarray, tint: np.ndarray) -> np.ndarray:
    """Return colours [N, 3] of luminance value [N], darkened where a channel would exceed MAX_ALBEDO."""
    color = tint * (value / luminance(tint))[:, None]
    return color * np.minimum(1.0, MAX_ALBEDO / color.max(axis=1, keepdims=True))
