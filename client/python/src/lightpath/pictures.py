"""Pictures and phases that users hand over, as the bytes that the server reads."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageOps

from lightpath import png
from lightpath.errors import InvalidArgument

if TYPE_CHECKING:
    from typing import TypeGuard


class Tensor(Protocol):
    """A tensor of PyTorch, which need not be installed."""

    def detach(self) -> Tensor:
        """Return the tensor outside of its graph of gradients."""

    def cpu(self) -> Any:
        """Return the tensor in the memory of the processor."""


Picture: TypeAlias = str | os.PathLike[str] | Image.Image | npt.NDArray[Any] | Tensor
"""A picture: a file (PNG, JPEG, TIFF, BMP or `.npy`), a PIL image, or an array or tensor.

Arrays are [height][width] or [height][width][3]; tensors may also be [3][height][width], with leading axes of length 1.
Values are uint8, uint16, bool, or floats from 0 to 1. What they mean is said by the encoding, as for a file.
PIL images are turned as their camera recorded (EXIF), as files are. Those of floats (mode F) and of integers (mode I)
are read as arrays are: 0 to 1, and 0 to 65535.
"""

Phase: TypeAlias = str | os.PathLike[str] | Image.Image | npt.NDArray[Any] | Tensor
"""A hologram as it is displayed: a file, or grey levels (uint8 or uint16), or phases in radians (floats).

