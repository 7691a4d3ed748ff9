"""Photographs of simulated displays, and the scores of photographs."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lightpath import html, png, v1

if TYPE_CHECKING:
    import os

    import numpy.typing as npt


@dataclass(frozen=True, eq=False, repr=False)
class Photograph:
    """A photograph that a simulated display's camera took."""

    file: bytes = field(repr=False)
    """The 8-bit grey PNG."""
    digest: str
    """Digest of the file, under which a server has it, `sha256-…`."""

    @classmethod
    def of_pixels(cls, pixels: npt.NDArray[np.uint8]) -> Photograph:
        """Return the photograph of pixels, [y][x] in linear light."""
        content = png.encode(pixels)
        return cls(content, f"sha256-{hashlib.sha256(content).hexdigest()}")

    def __repr__(self) -> str:
        height_px, width_px = self.pixels.shape
        return f"<Photograph, {width_px}x{height_px} px>"

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:  # noqa: FBT001
        """Return the pixels, so that NumPy takes a photograph as an array."""
        return np.array(self.pixels, dtype, copy=copy is not False)

    @property
    def pixels(self) -> npt.NDArray[np.uint8]:
        """Linear light, [y][x], full scale 255."""
        return png.decode(self.file)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the PNG."""
        Path(path).write_bytes(self.file)

    def _repr_png_(self) -> bytes:
        return png.thumbnail(self.file, html.PICTURE_SIDE_PX)


@dataclass(frozen=True, eq=False)
class PhotoScore:
    """How well a photograph shows a target."""

    message: v1.PhotoScore = field(repr=False)
    aligned_png: bytes = field(repr=False)
    """The photograph as the target's pixels see it, after the best gain."""
    error_png: bytes = field(repr=False)
    """The error in colours with a scale."""

    def __repr__(self) -> str:
        return f"<PhotoScore: PSNR {self.psnr_db:.1f} dB, SSIM {self.ssim:.3f}>"

    @property
    def psnr_db(self) -> float:
        """Peak signal-to-noise ratio after the best gain [dB], the mean of the channels."""
        return sum(channel.psnr_db for channel in self.message.channels) / len(self.message.channels)

    @property
    def ssim(self) -> float:
        """Structural similarity after the best gain, the mean of the channels."""
        return sum(channel.ssim for channel in self.message.channels) / len(self.message.channels)

    @property
    def aligned(self) -> npt.NDArray[np.uint8]:
        """The photograph as the target's pixels see it, [y][x] or [y][x][3], in the target's encoding."""
        return png.decode(self.aligned_png)

    def _repr_png_(self) -> bytes:
        return png.thumbnail(self.error_png, html.PICTURE_SIDE_PX)

    def _repr_html_(self) -> str:
        pictures = html.picture("aligned photograph", self.aligned_png) + html.picture("error", self.error_png)
        names = ["grey"] if len(self.message.channels) == 1 else ["red", "green", "blue"]
        rows = [
            (
                name,
                f"{channel.psnr_db:.1f}",
                f"{channel.psnr_with_offset_db:.1f}",
                f"{channel.ssim:.3f}",
                f"{channel.resolution_cycles_per_px:.3f}",
            )
            for name, channel in zip(names, self.message.channels, strict=False)
        ]
        heads = ["channel", "PSNR [dB]", "PSNR with offset [dB]", "SSIM", "resolution [cycles/px]"]
        return pictures + html.grid("Score of a photograph", heads, rows)
