"""HDR environment light from one photo of any object.

>>> import anyprobe
>>> light = anyprobe.estimate("photo.png")   # doctest: +SKIP
>>> light.save("light.exr")                  # doctest: +SKIP

Frame throughout: right-handed, +X right, +Y up, the camera looks along -Z.
"""

from anyprobe.errors import (
    AnyprobeError,
    InputError,
    InvalidEnvironment,
    InvalidMask,
    InvalidMesh,
    InvalidPhoto,
    MissingExtra,
    ModelError,
    OutputError,
)
from anyprobe.estimate.estimator import Estimator, Settings, estimate
from anyprobe.estimate.multiview import fuse_lights
from anyprobe.estimate.photo import Photo, load_photo
from anyprobe.estimate.result import Light
from anyprobe.inputs.hints import Hints
from anyprobe.light.light_sources import LightSource
from anyprobe.notices import Notice
from anyprobe.scatter.materials import Material

__version__ = "0.2.0"


def __dir__() -> list[str]:
    """Return only the public names, for completion."""
    return [*__all__, "__version__"]


__all__ = [
    "AnyprobeError",
    "Estimator",
    "Hints",
    "InputError",
    "InvalidEnvironment",
    "InvalidMask",
    "InvalidMesh",
    "InvalidPhoto",
    "Light",
    "LightSource",
    "Material",
    "MissingExtra",
    "ModelError",
    "Notice",
    "OutputError",
    "Photo",
    "Settings",
    "estimate",
    "fuse_lights",
    "load_photo",
]
