"""How well a hologram shows its pictures, from a server or from the engine in this process."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from lightpath import v1
from lightpath.presence import if_set

if TYPE_CHECKING:
    from collections.abc import Iterable

# A smaller deviation would be shown as 0.0.
_STD_SHOWN_MIN_DB = 0.05


@dataclass(frozen=True)
class DetectorQuality:
    """Quality of the light that one detector sees, in the region of interest."""

    psnr_db: float
    """Peak signal-to-noise ratio [dB], at most 200."""
    ssim: float | None
    """Structural similarity. None in a region with a side below 11 px."""
    ms_ssim: float | None
    """Structural similarity over five scales. None in a region with a side below 176 px."""
    diffraction_efficiency: float
    """Part of the light that falls into the region, 0 to 1."""
    frame_efficiency: float
    """Part of the light that falls into the frame, 0 to 1."""
    speckle_contrast: float | None
    """None if too little of the target is flat."""

    def __repr__(self) -> str:
        return f"<DetectorQuality: {self}>"

    def __str__(self) -> str:
        ssim = "" if self.ssim is None else f", SSIM {self.ssim:.3f}"
        return f"{self.psnr_db:.1f} dB{ssim}, efficiency {self.diffraction_efficiency:.1%}"


@dataclass(frozen=True)
class Quality:
    """Quality of a hologram for each detector."""

    point: DetectorQuality
    """The light at the pixels' centres."""
    pixel: DetectorQuality
    """The light that each pixel of a camera integrates."""
    supersampled: DetectorQuality
    """The light at 2×2 points of each pixel."""

    def __repr__(self) -> str:
        return f"<Quality for pixels: {self.pixel}>"


@dataclass(frozen=True)
class SecondOpinion:
    """PSNR that the engine and an independent model find on the same rows of the image."""

    rows: int
    engine_psnr_db: float
    independent_psnr_db: float


@dataclass(frozen=True)
class Expected:
    """What a photograph of a picture is expected to show, by the best model of the display.

    `str(expected)` is text such as `46.4 ± 0.5 dB expected`.
    """

    psnr_db: float
    """PSNR in a photograph, or the largest that it can have: see `std_db` [dB]."""
    std_db: float | None
    """Standard deviation of the PSNR [dB]. None: the error of the model on photographs is not known, so a photograph
    will show less than `psnr_db`."""
    kernel: str
    """Version of the kernel whose model this is, or `ideal`."""

    def __str__(self) -> str:
        if self.std_db is None:
            return f"{self.psnr_db:.1f} dB at most"
        std = f" ± {self.std_db:.1f}" if self.std_db >= _STD_SHOWN_MIN_DB else ""
        return f"{self.psnr_db:.1f}{std} dB expected"


@dataclass(frozen=True)
class ShownPicture:
    """How well a hologram shows one of its pictures: that of one wavelength at one distance."""

    wavelength_m: float
    distance_m: float
    quality: Quality | None
    """Quality of the grey levels, as the display shows them. None: not judged (`judge="none"`)."""
    optimized_quality: Quality | None
    """Quality of the phases, before they were rounded to grey levels. None: not judged."""
    expected: Expected | None
    """What a photograph is expected to show. None: not judged."""
    second_opinion: SecondOpinion | None
    """Of an independent model, on some rows; None where it would take too long, or `judge` leaves it out."""
    kernel: str
    """Version of the kernel that the hologram was optimized for, or `ideal`."""


def quality_of(facts: dict[str, dict[str, Any]]) -> Quality:
    """Return the quality that the engine reports."""
    return Quality(**{name: DetectorQuality(**numbers) for name, numbers in facts.items()})


def opinion_of(facts: dict[str, Any] | None) -> SecondOpinion | None:
    """Return the second opinion that the engine reports."""
    return None if facts is None else SecondOpinion(**facts)


_DETECTORS = {"point": v1.DETECTOR_POINT, "pixel": v1.DETECTOR_PIXEL, "supersampled": v1.DETECTOR_SUPERSAMPLED}


def judged_quality(judgements: Iterable[v1.Judgement], stage: v1.Judgement.Stage.ValueType) -> Quality | None:
    """Return the quality by the kernel of a hologram that a server judged. None: it did not."""
    own = {
        each.detector: each
        for each in judgements
        if (each.model, each.stage, each.orders) == (v1.Judgement.MODEL_ENGINE, stage, v1.Judgement.ORDERS_OWN)
        # Those on some rows are for the comparison with the independent model.
        if not each.kernel_version and not each.HasField("rows")
    }
    if not own:
        return None
    return Quality(**{name: _detector_quality(own[number]) for name, number in _DETECTORS.items()})


def judged_by_another_model(judgements: Iterable[v1.Judgement]) -> SecondOpinion | None:
    """Return the second opinion that a server has of a picture."""
    on_rows = {each.model: each for each in judgements if each.HasField("rows")}
    if set(on_rows) != {v1.Judgement.MODEL_ENGINE, v1.Judgement.MODEL_INDEPENDENT}:
        return None
    engine, other = on_rows[v1.Judgement.MODEL_ENGINE], on_rows[v1.Judgement.MODEL_INDEPENDENT]
    return SecondOpinion(other.rows, engine.psnr_db.value, other.psnr_db.value)


def expected_of(judgements: Iterable[v1.Judgement], kernel: str) -> Expected | None:
    """Return what a server expects of a photograph. `kernel` is that of the hologram. None: it judged nothing."""
    judged = next((each for each in judgements if each.headline), None)
    if judged is None:
        return None
    is_of_photograph = judged.stage == v1.Judgement.STAGE_PHOTOGRAPHED
    std_db = judged.psnr_db.std if is_of_photograph else None
    return Expected(judged.psnr_db.value, std_db, judged.kernel_version or kernel)


def _detector_quality(judged: v1.Judgement) -> DetectorQuality:
    return DetectorQuality(
        psnr_db=judged.psnr_db.value,
        ssim=if_set(judged, "ssim"),
        ms_ssim=if_set(judged, "ms_ssim"),
        diffraction_efficiency=judged.diffraction_efficiency,
        frame_efficiency=judged.frame_efficiency,
        speckle_contrast=if_set(judged, "speckle_contrast"),
    )
