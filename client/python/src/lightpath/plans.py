"""What the planner says about the propagation of light, in this process or on a server, and estimates of jobs."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from google.protobuf.json_format import MessageToDict

from lightpath import v1, words
from lightpath.units import show_length

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True)
class Estimate:
    """What a job would need."""

    memory_bytes: int | None
    """Largest memory, above that of the idle server. None: not estimated."""
    time_s: float | None
    """Time of an attempt on a server without other jobs [s]. None: not estimated."""


@dataclass(frozen=True)
class PlanWarning:
    """A limitation of a method. `code` is a word such as `BAND_LIMITED`, `text` is for people."""

    code: str
    text: str


@dataclass(frozen=True)
class Alternative:
    """A propagation method, and whether it is possible."""

    method: str
    possible: bool
    """Whether the method gives a correct image here."""
    optimizable: bool
    """Whether holograms can be optimized with the method."""
    text: str
    """The method's warnings, or the reason why it is not possible. Empty: the method has no limitation."""


@dataclass(frozen=True)
class Plan:
    """What the planner says about a propagation method for some optics."""

    method: str
    """The method, such as `band-response`."""
    explanation: str
    """Why the method was chosen."""
    warnings: tuple[PlanWarning, ...]
    """Limitations of the method here."""
    critical_distance_x_m: float
    """Largest distance at which the padded grid samples the whole transfer function along x [m]."""
    critical_distance_y_m: float
    """The same along y [m]."""
    band_kept_area: float
    """Part of the pixels' band whose light lands in the image, 0 to 1."""
    neglected_phase_rad: float
    """Largest phase error of a paraxial method [rad]; 0 for other methods."""
    report: Mapping[str, Any] = field(repr=False)
    """All numbers of the planner, such as the pitch of the image in `window`."""
    alternatives: tuple[Alternative, ...] = field(default=(), repr=False)
    """All methods, possible or not, if a server planned."""

    def __str__(self) -> str:
        distances = (
            f"{show_length(self.critical_distance_x_m)} along x, {show_length(self.critical_distance_y_m)} along y"
        )
        lines = [
            f"{self.method}: {self.explanation}",
            f"critical distance {distances}; {self.band_kept_area:.0%} of the band reaches the image",
        ]
        return "\n".join(lines + [f"warning {each.code}: {each.text}" for each in self.warnings])


def plan_of(report: Mapping[str, Any]) -> Plan:
    """Return the plan of a report of the engine."""
    return Plan(
        method=str(report["method"]).replace("_", "-"),
        explanation=report["explanation"],
        warnings=tuple(PlanWarning(each["code"], each["text"]) for each in report["warnings"]),
        critical_distance_x_m=report["critical_distance_x_m"],
        critical_distance_y_m=report["critical_distance_y_m"],
        band_kept_area=report["band_kept_area"],
        neglected_phase_rad=report["neglected_phase_rad"],
        report=report,
    )


def plan_of_server(message: v1.PlanPropagationResponse) -> Plan:
    """Return the plan that a server made."""
    report = message.report
    return Plan(
        method=words.name_of(v1.PropagationMethod, report.method),
        explanation=report.explanation,
        warnings=tuple(PlanWarning(each.code, each.text) for each in report.warnings),
        critical_distance_x_m=report.critical_distance_x_m,
        critical_distance_y_m=report.critical_distance_y_m,
        band_kept_area=report.band_kept_area,
        neglected_phase_rad=report.neglected_phase_rad,
        report=MessageToDict(report, preserving_proto_field_name=True),
        alternatives=tuple(
            Alternative(words.name_of(v1.PropagationMethod, each.method), each.possible, each.optimizable, each.text)
            for each in message.alternatives
        ),
    )
