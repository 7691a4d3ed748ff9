"""What a version of a kernel must show before it becomes active on a display."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from lightpath.presence import if_set
from lightpath.times import utc

if TYPE_CHECKING:
    import datetime as dt

    from lightpath import v1


@dataclass(frozen=True)
class PromotionGate:
    """What versions must show before they become active on a display."""

    loss_reduction_min: float | None
    """How much lower the held-out loss must be than that of the active version [%]. None: not checked."""
    worse_than_ideal_allowed: bool
    """Whether a version may be active that was measured and is no better than the ideal kernel."""
    test_pairs_min: int
    """Least number of test pairs with which the version was measured."""
    formats: tuple[str, ...]
    """Formats in which the version must be available, besides those of which devices reported the use."""
    history: tuple[GateChange, ...] = field(default=(), repr=False)
    """The gates that were set, the newest first. Empty: the gate is the default one."""


@dataclass(frozen=True)
class GateChange:
    """A gate that was set."""

    time: dt.datetime
    caller: str
    """Name of the token that set it; empty: no token was required."""
    reason: str
    gate: PromotionGate


@dataclass(frozen=True)
class GateCheck:
    """One check of a gate."""

    passed: bool
    finding: str
    """What was checked, with the numbers."""
    not_measured: bool = False
    """Whether the version passed only because nothing was measured that the gate could have refused."""


@dataclass(frozen=True)
class Verdict:
    """Whether a version passes the gate of its display."""

    passed: bool
    checks: tuple[GateCheck, ...]
    active_version: int | None
    """Number of the version with which it was compared; None: no version is active."""

    @property
    def failures(self) -> list[str]:
        """What did not pass, with the numbers."""
        return [check.finding for check in self.checks if not check.passed]


def read_gate(message: v1.DisplayGate) -> PromotionGate:
    """Return the gate that a message describes, with its history."""
    changes = [GateChange(utc(each.time), each.caller, each.reason, _gate(each.gate)) for each in message.history]
    return _gate(message.gate, tuple(changes))


def read_verdict(message: v1.PromotionVerdict) -> Verdict:
    """Return the verdict that a message describes."""
    checks = tuple(GateCheck(each.passed, each.finding, each.not_measured) for each in message.checks)
    return Verdict(message.passed, checks, if_set(message, "active_version"))


def _gate(message: v1.PromotionGate, history: tuple[GateChange, ...] = ()) -> PromotionGate:
    return PromotionGate(
        loss_reduction_min=if_set(message, "loss_reduction_min"),
        worse_than_ideal_allowed=message.worse_than_ideal_allowed,
        test_pairs_min=message.test_pairs_min,
        formats=tuple(message.formats),
        history=history,
    )