Arrays are [height][width]. Floats are the phase before the display's response and carrier.
"""

_GREY_AXES, _COLOUR_AXES = 2, 3
_COLOURS = 3
_UINT8_MAX, _UINT16_MAX = 255, 65535
# Modes that a PNG holds as they are, so that an image gives the same result as its file.
_PNG_MODES = {"1", "L", "LA", "P", "RGB", "RGBA", "I;16"}
# Modes of colours, which Pillow converts to RGB with all their values.
_COLOUR_MODES = {"CMYK", "YCbCr", "HSV", "PA", "RGBX"}


def picture_bytes(field: str, picture: Picture) -> bytes:
    """Return the file of a picture. `field` names the argument in errors."""
    if isinstance(picture, str | os.PathLike):
        return file_bytes(field, picture)
    if isinstance(picture, Image.Image):
        picture = ImageOps.exif_transpose(picture)
        if picture.mode in _PNG_MODES | _COLOUR_MODES:
            return _png(picture)
        picture = _numbers(field, picture)
    pixels = _pixels(field, picture)
    if pixels.dtype.kind == "f":
        _refuse_not_finite(field, pixels)
        least, largest = pixels.min(), pixels.max()
        if least < 0 or largest > 1:
            fix = "divide by 255" if largest > 1 and least >= 0 else "scale them"
            raise InvalidArgument(field, f"has values from {least:.6g} to {largest:.6g}, but floats are 0 to 1", fix)
        pixels = np.rint(pixels * 65535).astype(np.uint16)
    return png.encode(pixels)


def phase_bytes(field: str, phase: Phase) -> bytes:
    """Return the file of a hologram: a PNG of grey levels, or `.npy` of float32 phases [rad]."""
    if isinstance(phase, str | os.PathLike):
        return file_bytes(field, phase)
    if isinstance(phase, Image.Image):
        if phase.mode in _PNG_MODES | _COLOUR_MODES:
            return _png(phase)
        phase = _numbers(field, phase, is_of_levels=True)
    levels = _pixels(field, phase)
    if levels.ndim != _GREY_AXES:
        raise InvalidArgument(field, f"has the shape {levels.shape}", "give [height][width]")
    if levels.dtype.kind != "f":
        return png.encode(levels)
    _refuse_not_finite(field, levels)
    out = io.BytesIO()
    np.save(out, levels.astype("<f4"), allow_pickle=False)
    return out.getvalue()


def is_complex(picture: Picture) -> bool:
    """Whether a picture is an array or a tensor of complex numbers."""
    return (isinstance(picture, np.ndarray) or hasattr(picture, "detach")) and np.iscomplexobj(
        numbers_of("target", picture)
    )


def is_file(picture: object) -> TypeGuard[str | os.PathLike[str] | Image.Image]:
    """Whether a picture is a file or an image, no array."""
    return isinstance(picture, str | os.PathLike | Image.Image)


def numbers_of(field: str, values: object) -> npt.NDArray[Any]:
    """Return the values of an array or a tensor. A tensor leaves its graph of gradients."""
    if isinstance(values, np.ndarray):
        return values
    if hasattr(values, "detach"):
        return np.asarray(values.detach().cpu().resolve_conj())
    raise InvalidArgument(field, f"is a {type(values).__name__}", "give an array of NumPy or a tensor of PyTorch")


def file_bytes(field: str, path: str | os.PathLike[str]) -> bytes:
    """Return the bytes of a file. `field` names the argument in errors."""
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise InvalidArgument(field, f'is "{os.fspath(path)}", which cannot be read', str(error.strerror)) from error


def _png(image: Image.Image) -> bytes:
    out = io.BytesIO()
    if image.mode not in _PNG_MODES:
        image = image.convert("RGBA" if image.mode == "PA" else "RGB")
    image.save(out, format="PNG")
    return out.getvalue()


def _numbers(field: str, image: Image.Image, *, is_of_levels: bool = False) -> npt.NDArray[Any]:
    """Return the values of an image that no PNG holds: floats, or integers of 16 bits in one of 32 bits.

    Levels are never scaled, so that it does not matter of how many bits they are.
    """
    values = np.asarray(image)
    if image.mode == "F":
        return values
    if not image.mode.startswith("I"):
        raise InvalidArgument(field, f"is an image of mode {image.mode}", "convert it to L, RGB, I;16 or F")
    least, largest = int(values.min(initial=0)), int(values.max(initial=0))
    if least < 0 or largest > _UINT16_MAX:
        fix = "give an array of uint8, uint16 or floats"
        raise InvalidArgument(field, f"has values from {least} to {largest}, but integers are 0 to 65535", fix)
    if image.mode == "I" and largest <= _UINT8_MAX and not is_of_levels:
        fix = 'convert it to "L" for 8 bits, or to "I;16" for 16 bits'
        raise InvalidArgument(field, f"is an image of mode I with values up to {largest}, of 8 or of 16 bits", fix)
    return values.astype(np.uint16)


def _pixels(field: str, values: npt.NDArray[Any] | Tensor) -> npt.NDArray[Any]:
    """Return an array [y][x] or [y][x][3] of uint8, uint16 or floats."""
    if isinstance(values, np.ndarray):
        pixels = values
    elif hasattr(values, "detach"):
        pixels = _colours_last(numbers_of(field, values))
    else:
        raise InvalidArgument(field, f"is a {type(values).__name__}", "give a file, an image, an array or a tensor")
    is_colour = pixels.ndim == _COLOUR_AXES and pixels.shape[2] == _COLOURS
    if pixels.size == 0 or not (pixels.ndim == _GREY_AXES or is_colour):
        raise InvalidArgument(field, f"has the shape {pixels.shape}", "give [height][width] or [height][width][3]")
    if pixels.dtype == np.bool_:
        return np.where(pixels, 255, 0).astype(np.uint8)
    if pixels.dtype not in {np.dtype(np.uint8), np.dtype(np.uint16)} and pixels.dtype.kind != "f":
        raise InvalidArgument(field, f"has values of type {pixels.dtype}", "use uint8, uint16, bool or floats")
    return pixels


def _colours_last(pixels: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Remove a tensor's leading axes of length 1, and bring its colours from the first to the last axis."""
    while pixels.ndim > _GREY_AXES and pixels.shape[0] == 1:
        pixels = pixels[0]
    if pixels.ndim == _COLOUR_AXES and pixels.shape[0] == _COLOURS:
        pixels = np.moveaxis(pixels, 0, 2)
    return pixels


def _refuse_not_finite(field: str, pixels: npt.NDArray[Any]) -> None:
    bad = np.argwhere(~np.isfinite(pixels))
    if len(bad):
        place = "".join(f"[{i}]" for i in bad[0])
        problem = f"has {len(bad)} values that are not finite, the first at {place} ({pixels[tuple(bad[0])]})"
        raise InvalidArgument(field, problem, "replace them, for example with numpy.nan_to_num")
