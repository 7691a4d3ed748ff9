"""Pictures as the planes of linear light that the engine takes: targets, depth maps and weights."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, get_args

from lightpath import words
from lightpath.local.arrays import as_array, is_array, light
from lightpath.local.engine import engine, refusals
from lightpath.local.optics import choose
from lightpath.options import Region, region_px
from lightpath.pictures import Picture, picture_bytes

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    import numpy.typing as npt

_COLOUR_AXES = 3


class Placement(NamedTuple):
    """Where a target goes on a display."""

    fit: words.Fit = "contain"
    area: words.Area | None = None
    region: Region | None = None

    @classmethod
    def of(cls, options: Mapping[str, Any]) -> Placement:
        """Return the placement that options say."""
        return cls(options.get("fit", "contain"), options.get("area"), region_px(options.get("region")))


def target_light(
    target: Picture,
    shape: tuple[int, int],
    encoding: words.Encoding,
    placement: Placement,
    *,
    colour: int | None = None,
    name: str = "target",
) -> npt.NDArray[np.float32]:
    """Return the linear light of a target. `colour` is 0 for its red, 1 for its green, 2 for its blue; None: the mean.

    A picture is read and placed as a server does it. An array of floats in linear light, of the display's size, stays
    as it is if it fills the display.
    """
    choose("target_encoding", encoding, get_args(words.Encoding))
    choose("fit", placement.fit, get_args(words.Fit))
    if placement.area is not None:
        choose("area", placement.area, get_args(words.Area))
    fills_display = placement.area == "display" or (placement.area is None and placement.fit == "exact")
    if encoding == "linear" and is_array(target) and fills_display:
        pixels = as_array(name, target)
        if pixels.dtype.kind == "f" and pixels.shape[:2] == shape:
            if pixels.ndim == _COLOUR_AXES:
                pixels = pixels.mean(axis=2) if colour is None else pixels[:, :, colour]
            return light(name, pixels)
    with refusals():
        return engine.target(picture_bytes(name, target), encoding, placement, colour, shape)


def colour_of(wavelengths_m: list[float], index: int) -> int | None:
    """Return the colour that a wavelength shows: of three the longest red, the shortest blue. None: the mean of all."""
    if len(wavelengths_m) != _COLOUR_AXES:
        return None
    return sum(other > wavelengths_m[index] for other in wavelengths_m)
