"""How a job gets on, while a program waits for it: a bar on a terminal, a card in a notebook, otherwise nothing."""

from __future__ import annotations

import contextlib
import importlib
import math
import sys
import time
from html import escape
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

from tqdm import tqdm

from lightpath import html, v1, words
from lightpath.live_picture import LivePicture

if TYPE_CHECKING:
    from collections.abc import Callable

    from lightpath.errors import Unreachable

Progress: TypeAlias = "bool | Callable[[v1.Job], None]"
"""Whether to show progress, or a function that receives every state of the job."""

LOST = "connection lost; the job goes on; reconnecting"

_CHART_WIDTH, _CHART_HEIGHT = 320, 120


class Watcher(Protocol):
    """Follows a job."""

    def update(self, job: v1.Job) -> None:
        """Show a state of the job."""

    def lost(self, error: Unreachable) -> None:
        """Show that the connection was lost, until the next state."""

    def close(self) -> None:
        """End, after the last state or an error."""


def watcher(
    progress: Progress, label: str, picture: bytes | None = None, live: Callable[[], bytes] | None = None
) -> Watcher:
    """Return what shows the progress of a job here.

    A notebook shows `picture`, a PNG, beside it, and what `live` returns: a PNG of what the job has reached.
    """
    if callable(progress):
        return _Caller(progress)
    if shows_pictures(progress):
        return _Card(label, picture, live)
    return _Bar(label, disable=None if progress else True)


def shows_pictures(progress: Progress) -> bool:
    """Return whether a picture beside the progress would be shown."""
    return progress is True and _in_notebook()


def details(job: v1.Job) -> str:
    """Return loss and time left of a job, such as `loss 0.0123, 4 s left`, or what it waits for."""
    if job.state == v1.Job.STATE_QUEUED:
        return waits(job)
    parts = []
    if job.progress.HasField("loss"):
        parts.append(f"loss {job.progress.loss:.3g}")
    if job.progress.HasField("eta_s"):
        parts.append(f"{_duration(job.progress.eta_s)} left")
    return ", ".join(parts)


def waits(job: v1.Job) -> str:
    """Return what a queued job waits for and when it starts, such as `behind learn kernel bench-1, about 3 min`."""
    if not job.waits_for or not job.waiting.HasField("expected_start_time"):
        return job.waits_for
    return f"{job.waits_for}, about {_duration(max(job.waiting.expected_start_time.seconds - time.time(), 0))}"


def _duration(seconds: float) -> str:
    if seconds < 100:  # noqa: PLR2004
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 100 * 60 else f"{seconds / 3600:.1f} h"


def _in_notebook() -> bool:
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    # A terminal's IPython has no kernel.
    return getattr(shell, "kernel", None) is not None


class _Caller:
    def __init__(self, progress: Callable[[v1.Job], None]) -> None:
        self._progress = progress

    def update(self, job: v1.Job) -> None:
        self._progress(job)

    def lost(self, error: Unreachable) -> None:
        pass

    def close(self) -> None:
        pass


class _Bar:
    """A bar of tqdm on stderr. With `disable=None` tqdm shows nothing where stderr is no terminal."""

    def __init__(self, label: str, *, disable: bool | None) -> None:
        self._label = label
        layout = "{desc} {bar:24} {n_fmt:>4}/{total_fmt}{postfix}"
        self._bar: tqdm[Any] = tqdm(
            total=1, desc=label, bar_format=layout, disable=disable, dynamic_ncols=True, mininterval=0
        )

    def update(self, job: v1.Job) -> None:
        state = words.name_of(v1.Job.State, job.state)
        stage = job.progress.stage if state == "running" and job.progress.stage else state
        if job.progress.steps_total:
            self._bar.total, self._bar.n = job.progress.steps_total, job.progress.step
        if state == "succeeded":
            self._bar.n = job.progress.steps_total or 1
        self._bar.set_description_str(f"{self._label}: {stage}", refresh=False)
        self._bar.postfix = details(job) if state in {"queued", "running"} else ""
        self._bar.refresh()

    def lost(self, error: Unreachable) -> None:  # noqa: ARG002 - the cause would not fit into the line
        self._bar.postfix = LOST
        self._bar.refresh()

    def close(self) -> None:
        self._bar.close()


