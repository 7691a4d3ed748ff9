"""What a user sees of a long computation."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeAlias

from tqdm.auto import tqdm

if TYPE_CHECKING:
    from collections.abc import Iterator

Progress: TypeAlias = Callable[[int, int, float], Any] | bool
"""A function that gets step, number of steps and loss; True for a bar; False for nothing."""


@contextlib.contextmanager
def listener(progress: Progress, title: str) -> Iterator[Callable[[int, int, float], Any] | None]:
    """Return the function that the engine calls."""
    if not isinstance(progress, bool):
        yield progress
        return
    if not progress:
        yield None
        return
    with tqdm(desc=title, unit="step") as bar:

        def listen(step: int, steps_total: int, loss: float) -> None:
            bar.total = steps_total
            bar.set_postfix_str(f"loss {loss:.3g}", refresh=False)
            bar.update(step - bar.n)

        yield listen
