"""The compiled engine, and its refusals as exceptions of this package."""

from __future__ import annotations

import contextlib
from importlib import metadata
from typing import TYPE_CHECKING

from lightpath.argument_names import argument, in_text
from lightpath.errors import LightpathError

try:
    from lightpath import _engine as engine
except ImportError as error:
    raise ImportError(
        "lightpath.local needs the compiled engine, which this installation of lightpath lacks: install it again"
        " without LIGHTPATH_ENGINE=none, in a checkout with pip install ./client/python, which needs Rust",
        name="lightpath._engine",
    ) from error

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["EngineRefused", "engine", "refusals"]


def _check_version() -> None:
    own = metadata.version("lightpath")
    if engine.__version__ != own:
        raise ImportError(
            f"lightpath is version {own}, but its engine is version {engine.__version__}: install lightpath again",
            name="lightpath._engine",
        )


_check_version()


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
        name = {"photo": "captures"}.get(field, argument(field))
        raise EngineRefused(name, reason, in_text(message)) from None
