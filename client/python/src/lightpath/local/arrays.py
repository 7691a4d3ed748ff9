"""Arrays that users give, as the planes that the engine takes."""

from __future__ import annotations

import io
import os
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt
from PIL import Image

from lightpath import png
from lightpath.errors import InvalidArgument
from lightpath.hologram import Hologram
from lightpath.pictures import Phase, Tensor, file_bytes, numbers_of

if TYPE_CHECKING:
    from typing import TypeGuard

Array: TypeAlias = npt.NDArray[Any] | Tensor
"""An array of NumPy or a tensor of PyTorch."""

_TURN_RAD = 2 * np.pi
_AXES, _SET_AXES = 2, 3


def is_array(values: object) -> TypeGuard[Array]:
    """Whether a picture is an array or a tensor, not a file or an image."""
    return isinstance(values, np.ndarray) or hasattr(values, "detach")


def as_array(name: str, values: Array) -> npt.NDArray[Any]:
    """Return the values of an array or a tensor. A tensor leaves its graph of gradients."""
    return np.asarray(values) if hasattr(values, "__array__") else numbers_of(name, values)


def complex_field(name: str, values: Array, dtype: type[np.complex64 | np.complex128]) -> npt.NDArray[Any]:
    """Return a complex field [..][y][x] of a type. Real numbers are amplitudes with the phase 0."""
    field = as_array(name, values)
    if field.dtype.kind not in "cfb":
        fix = "give complex amplitudes, such as numpy.exp(1j * phase), or real ones as floats, which have the phase 0"
        raise InvalidArgument(name, f"has values of type {field.dtype}", fix)
    if field.ndim < _AXES or field.size == 0:
        raise InvalidArgument(name, f"has the shape {field.shape}", "give [rows][columns], with any axes before them")
    return _checked(name, field, dtype)


def phase_rad(name: str, values: Hologram | Phase, *, axes: int = _AXES, bits: int = 8) -> npt.NDArray[np.float32]:
    """Return phases [rad] [y][x]: of a hologram with one pattern, an array, a picture or a file.

    Integers are grey levels, of which 2^`bits` are a turn; floats are radians.
    """
    phase = _pattern(name, values)
    if phase.dtype.kind in "ui" and phase.size:
        least, most = int(phase.min()), int(phase.max())
        if least < 0 or most >= 2**bits:
            problem = f"has grey levels from {least} to {most}, but those of {bits} bits are 0 to {2**bits - 1}"
            raise InvalidArgument(name, problem, "give bit_depth, or radians as floats")
        phase = phase.astype(np.float32) * np.float32(_TURN_RAD / 2**bits)
    elif phase.dtype.kind != "f":
        fix = "give radians as floats, or grey levels as integers"
        raise InvalidArgument(name, f"has values of type {phase.dtype}", fix)
    _check_axes(name, phase, axes)
    return _checked(name, phase, np.float32)


def frames_rad(name: str, values: Hologram | Phase, *, bits: int = 8) -> npt.NDArray[np.float32]:
    """Return phases [rad] [subframe][y][x], of which a single one may be [y][x]."""
    phase = _pattern(name, values)
    return phase_rad(name, phase if phase.ndim == _SET_AXES else phase[np.newaxis], axes=_SET_AXES, bits=bits)


def _pattern(name: str, values: Hologram | Phase) -> npt.NDArray[Any]:
    """Return the levels or phases of whatever holds a hologram."""
    if isinstance(values, Hologram):
        # Levels of a server may have a carrier and a measured response, and others have more than 8 bits.
        levels = values.levels
        return levels if values.server_job is None and levels.dtype == np.uint8 else values.phase
    if isinstance(values, str | os.PathLike):
        content = file_bytes(name, values)
        if content.startswith(b"\x93NUMPY"):
            return np.asarray(np.load(io.BytesIO(content), allow_pickle=False))
        return png.decode(content)
    return np.asarray(values) if isinstance(values, Image.Image) else as_array(name, values)


def light(name: str, values: Array, *, axes: int = _AXES) -> npt.NDArray[np.float32]:
    """Return linear light [y][x], 0 to 1. uint8 and uint16 are parts of their full scale."""
    pixels = as_array(name, values)
    _check_axes(name, pixels, axes)
    if pixels.dtype in {np.dtype(np.uint8), np.dtype(np.uint16)}:
        pixels = pixels.astype(np.float32) / np.float32(np.iinfo(pixels.dtype).max)
    elif pixels.dtype == np.bool_:
        pixels = pixels.astype(np.float32)
    elif pixels.dtype.kind != "f":
        raise InvalidArgument(
            name, f"has values of type {pixels.dtype}", "use uint8, uint16, bool or floats from 0 to 1"
        )
    checked = _checked(name, pixels, np.float32)
    if checked.min() < 0 or checked.max() > 1:
        problem = f"has values from {checked.min():.6g} to {checked.max():.6g}, but light is 0 to 1"
        raise InvalidArgument(name, problem, "scale it, for example by its largest value")
    return checked


def _check_axes(name: str, values: npt.NDArray[Any], axes: int) -> None:
    if values.ndim != axes or values.size == 0:
        form = "[count][rows][columns]" if axes == _SET_AXES else "[rows][columns]"
        raise InvalidArgument(name, f"has the shape {values.shape}", f"give {form}")


def _checked(name: str, values: npt.NDArray[Any], dtype: Any) -> npt.NDArray[Any]:
    """Return finite values of a type, in the order of C."""
    with np.errstate(over="ignore"):
        checked = np.ascontiguousarray(values, dtype)
    if not np.isfinite(checked).all():
        place = "".join(f"[{i}]" for i in np.argwhere(~np.isfinite(checked))[0])
        raise InvalidArgument(
            name, f"is not a finite number at {place}", "replace it, for example with numpy.nan_to_num"
        )
    return checked
