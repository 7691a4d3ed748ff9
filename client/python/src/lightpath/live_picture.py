"""What a running hologram has reached, for a notebook."""

from __future__ import annotations

import contextlib
import threading
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

PAUSE_S = 2.0
"""Time between two questions. The server draws no picture sooner."""


class LivePicture:
    """Fetches pictures in a thread of its own, so that a slow server or a lost connection does not hold up the wait."""

    def __init__(self, fetch: Callable[[], bytes]) -> None:
        self.latest = b""
        """The latest picture as a PNG; empty: there is none yet."""
        self._fetch = fetch
        self._ended = threading.Event()
        threading.Thread(target=self._follow, daemon=True).start()

    def _follow(self) -> None:
        while not self._ended.wait(PAUSE_S):
            # There is none before the first seconds of a job, and the card does well without one.
            with contextlib.suppress(OSError):
                self.latest = self._fetch()

    def close(self) -> None:
        """Fetch no more pictures."""
        self._ended.set()
