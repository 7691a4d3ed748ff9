"""Arrays that users give, as the planes that the engine takes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from lightpath.errors import InvalidArgument
from lightpath.pictures import Tensor

if TYPE_CHECKING:
    from typing import TypeGuard

Array: TypeAlias = npt.NDArray[Any] | Tensor
"""An array of NumPy or a tensor of PyTorch."""

_TURN_RAD = 2 * np.pi
_LEVELS = 256
_AXES, _SET_AXES = 2, 3


def is_array(values: object) -> TypeGuard[Array]:
    """Whether a picture is an array or a tensor, not a file or an image."""
    return isinstance(values, np.ndarray) or hasattr(values, "detach")


def as_array(name: str, values: Array) -> npt.NDArray[Any]:
    """Return the values of an array or a tensor. A tensor leaves its graph of gradients."""
    if isinstance(values, np.ndarray):
        return values
    if hasattr(values, "detach"):
        return np.asarray(values.detach().cpu().resolve_conj())
    raise InvalidArgument(name, f"is a {type(values).__name__}", "give an array of NumPy or a tensor of PyTorch")


def complex_field(name: str, values: Array, dtype: type[np.complex64 | np.complex128]) -> npt.NDArray[Any]:
    """Return a complex field [..][y][x] of a type."""
    field = as_array(name, values)
    if field.dtype.kind != "c":
        fix = "give complex amplitudes, such as numpy.exp(1j * phase), or amplitude.astype(numpy.complex64)"
        raise InvalidArgument(name, f"has values of type {field.dtype}", fix)
    if field.ndim < _AXES or field.size == 0:
        raise InvalidArgument(name, f"has the shape {field.shape}", "give [rows][columns], with any axes before them")
    return _checked(name, field, dtype)


def phase_rad(name: str, values: Array, *, axes: int = _AXES) -> npt.NDArray[np.float32]:
    """Return phases [rad] [y][x]. uint8 are grey levels, of which 256 are a turn."""
    phase = as_array(name, values)
    if phase.dtype == np.uint8:
        phase = phase.astype(np.float32) * np.float32(_TURN_RAD / _LEVELS)
    elif phase.dtype.kind != "f":
        fix = "give radians as floats, or grey levels of 8 bits as uint8"
        raise InvalidArgument(name, f"has values of type {phase.dtype}", fix)
    _check_axes(name, phase, axes)
    return _checked(name, phase, np.float32)


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
