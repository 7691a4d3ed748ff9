"""Asynchronous rollouts: a version goes to some devices first, and to all when those have shown that it works."""

from __future__ import annotations

import uuid
from dataclasses import dataclass
from typing import TYPE_CHECKING

from lightpath import html, v1, words
from lightpath.aio.connection import PREPARING_TIMEOUT_S
from lightpath.aio.operations import follow_events
from lightpath.aio.resource import Resource
from lightpath.presence import if_set
from lightpath.rollout_progress import RolloutBar
from lightpath.times import utc

if TYPE_CHECKING:
    import datetime as dt
    from collections.abc import AsyncIterator, Callable

    from lightpath.aio.connection import Connection


@dataclass(frozen=True)
class RolloutEvent:
    """A change of a rollout."""

    time: dt.datetime
    caller: str
    """Name of the token; empty: no token was required, or failures of devices caused the change."""
    message: str
    """What happened and why."""
    generation: int
    """Generation of the display afterwards."""


class Rollout(Resource):
    """A staged rollout of a version. `Kernel.start_rollout` starts one."""

    message: v1.Rollout

    def __repr__(self) -> str:
        devices = f"{self.devices_passed} devices passed, {self.devices_failed} failed"
        return f"<Rollout {self.name} of version {self.version}, {self.state}, {100 * self.share:g} %: {devices}>"

    @property
    def version(self) -> int:
        """Number of the version that the rollout brings."""
        return self.message.version

    @property
    def from_version(self) -> int | None:
        """Number of the version that the other devices have; None: they have none."""
        version: int | None = if_set(self.message, "from_version")
        return version

    @property
    def state(self) -> str:
        """`running`, `completed` or `halted`, when this object was read last."""
        return words.name_of(v1.Rollout.State, self.message.state)

    @property
    def ended(self) -> bool:
        """Whether it was completed or halted."""
        return self.message.state != v1.Rollout.STATE_RUNNING

    @property
    def share(self) -> float:
        """Share of the devices that get the version, 0 to 1."""
        return self.message.share

    @property
    def group(self) -> str:
        """Devices of this group get the version besides the share; empty: no group."""
        return self.message.group

    @property
    def devices_passed(self) -> int:
        """Number of devices that reported the version in use."""
        return self.message.devices_passed

    @property
    def devices_failed(self) -> int:
        """Number of devices that failed with the version."""
        return self.message.devices_failed

    @property
    def events(self) -> list[RolloutEvent]:
        """What happened, the oldest first. Empty for a rollout of a list, before `refresh`."""
        return [
            RolloutEvent(utc(each.time), each.caller, each.message, each.generation) for each in self.message.events
        ]

    async def refresh(self) -> Rollout:
        """Read the rollout again."""
        self.message = await _read(self._connection, self.name)
        return self

    async def widen(self, share: float) -> Rollout:
        """Give the version to a larger share of the devices, 0 to 1.

        Raises `Aborted` if the rollout has changed since this object was read.
        """
        request = v1.WidenRolloutRequest(name=self.name, share=share, expected_revision=self.message.revision)
        await self._connection.call(
            self._connection.rollouts.WidenRollout, request, repeatable=False, timeout_s=PREPARING_TIMEOUT_S
        )
        return await self.refresh()

    async def complete(self) -> Rollout:
        """End the rollout by making its version active.

        Raises `Aborted` if the rollout has changed since this object was read.
        """
        request = v1.CompleteRolloutRequest(name=self.name, expected_revision=self.message.revision)
        await self._connection.call(
            self._connection.rollouts.CompleteRollout, request, repeatable=False, timeout_s=PREPARING_TIMEOUT_S
        )
        return await self.refresh()

    async def halt(self, reason: str = "") -> Rollout:
        """End the rollout: all devices go back to the active version."""
        request = v1.HaltRolloutRequest(name=self.name, reason=reason)
        call = self._connection.rollouts.HaltRollout
        await self._connection.call(call, request, repeatable=False)
        return await self.refresh()

    async def watch(self) -> AsyncIterator[Rollout]:
        """Return the rollout, and again after every change, until it has ended. Survives restarts of the server."""
        display, kernel = self.name.partition("/kernels/")[0], self.name.partition("/rollouts/")[0]
        is_new = True
        async for event in follow_events(self._connection, ""):
            is_device = event.kind == "device" and event.name.startswith(f"{display}/")
            if event.kind != "reset" and event.name != kernel and not is_device:
                continue
            before = self.message
            await self.refresh()
            if is_new or self.message != before:
                yield self
            is_new = False
            if self.ended:
                return

    async def wait(self, *, progress: bool | Callable[[Rollout], None] = True) -> Rollout:
        """Wait until somebody has completed the rollout, or it was halted, and show how many devices have reported.

        `progress` is whether to show that, or a function that receives every state. The rollout goes on if the program
        ends.

        ```python
        rollout = kernel.start_rollout(version=2, share=0.1)
        if rollout.wait().state == "halted":
            print(rollout.events[-1].message)
        ```
        """
        bar = RolloutBar(shown=progress is True)
        try:
            async for state in self.watch():
                bar.show(state.message)
                if callable(progress):
                    progress(state)
        finally:
            bar.close()
        return self

    def _repr_html_(self) -> str:
        share = f"{100 * self.share:g} %" + (f" and the group {self.group}" if self.group else "")
        rows: list[tuple[str, object]] = [
            ("version", f"{self.version}, from {self.from_version or 'none'}"),
            ("state", self.state),
            ("devices with it", share),
            ("devices", f"{self.devices_passed} passed, {self.devices_failed} failed"),
        ]
        rows += [(f"{each.time:%Y-%m-%d %H:%M:%S} UTC", each.message) for each in self.events]
        return html.table(self.name, rows)


