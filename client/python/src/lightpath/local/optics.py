"""The optics of a call and its options, and what the planner says about them."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypedDict, get_args

from lightpath import words
from lightpath.errors import InvalidArgument
from lightpath.units import metres, resolution_px, show_length

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from lightpath.units import Length

Method: TypeAlias = words.Propagation | Literal["auto"]
"""A propagation method, or `auto`: the planner chooses."""


class _Optics(TypedDict):
    wavelength: Length
    """In vacuum: metres, or text such as `"515nm"`."""
    pixel_pitch: Length
    """Distance between pixels, the same along both axes."""
    distance: Length
    """From the display to the image. Negative: behind the display."""


class OpticsOptions(_Optics, total=False):
    """Optics of a propagation through free space. `wavelength`, `pixel_pitch` and `distance` are required."""

    method: Method
    """Propagation method. Default: `auto`. A method that is not valid for the optics is refused, with the reason."""
    regardless: bool
    """Use the method even where it is not valid, for example to measure its error. Default: False."""


@dataclass(frozen=True)
class PlanWarning:
    """A limitation of a method. `code` is a word such as `BAND_LIMITED`, `text` is for people."""

    code: str
    text: str


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


def optics_json(resolution: str | tuple[int, int], options: OpticsOptions) -> str:
    """Return optics as the engine reads them."""
    check(options, OpticsOptions, required=True)
    method, regardless = options.get("method", "auto"), options.get("regardless", False)
    choose("method", method, ("auto", *get_args(words.Propagation)))
    if regardless and method == "auto":
        raise InvalidArgument("regardless", "is True without a method", "name it, such as method='band-limited'")
    width_px, height_px = resolution_px(resolution)
    return json.dumps(
        {
            "height_px": height_px,
            "width_px": width_px,
            "wavelength_m": metres("wavelength", options["wavelength"]),
            "pixel_pitch_m": metres("pixel_pitch", options["pixel_pitch"]),
            "distance_m": metres("distance", options["distance"]),
            "method": None if method == "auto" else method.replace("-", "_"),
            "regardless": regardless,
        }
    )


def check(options: Mapping[str, Any], known: type[Any], *, required: bool = False) -> None:
    """Raise TypeError for an option that does not exist or is missing, as Python does for keyword arguments."""
    unknown = options.keys() - known.__annotations__.keys()
    if unknown:
        raise TypeError(
            f"unknown option {', '.join(sorted(unknown))}; the options are {', '.join(sorted(known.__annotations__))}"
        )
    missing = [name for name in _Optics.__annotations__ if name not in options]
    if required and missing:
        raise TypeError(f"missing keyword argument {', '.join(missing)}")


def choose(name: str, given: str, allowed: Iterable[str]) -> str:
    """Return a word as the engine spells it. Raises `InvalidArgument` for an unknown one."""
    allowed = tuple(allowed)
    if given not in allowed:
        raise InvalidArgument(name, f'is "{given}"', f"choose one of {', '.join(allowed)}")
    return given.replace("-", "_")