class _Card:
    """A card in a notebook: the target, what the job has reached, a bar, the loss as a curve and the time left.

    It needs no widgets.
    """

    def __init__(self, label: str, picture: bytes | None, live: Callable[[], bytes] | None) -> None:
        # Only notebooks have it, and its functions have no types.
        self._ipython: Any = importlib.import_module("IPython.display")
        self._label, self._note = label, ""
        self._job = v1.Job()
        self._losses: list[tuple[int, float]] = []
        self._picture = ""
        self._live = LivePicture(live) if live else None
        if picture:
            # Pillow cannot read every picture that the server reads. Then the card is without it.
            with contextlib.suppress(OSError, TypeError, ValueError):
                self._picture = html.picture("target", picture)
        self._handle = self._ipython.display(self._ipython.HTML(self.page()), display_id=True)

    def update(self, job: v1.Job) -> None:
        self._job, self._note = job, ""
        if job.progress.HasField("loss"):
            if self._losses and job.progress.step < self._losses[-1][0]:
                self._losses.clear()
            self._losses.append((job.progress.step, job.progress.loss))
        self._show()

    def lost(self, error: Unreachable) -> None:
        self._note = f"{LOST} ({error.cause})"
        self._show()

    def close(self) -> None:
        if self._live:
            self._live.close()
        self._show()

    def _show(self) -> None:
        self._handle.update(self._ipython.HTML(self.page()))

    def page(self) -> str:
        pictures = self._picture
        if self._live and self._live.latest:
            pictures += html.picture("so far", self._live.latest)
        return card(self._label, self._job, self._losses, pictures, self._note)


def card(label: str, job: v1.Job, losses: list[tuple[int, float]], picture: str, note: str) -> str:
    """Return the HTML of a job's progress. `losses` are steps with their losses, `picture` is figures or empty."""
    state = words.name_of(v1.Job.State, job.state) if job.state else "submitted"
    total = job.progress.steps_total
    done = 1.0 if state == "succeeded" else job.progress.step / total if total else 0.0
    stage = job.progress.stage if state == "running" else state
    text = ", ".join(
        part for part in (stage, f"{job.progress.step}/{total}" if total else "", details(job), note) if part
    )
    return (
        f"<div>{picture}<div style='display:inline-block;vertical-align:top;margin:4px'><b>{escape(label)}</b><br>"
        f"<progress value='{done:.4f}' max='1' style='width:{_CHART_WIDTH}px'></progress><br>"
        f"{escape(text)}<br>{loss_curve(losses)}</div></div>"
    )


def loss_curve(losses: list[tuple[int, float]]) -> str:
    """Return a curve of the loss over the steps as SVG, with a logarithmic axis; empty for fewer than two points."""
    if len(losses) < 2:  # noqa: PLR2004
        return ""
    logs = [math.log10(loss) for _, loss in losses]
    first, last = losses[0][0], losses[-1][0]
    low, high = min(logs), max(logs)
    points = " ".join(
        f"{_CHART_WIDTH * (step - first) / max(last - first, 1):.1f},"
        f"{4 + (_CHART_HEIGHT - 8) * (high - log) / max(high - low, 1e-9):.1f}"
        for (step, _), log in zip(losses, logs, strict=True)
    )
    label = "font-size='11' fill='currentColor'"
    return (
        f"<svg width='{_CHART_WIDTH}' height='{_CHART_HEIGHT}' role='img' aria-label='loss over steps'>"
        f"<polyline points='{points}' fill='none' stroke='#1f77b4' stroke-width='1.5'/>"
        f"<text x='4' y='{_CHART_HEIGHT - 4}' {label}>{10**low:.2g}</text>"
        f"<text x='{_CHART_WIDTH - 4}' y='12' {label} text-anchor='end'>"
        f"loss, from {10**high:.2g}</text></svg>"
    )
