"""Shape annotations are checked at every call that a test makes.

The product annotates arrays with jaxtyping (`Float[np.ndarray, "H 2*H 3"]`) and imports it for type checkers alone, so
the annotations are strings here. `install` decorates each function that has one with a check of its arguments and of
what it returns; names of axes are consistent within a call.
"""

from __future__ import annotations

import functools
import inspect
import re
import sys
from collections.abc import Callable
from importlib.machinery import PathFinder, SourceFileLoader
from types import ModuleType
from typing import Any

import jaxtyping
import numpy as np

SHAPED = re.compile(r"\b(?:Float|Float16|Float32|Float64|Int|UInt8|Bool|Num|Shaped|Inexact|Real)\[")


class _Loader(SourceFileLoader):
    """Wraps a module's functions and methods when it is imported, before others take them by name."""

    def exec_module(self, module: ModuleType) -> None:
        super().exec_module(module)
        for owner in (module, *(one for one in vars(module).values() if isinstance(one, type))):
            if getattr(owner, "__module__", module.__name__) == module.__name__:
                for name, value in list(vars(owner).items()):
                    if inspect.isfunction(value) and value.__module__ == module.__name__:
                        setattr(owner, name, checked(value))


class _Finder(PathFinder):
    @classmethod
    def find_spec(cls, fullname, path=None, target=None):
        if fullname.split(".")[0] != "anyprobe":
            return None
        spec = super().find_spec(fullname, path, target)
        if spec is not None and type(spec.loader) is SourceFileLoader:
            spec.loader = _Loader(spec.loader.name, spec.loader.path)
        return spec


def install() -> None:
    """Check all modules of the package that are imported from now on."""
    if any(name.split(".")[0] == "anyprobe" for name in sys.modules):
        raise RuntimeError("expected the checks before the package is imported, got them after it")
    sys.meta_path.insert(0, _Finder)


def checked(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function, with a check of what its annotations say of shapes; itself where they say nothing."""
    texts = {
        name: text
        for name, text in getattr(function, "__annotations__", {}).items()
        if isinstance(text, str) and SHAPED.search(text)
    }
    if not texts or isinstance(function, type):
        return function
    signature = inspect.signature(function)

    @functools.cache
    def kinds() -> dict[str, Any]:
        return {name: _evaluated(text) for name, text in texts.items()}

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        try:
            given = signature.bind(*args, **kwargs).arguments
        except TypeError:  # said by the function itself
            return function(*args, **kwargs)
        with jaxtyping.jaxtyped("context"):
            for name, kind in kinds().items():
                if name in given:
                    _check(function, name, given[name], kind, texts[name])
            result = function(*args, **kwargs)
            if "return" in texts:
                _check(function, "return", result, kinds()["return"], texts["return"])
        return result

    return call


def _evaluated(text: str) -> Any:
    scope: dict[str, Any] = {name: one for name, one in vars(jaxtyping).items() if name[0].isupper()}
    scope |= {"np": np, "torch": sys.modules.get("torch"), "Any": object}
    try:
        return eval(text, scope)
    except NameError:  # it names a type of the product's too
        return None


def _check(function: Callable[..., Any], name: str, value: Any, kind: Any, text: str) -> None:
    if getattr(kind, "__origin__", None) is tuple and isinstance(value, tuple):
        kinds = kind.__args__[:1] * len(value) if kind.__args__[-1] is Ellipsis else kind.__args__
        parts = list(zip(value, kinds, strict=True))
    else:
        parts = [(value, kind)]
    for one, of in parts:
        if isinstance(one, np.ndarray) and of is not None and of is not object and not isinstance(one, of):
            where = f"{function.__module__}.{function.__qualname__}"
            raise AssertionError(f"{where}: {name}: expected {text}, got {one.dtype} {one.shape}")