class KernelRollouts(Resource):
    """What a kernel knows about its rollouts."""

    async def start_rollout(
        self,
        version: int,
        *,
        share: float,
        group: str = "",
        failed_share_max: float | None = None,
        devices_min: int | None = None,
        self_test_loss_max: float | None = None,
        reason: str = "",
        force: bool = False,
    ) -> Rollout:
        """Give a version to some devices first. It halts by itself if too many of them fail.

        - `share`: share of the devices that get the version at first, 0 to 1
        - `group`: devices of this group get it as well
        - `failed_share_max`: limit on the share of failed devices among those that reported, 0 to 1. Default: 0.1
        - `devices_min`: the share is computed as if at least this many had reported. Default: 10
        - `self_test_loss_max`: limit on the loss that a device's self-test may report. Default: no limit

        Raises `PreconditionFailed` if the version does not pass the display's promotion gate (`force` with a `reason`
        overrides that), or if another rollout of the kernel is running.

        ```python
        rollout = kernel.start_rollout(2, share=0.1, group="early")
        rollout.wait()  # or later: rollout.widen(50), rollout.complete(), rollout.halt("images are dark")
        ```
        """
        request = v1.StartRolloutRequest(
            kernel=self.name,
            version=version,
            share=share,
            group=group,
            failed_share_max=failed_share_max,
            devices_min=devices_min,
            self_test_loss_max=self_test_loss_max,
            reason=reason,
            force=force,
            # A call whose answer was lost is made again, and starts no second rollout.
            request_id=str(uuid.uuid4()),
        )
        call = self._connection.rollouts.StartRollout
        started = await self._connection.call(call, request, timeout_s=PREPARING_TIMEOUT_S)
        # Only reading it gives its events.
        return await Rollout(self._connection, started).refresh()

    async def rollout(self, number: int) -> Rollout:
        """Return a rollout of the kernel, by the number in its name."""
        return Rollout(self._connection, await _read(self._connection, f"{self.name}/rollouts/{number}"))

    async def rollouts(self) -> list[Rollout]:
        """Return the rollouts of the kernel, the newest first. They lack their events before `refresh`."""
        request, rollouts = v1.ListRolloutsRequest(kernel=self.name, page_size=1000), []
        async for page in self._connection.pages(self._connection.rollouts.ListRollouts, request):
            rollouts += [Rollout(self._connection, each) for each in page.rollouts]
        return rollouts


async def _read(connection: Connection, name: str) -> v1.Rollout:
    return await connection.call(connection.rollouts.GetRollout, v1.GetRolloutRequest(name=name))
