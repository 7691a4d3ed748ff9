"""How a rollout gets on, while a program waits for its end: a bar where stderr is a terminal, otherwise nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tqdm import tqdm

if TYPE_CHECKING:
    from lightpath import v1


class RolloutBar:
    """A bar of the devices that have reported, out of those that get the version."""

    def __init__(self, *, shown: bool) -> None:
        layout = "{desc} {bar:24} {n_fmt:>4}/{total_fmt} devices{postfix}"
        # With `disable=None` tqdm shows nothing where stderr is no terminal.
        self._bar: tqdm[Any] = tqdm(
            total=1, bar_format=layout, disable=None if shown else True, dynamic_ncols=True, mininterval=0
        )

    def show(self, rollout: v1.Rollout) -> None:
        """Show a state of the rollout."""
        reported = rollout.devices_passed + rollout.devices_failed
        self._bar.total, self._bar.n = max(rollout.halting.devices_known, reported, 1), reported
        self._bar.set_description_str(f"rollout of version {rollout.version}", refresh=False)
        self._bar.postfix = f"{100 * rollout.share:g} %, {rollout.devices_failed} failed"
        self._bar.refresh()

    def close(self) -> None:
        """End, after the last state or an error."""
        self._bar.close()
