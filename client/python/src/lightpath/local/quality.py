"""How good a hologram is, and the light of the target that it is compared with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, get_args

from lightpath import words
from lightpath.local.arrays import as_array, is_array, light
from lightpath.local.engine import engine, refusals
from lightpath.local.optics import choose
from lightpath.pictures import Picture, picture_bytes

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt


@dataclass(frozen=True)
class DetectorQuality:
    """Quality of the light that one detector sees, in the region of interest."""

    psnr_db: float
    ssim: float | None
    """None in a region with a side below 11 px."""
    ms_ssim: float | None
    """None in a region with a side below 176 px."""
    diffraction_efficiency: float
    """Part of the light that falls into the region, 0 to 1."""
    frame_efficiency: float
    """Part of the light that falls into the frame, 0 to 1."""
    speckle_contrast: float | None
    """None if too little of the target is flat."""


@dataclass(frozen=True)
class Quality:
    """Quality of a hologram for each detector."""

    point: DetectorQuality
    pixel: DetectorQuality
    supersampled: DetectorQuality


@dataclass(frozen=True)
class SecondOpinion:
    """PSNR that the engine and an independent model find on the same rows of the image."""

    rows: int
    engine_psnr_db: float
    independent_psnr_db: float


def quality_of(facts: dict[str, dict[str, Any]]) -> Quality:
    """Return the quality that the engine reports."""
    return Quality(**{name: DetectorQuality(**numbers) for name, numbers in facts.items()})


def opinion_of(facts: dict[str, Any] | None) -> SecondOpinion | None:
    """Return the second opinion that the engine reports."""
    return None if facts is None else SecondOpinion(**facts)


def target_light(
    target: Picture, shape: tuple[int, int], encoding: words.Encoding, fit: words.Fit
) -> npt.NDArray[np.float32]:
    """Return the linear light of a target.

    A picture is read as a server reads it. An array of floats in linear light, of the display's size, stays as it is.
    """
    choose("target_encoding", encoding, get_args(words.Encoding))
    choose("fit", fit, get_args(words.Fit))
    if encoding == "linear" and is_array(target):
        pixels = as_array("target", target)
        if pixels.dtype.kind == "f" and pixels.shape == shape:
            return light("target", pixels)
    with refusals():
        return engine.target(picture_bytes("target", target), encoding, fit, *shape)
