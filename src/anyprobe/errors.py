"""Every error that anyprobe raises on purpose.

AnyprobeError
  + InputError (ValueError)         the caller can mend it
      - InvalidPhoto                not an image, too large, NaN, ...
      - InvalidMask                 absent, empty, of another size, too small
      - InvalidEnvironment          a map that is not H x 2H, negative, NaN
      - InvalidMesh                 a mesh file that cannot be rendered
  + OutputError (OSError)           a file that could not be written
  + ModelError                      weights absent, damaged or of another contract
  + MissingExtra (ImportError)      an optional package is not installed

Each message is one line: what is wrong and what to do; of a value, what was expected and what came.
"""


class AnyprobeError(Exception):
    """Root of the tree; the command line prints it as one line and exits with 2."""


class InputError(AnyprobeError, ValueError):
    """The caller's input is at fault."""


class InvalidPhoto(InputError):
    """The photo cannot be read as one."""


class InvalidMask(InputError):
    """The object's mask is absent or unusable."""


class InvalidEnvironment(InputError):
    """The map is not an equirectangular radiance map."""


class InvalidMesh(InputError):
    """The mesh cannot be rendered."""


class OutputError(AnyprobeError, OSError):
    """A result could not be written; nothing half-written is left."""


class ModelError(AnyprobeError):
    """A network file is absent, damaged or of another contract."""


class MissingExtra(AnyprobeError, ImportError):
    """An optional dependency is absent; the message names the extra."""

    def __init__(self, package: str, extra: str, purpose: str) -> None:
        super().__init__(f"{purpose} needs the package {package}; from a clone: pip install '.[{extra}]'")
