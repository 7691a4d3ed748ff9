"""PNG files from arrays and for notebooks.

Pillow reads PNGs, but writes none with 16-bit colours, which targets in linear light need.

Source: W3C Portable Network Graphics (third edition).
"""

from __future__ import annotations

import io
import struct
import zlib
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_GREY, _COLOUR = 0, 2
_COLOUR_AXES = 3

OUTSIDE_BRIGHTNESS = 0.35
"""Factor by which the light around the region of interest is darkened in figures."""
FRAME_COLOUR = "#e8a33d"
"""Colour of the frame around the region of interest."""


def encode(pixels: npt.NDArray[np.uint8] | npt.NDArray[np.uint16]) -> bytes:
    """Return the PNG of uint8 or uint16 pixels, [y][x] or [y][x][3]."""
    height_px, width_px = pixels.shape[:2]
    colour = _COLOUR if pixels.ndim == _COLOUR_AXES else _GREY
    rows = np.ascontiguousarray(pixels.astype(pixels.dtype.newbyteorder(">"))).view(np.uint8).reshape(height_px, -1)
    # Each row begins with the number of its filter; 0 is none.
    filtered = np.pad(rows, ((0, 0), (1, 0)))
    header = struct.pack(">IIBBBBB", width_px, height_px, 8 * pixels.dtype.itemsize, colour, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(filtered.tobytes(), 6)), (b"IEND", b"")]
    return _SIGNATURE + b"".join(_chunk(kind, content) for kind, content in chunks)


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def decode(png: bytes) -> npt.NDArray[Any]:
    """Return the pixels of a picture: uint8 or uint16, [y][x] or [y][x][3]."""
    with Image.open(io.BytesIO(png)) as image:
        pixels = np.asarray(image)
    # Pillow reads 16-bit grey values as 32-bit numbers in some versions.
    return pixels.astype(np.uint16) if pixels.dtype == np.int32 else pixels


def thumbnail(png: bytes, side_px: int) -> bytes:
    """Return a small 8-bit copy of a picture, whose longer side has at most `side_px` pixels."""
    return _encoded(_small(png, side_px))


def darkened(png: bytes, side_px: int, region: tuple[int, int, int, int]) -> bytes:
    """Return a small copy of a picture that is darkened around a region x, y, width, height [px], with a frame."""
    height_px, width_px = decode(png).shape[:2]
    image = _small(png, side_px)
    along_x, along_y = image.width / width_px, image.height / height_px
    x_px, y_px, region_width_px, region_height_px = region
    left, right = round(x_px * along_x), round((x_px + region_width_px) * along_x)
    top, bottom = round(y_px * along_y), round((y_px + region_height_px) * along_y)
    shown = Image.eval(image, lambda value: int(value * OUTSIDE_BRIGHTNESS))
    shown.paste(image.crop((left, top, right, bottom)), (left, top))
    if region != (0, 0, width_px, height_px):
        ImageDraw.Draw(shown).rectangle((left - 1, top - 1, right, bottom), outline=FRAME_COLOUR)
    return _encoded(shown)


def _small(png: bytes, side_px: int) -> Image.Image:
    pixels = decode(png)
    if pixels.dtype == np.uint16:
        pixels = (pixels >> 8).astype(np.uint8)
    image = Image.fromarray(pixels).convert("RGB")
    image.thumbnail((side_px, side_px))
    return image


def _encoded(image: Image.Image) -> bytes:
    out = io.BytesIO()
    image.save(out, format="PNG")
    return out.getvalue()
