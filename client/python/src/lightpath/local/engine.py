"""The compiled engine, and its refusals as exceptions of this package."""

from __future__ import annotations

import contextlib
from importlib import metadata
from typing import TYPE_CHECKING

from lightpath.errors import LightpathError

try:
    import lightpath_engine as engine
except ImportError as error:
    raise ImportError(
        "lightpath.local needs the package lightpath-engine, Lightpath's compiled engine: pip install"
        ' "lightpath[engine]", or in a checkout pip install client/python/engine, which needs Rust',
        name="lightpath_engine",
    ) from error

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["EngineRefused", "engine", "refusals"]


def _check_version() -> None:
    own = metadata.version("lightpath")
    if engine.__version__ != own:
        raise ImportError(
            f"lightpath is version {own}, but lightpath-engine is version {engine.__version__}: install the same"
            " version of both",
            name="lightpath_engine",
        )


_check_version()

# The engine's names of quantities end in their unit; the arguments of this package do not.
_UNITS = ("_rad", "_m")


class EngineRefused(LightpathError, ValueError):
    """The engine refused an argument. `reason` is a word such as `OUT_OF_RANGE`, `UNSUITABLE` or `INVALID_KERNEL`."""

    def __init__(self, field: str, reason: str, message: str) -> None:
        super().__init__(message)
        self.field, self.reason, self.fix = field, reason, message


@contextlib.contextmanager
def refusals() -> Iterator[None]:
    """Turn refusals of the engine into `EngineRefused`."""
    try:
        yield
    except engine.EngineError as error:
        field, reason, message = error.args
        for unit in _UNITS:
            field = field.removesuffix(unit)
        raise EngineRefused(
            {"target_intensity": "target", "photo": "captures"}.get(field, field), reason, message
        ) from None
