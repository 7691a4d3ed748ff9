"""Events: what changes on the server."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

from lightpath import v1, words

if TYPE_CHECKING:
    from lightpath.words import State


@dataclass(frozen=True)
class Event:
    """A change on the server."""

    id: str
    """Where the stream stands: `lab.events(after=event.id)` goes on behind it."""
    kind: str
    """`job`, `kernel`, `dataset`, `display`, `device`, `queue`; `reset`: what you read before may be old.

    A newer server may have more kinds, which are `unknown` here.
    """
    name: str
    """Resource name of what changed, such as `jobs/{id}`. Empty for `reset` and for the queue."""
    state: State | None
    """New state of a job; None for all other kinds."""
    message: v1.Event = field(repr=False)
    """The event as the server sent it. That of a job has what lists show of it."""


def read_event(message: v1.Event) -> Event:
    """Return the event that a message describes."""
    kind = message.WhichOneof("change") or "unknown"
    name, state = "", None
    if kind == "job":
        name, state = message.job.name, cast("State", words.name_of(v1.Job.State, message.job.state))
    elif kind not in {"reset", "unknown"}:
        name = getattr(message, kind).name
    return Event(message.id, kind, name, state, message)
