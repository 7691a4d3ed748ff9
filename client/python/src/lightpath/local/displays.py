"""The displays of an optimization: one for each wavelength and distance."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from lightpath.errors import InvalidArgument
from lightpath.local.arrays import as_array, is_array
from lightpath.local.display import DisplayModel
from lightpath.units import metres, several, show_length

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lightpath.pictures import Picture

_AXES = 2
_OPTICS = ("wavelength", "pixel_pitch", "distance", "resolution", "propagation")


def displays_of(target: Picture, options: dict[str, Any]) -> list[list[DisplayModel]]:
    """Return the displays [wavelength][plane]: ideal ones, or those of the option `kernel`."""
    kernel = options.get("kernel")
    if kernel is not None:
        own = [name for name in _OPTICS if name in options]
        if own:
            raise InvalidArgument("kernel", "has optics of its own", f"leave out {', '.join(own)}")
        return _grid(kernel if isinstance(kernel, list | tuple) else [kernel])
    if not {"wavelength", "pixel_pitch", "distance"} <= options.keys():
        raise InvalidArgument("wavelength, pixel_pitch and distance", "are not all given", "give them, or a kernel")
    resolution = options.get("resolution")
    if resolution is None:
        if not is_array(target):
            raise InvalidArgument("resolution", "is not given", 'give that of the display, such as "1920x1080"')
        height_px, width_px = as_array("target", target).shape[:_AXES]
        resolution = (width_px, height_px)
    distances_m = _different("distance", options["distance"])
    return [
        [
            DisplayModel.ideal(
                resolution,
                wavelength=wavelength_m,
                pixel_pitch=options["pixel_pitch"],
                distance=distance_m,
                method=options.get("propagation", "auto"),
            )
            for distance_m in distances_m
        ]
        for wavelength_m in _different("wavelength", options["wavelength"])
    ]


def _different(name: str, lengths: Any) -> list[float]:
    found = [metres(name, each) for each in several(lengths)]
    if not found:
        raise InvalidArgument(name, "is empty", "give at least one")
    for i, length_m in enumerate(found):
        if length_m in found[:i]:
            raise InvalidArgument(name, f"has {show_length(length_m)} twice", "no two may be equal")
    return found


def _grid(kernels: Sequence[Any]) -> list[list[DisplayModel]]:
    """Return kernels by wavelength and distance, in the order in which they first appear."""
    if not kernels or not all(isinstance(each, DisplayModel) for each in kernels):
        kinds = ", ".join(dict.fromkeys(type(each).__name__ for each in kernels)) or "nothing"
        fix = "give a DisplayModel of lightpath.local, such as of DisplayModel.load"
        raise InvalidArgument("kernel", f"is of {kinds}", fix)
    found = {(each.wavelength_m, each.distance_m): each for each in kernels}
    wavelengths_m = list(dict.fromkeys(each.wavelength_m for each in kernels))
    distances_m = list(dict.fromkeys(each.distance_m for each in kernels))
    if len(found) != len(kernels) or len(found) != len(wavelengths_m) * len(distances_m):
        problem = f"has {len(kernels)} models for {len(wavelengths_m)} wavelengths and {len(distances_m)} distances"
        raise InvalidArgument("kernel", problem, "give one for each wavelength at each distance")
    if len({each.shape for each in kernels}) > 1:
        raise InvalidArgument("kernel", "has models of displays of different sizes", "give those of one display")
    return [[found[wavelength_m, distance_m] for distance_m in distances_m] for wavelength_m in wavelengths_m]
