"""Pictures as the planes of linear light that the engine takes: targets, depth maps and weights."""

from __future__ import annotations

from typing import TYPE_CHECKING, get_args

from lightpath import words
from lightpath.local.arrays import as_array, is_array, light
from lightpath.local.engine import engine, refusals
from lightpath.local.optics import choose
from lightpath.pictures import Picture, picture_bytes

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

_COLOUR_AXES = 3


def target_light(
    target: Picture,
    shape: tuple[int, int],
    encoding: words.Encoding,
    fit: words.Fit,
    *,
    colour: int | None = None,
    name: str = "target",
) -> npt.NDArray[np.float32]:
    """Return the linear light of a target. `colour` is 0 for its red, 1 for its green, 2 for its blue; None: the mean.

    A picture is read as a server reads it. An array of floats in linear light, of the display's size, stays as it is.
    """
    choose("target_encoding", encoding, get_args(words.Encoding))
    choose("fit", fit, get_args(words.Fit))
    if encoding == "linear" and is_array(target):
        pixels = as_array(name, target)
        if pixels.dtype.kind == "f" and pixels.shape[:2] == shape:
            if pixels.ndim == _COLOUR_AXES:
                pixels = pixels.mean(axis=2) if colour is None else pixels[:, :, colour]
            return light(name, pixels)
    with refusals():
        return engine.target(picture_bytes(name, target), (encoding, fit), colour, shape)


def colour_of(wavelengths_m: list[float], index: int) -> int | None:
    """Return the colour that a wavelength shows: of three the longest red, the shortest blue. None: the mean of all."""
    if len(wavelengths_m) != _COLOUR_AXES:
        return None
    return sum(other > wavelengths_m[index] for other in wavelengths_m)
