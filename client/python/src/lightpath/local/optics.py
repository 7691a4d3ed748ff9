"""The optics of a call and its options."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Literal, TypeAlias, TypedDict, get_args

from lightpath import words
from lightpath.errors import InvalidArgument
from lightpath.options import check
from lightpath.units import metres, resolution_px

if TYPE_CHECKING:
    from collections.abc import Iterable

    from lightpath.units import Length

Method: TypeAlias = words.Propagation | Literal["auto"]
"""A propagation method, or `auto`: the planner chooses."""


class _Optics(TypedDict):
    """The optics that every propagation has."""

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


REQUIRED = tuple(_Optics.__annotations__)
"""Options that every propagation must have."""


def optics_json(resolution: str | tuple[int, int], options: OpticsOptions) -> str:
    """Return optics as the engine reads them."""
    check(options, OpticsOptions, required=REQUIRED)
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


def choose(name: str, given: str, allowed: Iterable[str]) -> str:
    """Return a word as the engine spells it. Raises `InvalidArgument` for an unknown one."""
    allowed = tuple(allowed)
    if given not in allowed:
        raise InvalidArgument(name, f'is "{given}"', f"choose one of {', '.join(allowed)}")
    return given.replace("-", "_")
