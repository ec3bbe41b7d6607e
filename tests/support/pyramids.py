"""The octahedral pyramid read with vectors in one array, as tests have them."""

from array_api_compat import array_namespace

from anyprobe.light.octahedral import Pyramid, lookup_rgb


def lookup(pyramid: Pyramid, d, lod):
    """Radiance [..., 3] around unit directions d [..., 3] at the nearest level to lod [...]."""
    return array_namespace(d).stack(lookup_rgb(pyramid, d[..., 0], d[..., 1], d[..., 2], lod), axis=-1)
