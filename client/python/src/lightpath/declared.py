"""What users declare of displays and cameras: diffraction orders, simulated benches, points of an alignment."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal, TypeAlias

from lightpath import v1, words

Shape: TypeAlias = Literal["rectangle", "ellipse"]


@dataclass(frozen=True, kw_only=True)
class AllOrders:
    """All diffraction orders reach the image, as from a bare SLM. Fill factors are sides in pixel pitches, 0.1 to 1."""

    fill_factor_x: float | None = None
    """Side of a pixel's bright area along x. Default: 1, no gaps."""
    fill_factor_y: float | None = None
    """Side of a pixel's bright area along y. Default: 1."""

    def message(self) -> v1.AllOrders:
        """Return the message of the API."""
        return v1.AllOrders(**_given(self))


@dataclass(frozen=True, kw_only=True)
class OrderFilter:
    """A filter that lets a part of the first order through, such as the stop of a 4f relay.

    Sides and centre are in orders: in the focal plane of a lens of focal length f an order takes λf / pixel pitch. The
    opening lies within the first order.
    """

    width: float | None = None
    """Side along x, 0.1 to 1. Default: 1."""
    height: float | None = None
    """Side along y, 0.1 to 1. Default: 1."""
    shape: Shape = "rectangle"
    """`rectangle`, such as two slits or a knife edge, or `ellipse`, such as an iris."""
    centre_x: float = 0.0
    """Centre along x, counted from the middle of the image's spectrum."""
    centre_y: float = 0.0
    """Centre along y."""

    def message(self) -> v1.OrderFilter:
        """Return the message of the API."""
        given = _given(self)
        given["shape"] = words.number("shape", v1.OrderFilter.Shape, self.shape)
        return v1.OrderFilter(**given)


@dataclass(frozen=True, kw_only=True)
class SimulatedBench:
    """A display and a camera with imperfections, which exist only as a simulation. None: the default, or 0."""

    seed: int = 0
    """Seed of the random numbers. The same seed and properties give the same bench."""
    strength: float | None = None
    """Scale of every optical imperfection, 0 to 4. A display with 1, the default, is in need of alignment."""
    camera_noise: float | None = None
    """Standard deviation of the camera's read noise, as a fraction of its full scale, 0 to 0.1. Default: 0.003."""
    misalignment_px: float | None = None
    """Largest shift of the camera in x and in y [px], 0 to 4."""
    rotation_rad: float | None = None
    """Rotation of the camera about the middle of the image [rad], -0.175 to 0.175."""
    blur_px: float | None = None
    """Standard deviation of the blur by the camera's lens [px], 0 to 4."""
    full_well_electrons: float | None = None
    """Number of electrons of a camera pixel at full scale. Default: the shot noise there equals the read noise."""
    speckle_contrast: float | None = None
    """Contrast of a fixed speckle pattern from dust and coatings, 0 to 0.5."""
    crosstalk_px: float | None = None
    """Standard deviation of the blur of the modulator's wrapped phase along x [px], 0 to 2."""
    flicker: float | None = None
    """Relative amplitude by which the modulator's phase swings while the shutter is open, 0 to 0.5."""
    drift_px_per_hour: float | None = None
    """Drift of the image in an hour [px], 0 to 100."""
    dimming_per_hour: float | None = None
    """Part of its light that the source loses in an hour, 0 to 1."""
    rail_tilt_rad: float | None = None
    """Angle between the camera's rail and the optical axis [rad], 0 to 0.0875."""
    aberrations_at_m: float | None = None
    """Distance for which the aberrations are drawn [m]. Default: they are the same at all distances."""
    field_aberration_rad: float | None = None
    """Largest phase that aberrations add at the corner of the band, which depend on the position [rad], 0 to 6."""
    crosstalk_y_px: float | None = None
    """Cross-talk of the modulator along y [px], 0 to 2."""
    surface_waves: float | None = None
    """Height of the modulator's uneven surface from peak to valley [waves], 0 to 8."""
    response_variation: float | None = None
    """Largest relative change of the modulator's phase over its area, 0 to 0.5."""
    dust_contrast: float | None = None
    """Contrast of a fixed structure of dust and fringes in the light on the modulator, 0 to 0.5."""
    ghost_share: float | None = None
    """Light of a ghost, a shifted and defocused second image, as a part of the image's light, 0 to 0.3."""
    source_angle_rad: float | None = None
    """Angular width of the source as the modulator sees it [rad], 0 to 0.005."""
    bandwidth: float | None = None
    """Width of the source's line as a part of its wavelength, 0 to 0.1."""
    distortion: float | None = None
    """Displacement of the image's corner by the camera's lens, as a part of its distance from the middle, ±0.1."""
    vignetting: float | None = None
    """Part of the light that the camera's lens loses at the image's corner, 0 to 0.9."""
    camera_nonlinearity: float | None = None
    """Nonlinearity c of the camera's response, -0.3 to 0.3: light I in full scales gives I + c I (1 - I)."""

    def message(self) -> v1.SimulatedBench:
        """Return the message of the API."""
        return v1.SimulatedBench(**_given(self))

    def properties(self) -> dict[str, Any]:
        """Return the properties as the engine reads them."""
        return {"strength": 1.0, **_given(self)}


@dataclass(frozen=True)
class AlignmentPoint:
    """A point of the image and where the photographs show it. x goes right, y down; pixel centres are whole numbers."""

    display_x_px: float
    """Position in the image [px of the display]."""
    display_y_px: float
    photo_x_px: float
    """Position in the photographs [px of the photograph]."""
    photo_y_px: float

    def message(self) -> v1.AlignmentPoint:
        """Return the message of the API."""
        return v1.AlignmentPoint(**asdict(self))


def _given(declared: AllOrders | OrderFilter | SimulatedBench) -> dict[str, Any]:
    return {name: value for name, value in asdict(declared).items() if value is not None}
