"""What others estimate in the place of Eq. 5's irradiance: the paper's Fig. 4.

Both forget the material. The functions run on NumPy arrays and on torch tensors.
"""

from __future__ import annotations

import numpy as np
from array_api_compat import array_namespace

from anyprobe.core.color import luminance
from anyprobe.core.frames import reflect, world_from_local
from anyprobe.core.sampling import square_to_uniform_hemisphere
from anyprobe.light.octahedral import Pyramid, lookup
from anyprobe.render.integrate import LOD_BIAS


def uniform_irradiance(pyramid: Pyramid, n, u):
    """Mean of the incident light over the hemisphere about n: Eq. 5's first factor, sampled evenly.

    The same for every alpha and view.

    Args:
        n: [P, 3].
        u: [S, 2].
    Returns:
        [P, 3] radiance units.
    """
    xp = array_namespace(n, u)
    wi = world_from_local(square_to_uniform_hemisphere(u)[None], n[:, None])
    # the level whose texel, 4 pi / side^2, covers a sample's share, 2 pi / S
    level = 0.5 * np.log2(0.5 * pyramid.side**2 / u.shape[0]) + LOD_BIAS
    return xp.mean(lookup(pyramid, wi, xp.zeros_like(wi[..., 0]) + level), axis=1)


def grey_mirror(pyramid: Pyramid, n, wo):
    """Luminance of the map at reflect(wo, n), three equal channels: Meka et al. 2018's mirror image.

    Args:
        n, wo: [P, 3].
    Returns:
        [P, 3] radiance units.
    """
    xp = array_namespace(n, wo)
    wi = reflect(wo, n)
    grey = luminance(lookup(pyramid, wi, xp.zeros_like(wi[..., 0])))
    return xp.stack([grey, grey, grey], axis=-1)
