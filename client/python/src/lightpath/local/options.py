"""Options of `lightpath.local` for holograms, as keyword arguments. Editors show them."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypedDict

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lightpath import words
    from lightpath.initial_phases import InitialPhase
    from lightpath.local.display import DisplayModel
    from lightpath.local.optics import Method
    from lightpath.options import Region
    from lightpath.pictures import Picture
    from lightpath.units import Length


class LossOptions(TypedDict, total=False):
    """What a hologram is compared with, on which display. Either the optics of an ideal display, or a `kernel`."""

    wavelength: Length | Sequence[Length]
    """Of an ideal display: metres, or text such as `"515nm"`; several for a colour hologram."""
    pixel_pitch: Length
    """Of an ideal display: distance between pixels."""
    distance: Length | Sequence[Length]
    """Of an ideal display: from the display to the image; several for pictures at several distances."""
    resolution: str | tuple[int, int]
    """Of an ideal display: columns x rows. Default: the size of the target, if it is an array."""
    propagation: Method
    """Of an ideal display: the propagation method. Default: `auto`."""
    kernel: DisplayModel | Sequence[DisplayModel]
    """A learned display, which has optics of its own; or one for each wavelength and distance."""
    target_encoding: words.Encoding
    """What the target's values mean: `srgb` (default) or `linear` light."""
    fit: words.Fit
    """How a target of another size is fitted to its area: `contain` (default), `cover`, `stretch` or `exact`."""
    area: words.Area
    """What the target fills, with black around it: the `region` that is compared, or the whole `display`. Default:
    `region`; with `fit="exact"` `display`."""
    loss: words.Quantity
    """Quantity that is compared with the target: `intensity` (default) or `amplitude`."""
    total_variation: float
    """Factor of the total variation in the loss, 0 (default) to 1000."""
    speckle: float
    """Factor of the speckle in the loss, 0 (default) to 1000."""
    detector: words.Detector
    """What counts as the light of a pixel: `pixel` (default), `point` or `supersampled`."""
    region: Region
    """Region in which the picture counts: x, y, width, height [px]. Default: the middle 80 % of each axis."""
    weight_mask: Picture
    """Linear grey picture of the pixels' weights, or an array 0 to 1 [y][x]. Black pixels do not count."""


class OptimizeOptions(LossOptions, total=False):
    """How a hologram is found."""

    method: words.Method
    """`lbfgs` (default), `adam`, `gerchberg-saxton`, `weighted-gerchberg-saxton` or `double-phase`."""
    iterations: int
    """Number of iterations; 0 judges the phases in `initial_phase` as they are. Default: 200."""
    learning_rate: float
    """Learning rate of Adam [rad]. Default: 0.1."""
    seed: int
    """Seed of the random numbers in the initial phase. Default: 0."""
    initial_phase: InitialPhase
    """The phase with which the search starts: `random`, `constant`, `quadratic`, `back-propagated`, one of the classes
    `RandomPhase`, `ConstantPhase`, `LensPhase`, `BackPropagatedPhase`, or phases in radians [y][x]. Default: what leads
    to the best picture."""
    depth_map: Picture
    """Linear grey picture that gives each pixel one of several distances: white the first, black the last."""
    subframes: int
    """Number of patterns that are shown one after the other. Default: 1."""
    bit_depth: int
    """Bits of the display's grey levels. Default: 8."""
    quantization_aware: bool
    """Optimize the last third of the iterations through the grey levels. Default: False."""
    judge: words.Judging
    """How thoroughly the hologram is judged: `full` (default), `quick` (not by the independent model) or `none`."""
