"""All errors that anyprobe raises on purpose.

AnyprobeError
  + InputError (ValueError)         the caller can fix it
      - InvalidPhoto                not an image, too large, NaN, ...
      - InvalidMask                 absent, empty, of another size, too small
      - InvalidEnvironment          a map that is not H x 2H, negative, NaN
      - InvalidMesh                 a mesh file that cannot be rendered
  + OutputError (OSError)           a file that could not be written
  + ModelError                      weights absent, damaged or of another contract
  + MissingExtra (ImportError)      an optional package is not installed

Each message is one line: what is wrong and what to do; for a value, what was expected and what was given.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

from anyprobe.notices import Notice, Remedy


class AnyprobeError(Exception):
    """Root of the tree; the command line prints it as one line and exits with 2.

    Attributes:
        notice: the error as data: code, subject, text, remedy, source.
    """

    default_code: ClassVar[str] = "failed"
    notice: Notice

    def __init__(
        self,
        text: object = "",
        *,
        code: str = "",
        subject: str | Iterable[str] = (),
        remedy: Iterable[Remedy] = (),
        source: object = "",
    ) -> None:
        """Take the parts of a Notice; parts left out come from the text if that is a Notice or an error."""
        text = text.notice if isinstance(text, AnyprobeError) else text
        notice = Notice(text, code=code, subject=subject, remedy=remedy, source=source)
        self.notice = notice if notice.code else Notice(notice, code=self.default_code)
        super().__init__(self.notice)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the error with its notice, for other processes."""
        return _restore, (type(self), self.notice)

    @property
    def code(self) -> str:
        """Code for programs, see docs/reference/errors.md."""
        return self.notice.code

    @property
    def subject(self) -> tuple[str, ...]:
        """Keywords of the arguments concerned."""
        return self.notice.subject


def _restore(kind: type[AnyprobeError], notice: Notice) -> AnyprobeError:
    error = kind.__new__(kind)
    AnyprobeError.__init__(error, notice)
    return error


@contextmanager
def arguments_named(**names: str) -> Iterator[None]:
    """Rename the arguments in errors to the caller's own: `size="scale"` where it passes size=scale."""
    try:
        yield
    except InputError as error:
        raise _restore(type(error), error.notice.naming(names)) from error


class InputError(AnyprobeError, ValueError):
    """The caller's input is at fault."""

    default_code = "invalid-option"


class InvalidPhoto(InputError):
    """The photo cannot be read as one."""

    default_code = "invalid-image"


class InvalidMask(InputError):
    """The object's mask is absent or unusable."""


class InvalidEnvironment(InputError):
    """The map is not an equirectangular radiance map."""

    default_code = "invalid-map"


class InvalidMesh(InputError):
    """The mesh cannot be rendered."""

    default_code = "invalid-mesh"


class OutputError(AnyprobeError, OSError):
    """A result could not be written; nothing half-written is left."""

    default_code = "not-written"


class ModelError(AnyprobeError):
    """A network file is absent, damaged or of another contract."""

    default_code = "invalid-model"


class MissingExtra(AnyprobeError, ImportError):
    """An optional dependency is absent; the message names the extra."""

    default_code = "unsupported"

    def __init__(
        self, package: str, extra: str, purpose: str, error: ImportError | None = None, folder: str = "."
    ) -> None:
        """error: what its import raised; a package may be there and not load, for want of memory or of a library;
        folder: of the distribution that has the extra, in a clone."""
        text = f"{purpose} needs the package {package}; from a clone: pip install '{folder}[{extra}]'"
        if error is not None and not isinstance(error, ModuleNotFoundError):
            reason = " ".join(str(error).split())[:120]
            text = f"{purpose} needs the package {package}, which cannot be loaded ({reason}); reinstall it"
        super().__init__(text)


def optional(module: str, package: str, extra: str, purpose: str) -> Any:
    """Import a module of an optional package, which `extra` installs; MissingExtra where it is absent."""
    try:
        return __import__(module)
    except ImportError as error:
        raise MissingExtra(package, extra, purpose, error) from error
