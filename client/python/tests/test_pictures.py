"""Images of Pillow give what their files and arrays give. No server is needed."""

from __future__ import annotations

import io

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from lightpath.errors import InvalidArgument
from lightpath.pictures import phase_bytes, picture_bytes


def scene() -> npt.NDArray[np.uint8]:
    """A picture without any symmetry."""
    y, x = np.mgrid[0:20, 0:32]
    values: npt.NDArray[np.uint8] = (8 * x - 3 * y + 60).clip(0, 255).astype(np.uint8)
    return values


def pixels(file: bytes) -> npt.NDArray[np.int64]:
    return np.asarray(Image.open(io.BytesIO(file))).astype(np.int64)


def with_orientation(turned: npt.NDArray[np.uint8], orientation: int, kind: str) -> Image.Image:
    """An image as a camera that was held turned writes it."""
    exif = Image.Exif()
    exif[0x0112] = orientation
    out = io.BytesIO()
    Image.fromarray(turned).save(out, format=kind, exif=exif, quality=95)
    return Image.open(out)


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "TIFF"])
@pytest.mark.parametrize(("orientation", "turns"), [(3, 2), (6, 1), (8, 3)])
def test_images_are_turned_as_the_camera_recorded(kind: str, orientation: int, turns: int) -> None:
    image = with_orientation(np.rot90(scene(), turns), orientation, kind)
    found = pixels(picture_bytes("target", image))
    assert found.shape == scene().shape
    assert np.abs(found - scene()).max() < 12


def test_images_of_floats_are_read_as_arrays_are() -> None:
    floats = (scene() / 255).astype(np.float32)
    assert picture_bytes("target", Image.fromarray(floats)) == picture_bytes("target", floats)
    with pytest.raises(InvalidArgument, match="divide by 255"):
        picture_bytes("target", Image.fromarray(255 * floats))
    phase = 2 * np.pi * floats
    assert phase_bytes("hologram", Image.fromarray(phase)) == phase_bytes("hologram", phase)


@pytest.mark.parametrize("mode", ["I", "I;16", "I;16B"])
def test_images_of_integers_keep_their_values(mode: str) -> None:
    values = 200 * scene().astype(np.uint16)
    image = Image.fromarray(values).convert("I")
    image = image if mode == "I" else image.convert(mode)
    assert np.array_equal(pixels(picture_bytes("target", image)), values)
    assert np.array_equal(pixels(phase_bytes("hologram", image)), values)


def test_images_that_can_be_read_in_two_ways_are_refused() -> None:
    with pytest.raises(InvalidArgument, match="of 8 or of 16 bits"):
        picture_bytes("target", Image.fromarray(scene().astype(np.int32)))
    with pytest.raises(InvalidArgument, match="from 0 to 100000"):
        picture_bytes("target", Image.fromarray(np.array([[0, 100_000]], np.int32)))
    with pytest.raises(InvalidArgument, match="mode LAB"):
        picture_bytes("target", Image.new("LAB", (20, 20)))


def test_images_of_colours_are_read() -> None:
    for mode in ["CMYK", "YCbCr", "HSV", "RGBX"]:
        found = pixels(picture_bytes("target", Image.fromarray(np.stack([scene()] * 3, 2)).convert(mode)))
        assert np.abs(found - scene()[:, :, np.newaxis]).max() <= 3, mode
