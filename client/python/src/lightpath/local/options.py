"""Options of `lightpath.local` for holograms, as keyword arguments. Editors show them."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypedDict

if TYPE_CHECKING:
    from lightpath import words
    from lightpath.local.arrays import Array
    from lightpath.local.display import DisplayModel
    from lightpath.local.optics import Method
    from lightpath.units import Length


class LossOptions(TypedDict, total=False):
    """What a hologram is compared with, on which display. Either the optics of an ideal display, or a `kernel`."""

    wavelength: Length
    """Of an ideal display: metres, or text such as `"515nm"`."""
    pixel_pitch: Length
    """Of an ideal display: distance between pixels."""
    distance: Length
    """Of an ideal display: from the display to the image."""
    resolution: str | tuple[int, int]
    """Of an ideal display: columns x rows. Default: the size of the target, if it is an array."""
    propagation: Method
    """Of an ideal display: the propagation method. Default: `auto`."""
    kernel: DisplayModel
    """A learned display, which has optics of its own."""
    target_encoding: words.Encoding
    """What the target's values mean: `srgb` (default) or `linear` light."""
    fit: words.Fit
    """How a target of another size is fitted to the display: `contain` (default), `cover`, `stretch` or `exact`."""
    loss: words.Quantity
    """Quantity that is compared with the target: `intensity` (default) or `amplitude`."""
    total_variation: float
    """Factor of the total variation in the loss, 0 (default) to 1000."""
    speckle: float
    """Factor of the speckle in the loss, 0 (default) to 1000."""
    detector: words.Detector
    """What counts as the light of a pixel: `pixel` (default), `point` or `supersampled`."""
    region: tuple[int, int, int, int] | None
    """Region in which the picture counts: x, y, width, height [px]. Default: the middle 80 % of each axis."""
    weight: Array | None
    """How much each pixel counts, 0 to 1 [y][x]. Default: all the same."""


class OptimizeOptions(LossOptions, total=False):
    """How a hologram is found."""

    method: words.Method
    """`lbfgs` (default), `adam`, `gerchberg-saxton`, `weighted-gerchberg-saxton` or `double-phase`."""
    iterations: int
    """Number of iterations. Default: 200."""
    learning_rate: float
    """Learning rate of Adam [rad]. Default: 0.1."""
    seed: int
    """Seed of the random numbers in the initial phase. Default: 0."""
    initial_phase: str | Array
    """`recommended` (default), `random`, `constant`, `quadratic`, `back-propagated`, or phases [rad] [y][x]."""
    initial_range_rad: float
    """Range of the random phases of `random` and, in the image, of `back-propagated`. Default: 1."""
    bit_depth: int
    """Bits of the display's grey levels. Default: 8."""
    quantization_aware: bool
    """Optimize the last third of the iterations through the grey levels. Default: False."""
