"""Lengths as numbers in metres, or as text with a unit: `150mm`, `8um`, `515nm`."""

from __future__ import annotations

import math
import re
from numbers import Integral, Real
from typing import TYPE_CHECKING, TypeAlias, cast

import numpy as np

from lightpath import v1
from lightpath.errors import InvalidArgument

if TYPE_CHECKING:
    from collections.abc import Sequence

Length: TypeAlias = float | str
"""A length: metres, or text with a unit such as `"150mm"`."""

_POWERS = {"m": 0, "cm": -2, "mm": -3, "um": -6, "µm": -6, "μm": -6, "nm": -9, "pm": -12}
_NUMBER = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[eE]([+-]?\d+))?\s*(.*)", re.DOTALL)

# From this size on a number in metres probably lacks its unit: a distance of 150 is not 150 m.
_PLAIN_MAX_M = {
    "distance": (10.0, "mm"),
    "pixel_pitch": (1e-2, "um"),
    "wavelength": (1e-4, "nm"),
    "focal_length": (1e3, "mm"),
}

# A smaller wavelength without a unit, such as 0.515, was meant in micrometres.
_MICROMETRES_MAX = 10.0


def metres(field: str, length: Length) -> float:
    """Return a length in metres.

    `field` is `distance`, `pixel_pitch`, `wavelength` or `focal_length`. Text gives the float nearest to the decimal
    number. Raises `InvalidArgument` for what is no length, or a number so large that its unit was probably forgotten.
    """
    plain_max_m, unit = _PLAIN_MAX_M[field]
    if isinstance(length, bool) or not isinstance(length, str | Real):
        fix = f"give one number in metres, or text with a unit, such as {_example(unit)}"
        raise InvalidArgument(field, f"is a {type(length).__name__}", fix)
    value = _parsed(field, length.strip(), unit) if isinstance(length, str) else float(length)
    if not math.isfinite(value):
        raise InvalidArgument(field, f"is {length}", f"give a finite number with a unit, such as {_example(unit)}")
    is_plain = not isinstance(length, str) or length.strip()[-1:].isdigit()
    if is_plain and abs(value) > plain_max_m:
        if field == "wavelength" and abs(value) < _MICROMETRES_MAX:
            unit = "um"
        raise InvalidArgument(
            field, f"is {length} without a unit, which is {value:.12g} m", f'write "{value:.12g}{unit}"'
        )
    return value


def place(distance: Length) -> v1.Place:
    """Return the message of the place at a distance from the SLM."""
    return v1.Place(distance_m=metres("distance", distance))


def several(lengths: Length | Sequence[Length]) -> Sequence[Length]:
    """Return lengths as a sequence. A single one is one of them; an array has many."""
    if isinstance(lengths, np.ndarray):
        return [float(each) for each in lengths.ravel()]
    return lengths if isinstance(lengths, list | tuple) else [cast("Length", lengths)]


def _parsed(field: str, text: str, unit: str) -> float:
    found = _NUMBER.fullmatch(text)
    if found is None:
        raise InvalidArgument(field, f'is "{text}"', f"give a number with a unit, such as {_example(unit)}")
    number, exponent, given = found.groups()
    power = _POWERS.get(given or "m")
    if power is None:
        raise InvalidArgument(field, f'has the unknown unit "{given}"', "use m, cm, mm, um (or µm), nm or pm")
    value = float(f"{number}e{int(exponent or 0) + power}")
    if exponent and power < 0:
        problem = f'is "{text}", a power of ten and a unit, which make {value:.12g} m'
        raise InvalidArgument(field, problem, f"write it without the power, such as {_example(unit)}")
    return value


def _example(unit: str) -> str:
    return {"mm": '"150mm"', "um": '"8um"', "nm": '"515nm"'}[unit]


def show_length(length_m: float) -> str:
    """Return a length for people, such as `150 mm`, `8 µm` or `515 nm`, to a millionth of its unit."""
    size = abs(length_m)
    if size == 0 or size >= 1:
        scale, unit = 1.0, "m"
    elif size >= 1e-3:  # noqa: PLR2004
        scale, unit = 1e3, "mm"
    elif size >= 1e-6:  # noqa: PLR2004
        scale, unit = 1e6, "µm"
    else:
        scale, unit = 1e9, "nm"
    return f"{f'{length_m * scale:.6f}'.rstrip('0').rstrip('.')} {unit}"


def resolution_px(resolution: str | tuple[int, int]) -> tuple[int, int]:
    """Return columns and rows of a resolution such as `"1920x1080"` or `(1920, 1080)`."""
    if not isinstance(resolution, str):
        numbers = tuple(resolution) if isinstance(resolution, tuple | list) else ()
        if len(numbers) != 2 or not all(isinstance(each, Integral) for each in numbers):  # noqa: PLR2004
            raise InvalidArgument("resolution", f"is {resolution!r}", 'give "1920x1080", or (1920, 1080)')
        return int(numbers[0]), int(numbers[1])
    found = re.fullmatch(r"\s*(\d+)\s*[x×]\s*(\d+)\s*", resolution)
    if found is None:
        raise InvalidArgument("resolution", f'is "{resolution}"', 'give columns x rows in pixels, such as "1920x1080"')
    return int(found[1]), int(found[2])
