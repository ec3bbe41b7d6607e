"""Directional albedo of GGX microfacets; alpha is the GGX width.

The directional albedo is the share of an even light that the coat sends to the eye. With F = f0 + (1 - f0) s it is
f0 E1 + (1 - f0) Es, two numbers of n.wo and alpha alone (Karis 2013 keeps them in a picture, as this table does).
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from array_api_compat import array_namespace

from anyprobe.core.latlong import corners
from anyprobe.core.sampling import ggx_visible_normal_xyz, hammersley
from anyprobe.paper.equations import schlick_weight, smith_visibility

if TYPE_CHECKING:
    from jaxtyping import Float


COSINES, ROUGHNESSES = 64, 32
"""Number of entries from n.wo = 0 to 1 and from sqrt(alpha) = 0.1 to 1."""
SAMPLES = 512


@lru_cache(maxsize=1)
def albedo_table() -> Float[np.ndarray, "ROUGHNESSES COSINES 2"]:
    """Tabulate E1 and Es, [ROUGHNESSES, COSINES, 2] float32.

    Half vectors follow the normals that the eye sees; the weight of each is then G / G1.
    """
    u = hammersley(SAMPLES).astype(np.float64)
    alpha = (np.linspace(0.1, 1.0, ROUGHNESSES) ** 2)[:, None, None]
    cosine = np.maximum(np.linspace(0.0, 1.0, COSINES), 1e-3)[None, :, None]
    sine = np.sqrt(1.0 - cosine**2)
    x, _, z = ggx_visible_normal_xyz(u, sine, 0.0 * sine, cosine, alpha)
    wo_dot_h = x * sine + z * cosine
    n_dot_wi = np.maximum(2.0 * wo_dot_h * z - cosine, 0.0)
    # G1 = 2 (n.wo) / (n.wo + sqrt(alpha^2 + (1 - alpha^2) (n.wo)^2)), G = 4 (n.wo) (n.wi) V
    inverse_g1 = cosine + np.sqrt(alpha**2 + (1.0 - alpha**2) * cosine**2)
    weight = 2.0 * n_dot_wi * smith_visibility(cosine, n_dot_wi, alpha) * inverse_g1
    return np.stack([weight.mean(axis=2), (weight * schlick_weight(wo_dot_h)).mean(axis=2)], axis=-1).astype(np.float32)


def directional_albedo(n_dot_wo, alpha, table):
    """Interpolate E1 and Es in albedo_table (an array of the same kind), in the joint shape of n_dot_wo and alpha;
    beyond the table its edge continues."""
    xp = array_namespace(n_dot_wo, table)
    column = xp.clip(n_dot_wo * (COSINES - 1), 0.0, COSINES - 1.001)
    row = xp.clip((alpha**0.5 - 0.1) * ((ROUGHNESSES - 1) / 0.9), 0.0, ROUGHNESSES - 1.001) + 0.0 * column
    column = column + 0.0 * row
    flat = xp.reshape(table, (-1, 2))
    weighted = corners(column, row, COSINES)
    return tuple(sum(flat[index, kind] * share for index, share in weighted) for kind in range(2))
