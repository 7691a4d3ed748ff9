"""When a call is made again, and after which pause.

| code | made again |
|---|---|
| UNAVAILABLE, lost connection | after growing pauses, about 15 s in all, once the server has answered before |
| ABORTED | the same, because somebody else does the same at this moment |
| RESOURCE_EXHAUSTED | if the server names a pause of at most 10 s |
| all others | never |

A call that would change something twice, such as a rollback, is never made again.
"""

from __future__ import annotations

from lightpath.errors import Aborted, Exhausted, LightpathError, Unreachable

PAUSE_MIN_S = 0.1
PAUSE_MAX_S = 3.0
TRIES_MAX = 10
"""Tries without progress. The pauses between them last about 15 s in total."""

WAIT_TRIES_MAX = 200
"""Tries to reach the server again while waiting. They take about ten minutes: enough for a restart with recovery."""

NAMED_PAUSE_MAX_S = 10.0
"""A longer pause, such as that for a full disk, needs a person."""


class Backoff:
    """Counts tries, and doubles the pause between them."""

    def __init__(self, tries_max: int = TRIES_MAX) -> None:
        self._tries, self._tries_max = 0, tries_max

    def reset(self) -> None:
        """Start again after progress."""
        self._tries = 0

    def pause_s(self, error: LightpathError) -> float:
        """Return the pause before the next try [s]. Raises `error` if another try cannot help."""
        self._tries += 1
        if self._tries >= self._tries_max or not may_succeed_later(error):
            raise error
        pause_s = min(PAUSE_MIN_S * 2.0 ** min(self._tries - 1, 8), PAUSE_MAX_S)
        named_s = error.retry_after_s if isinstance(error, Exhausted | Aborted) else None
        return max(pause_s, named_s or 0.0)


def may_succeed_later(error: LightpathError) -> bool:
    """Return whether the same call may succeed in a moment."""
    if isinstance(error, Exhausted):
        return error.retry_after_s is not None and error.retry_after_s <= NAMED_PAUSE_MAX_S
    return isinstance(error, Unreachable | Aborted)
