"""Models of displays: ideal, learned from photographs, or read from a file; and simulated displays."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, get_args

import numpy as np

from lightpath import words
from lightpath.declared import SimulatedBench
from lightpath.errors import InvalidArgument
from lightpath.local.arrays import Array, complex_field, frames_rad, light, phase_rad
from lightpath.local.engine import engine, refusals
from lightpath.local.optics import REQUIRED, OpticsOptions, choose, optics_json
from lightpath.local.targets import Placement, target_light
from lightpath.options import Region, check_type, region_px
from lightpath.photograph import Photograph
from lightpath.pictures import Phase, Picture, file_bytes
from lightpath.plans import plan_of
from lightpath.quality import Quality, SecondOpinion, opinion_of, quality_of
from lightpath.signature import with_options
from lightpath.units import show_length

if TYPE_CHECKING:
    import os

    import numpy.typing as npt
    from typing_extensions import Unpack

    from lightpath.hologram import Hologram
    from lightpath.units import Length


@dataclass(frozen=True)
class LearningRecord:
    """How a model was learned. Indices count the pairs that were given."""

    loss_history: tuple[float, ...]
    """Mean training loss of each epoch, then of each iteration of the refinement."""
    training: tuple[int, ...]
    """Pairs that the model was fitted to."""
    left_out: tuple[int, ...]
    """Training pairs whose photographs do not show their holograms. They were not used."""
    validation: tuple[int, ...]
    """Pairs that chose the parts of the model."""
    validation_loss: float | None
    """Mean loss of the validation pairs; None without such pairs."""
    ideal_validation_loss: float | None
    """The same for a display without errors."""


class DisplayModel:
    """A model of a display: the light on its modulator, its response, and the way of the light to the image.

    `ideal`, `load` and `lightpath.local.learn` make one. `optimize` and `propagate` take it as `kernel`.
    """

    def __init__(self, native: engine.DisplayModel, record: LearningRecord | None = None) -> None:
        self.native = native
        """The engine's own object."""
        self.record = record
        """How the model was learned; None for a model that was not learned in this process."""
        facts = json.loads(native.facts())
        self.shape: tuple[int, int] = (facts["height_px"], facts["width_px"])
        """Rows and columns [px]."""
        self.pixel_pitch_m: float = facts["pixel_pitch_m"]
        self.wavelength_m: float = facts["wavelength_m"]
        self.distance_m: float = facts["distance_m"]
        self.kind: str = facts["kind"]
        """`ideal`, `display`, `varying`, `smooth`, `dense` or `paper`."""
        self.plan = plan_of(facts["plan"])
        """The propagation that the model uses."""
        self.note: str | None = facts["note"]
        """What the file that the model was read from did not hold."""

    @classmethod
    @with_options(OpticsOptions, required=REQUIRED)
    def ideal(cls, resolution: str | tuple[int, int], **optics: Unpack[OpticsOptions]) -> DisplayModel:
        """Return the model of a display without errors."""
        with refusals():
            return cls(engine.DisplayModel.ideal(optics_json(resolution, optics)))

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        *,
        resolution: str | tuple[int, int] | None = None,
        wavelength: Length | None = None,
        pixel_pitch: Length | None = None,
        distance: Length | None = None,
    ) -> DisplayModel:
        """Read a kernel: a file of a server or of `save`, or the `kernel.pt` or `.npy` of the paper's code.

        The paper's files hold a transfer function alone. Give resolution and optics for them. No code in a file is run.
        """
        given = None
        if resolution is not None and wavelength is not None and pixel_pitch is not None and distance is not None:
            optics: OpticsOptions = {"wavelength": wavelength, "pixel_pitch": pixel_pitch, "distance": distance}
            given = optics_json(resolution, optics)
        elif (resolution, wavelength, pixel_pitch, distance) != (None, None, None, None):
            fix = "give all of them, or none for a file that has them"
            raise InvalidArgument("resolution, wavelength, pixel_pitch and distance", "are not all given", fix)
        with refusals():
            return cls(engine.DisplayModel.decode(file_bytes("path", path), given))

    def save(self, path: str | os.PathLike[str], format: words.KernelFormat = "safetensors") -> list[str]:
        """Write the model, and return what the form does not hold.

        `safetensors` holds everything, as a server keeps it; `lightpath kernel import` reads it. `npz` also has H and
        the source as arrays, `compact` is for firmware, `pt` and `npy` are the paper's.
        """
        word = choose("format", format, get_args(words.KernelFormat))
        with refusals():
            content, losses = self.native.encode(word)
        Path(path).write_bytes(content)
        return losses

    @property
    def transfer_function(self) -> npt.NDArray[np.complex64]:
        """H on the axis, complex64 [2 rows][2 columns], zero frequency at [0][0]. It is computed at each access."""
        with refusals():
            return self.native.transfer_function()

    def field(self, phase: Hologram | Phase, *, bit_depth: int = 8) -> npt.NDArray[np.complex64]:
        """Return the complex field in the image at the pixels' centres, for a phase as `simulate` takes it."""
        with refusals():
            return self.native.field(phase_rad("phase", phase, bits=bit_depth))

    def propagate(self, field: Array) -> npt.NDArray[np.complex64]:
        """Return the image of a complex field behind the modulator. The modulator's model is not used.

        Real numbers are amplitudes with the phase 0.
        """
        with refusals():
            return self.native.propagate(complex_field("field", field, np.complex64))

    def simulate(
        self, phase: Hologram | Phase, *, detector: words.Detector = "pixel", bit_depth: int = 8
    ) -> npt.NDArray[np.float32]:
        """Return the light of a hologram in the image, as a detector measures it. Its mean is about 1.

        - `phase`: a hologram, or a file or an array of radians (floats) or grey levels (integers) [y][x]. With an axis
          before, [subframe][y][x], it is the mean light of all of them.
        - `bit_depth`: bits of grey levels
        """
        word = choose("detector", detector, get_args(words.Detector))
        with refusals():
            return self.native.light(frames_rad("phase", phase, bits=bit_depth), word)

    def quality(
        self,
        phase: Hologram | Phase,
        target: Picture,
        *,
        region: Region | None = None,
        target_encoding: words.Encoding = "srgb",
        fit: words.Fit = "contain",
        area: words.Area | None = None,
        bit_depth: int = 8,
    ) -> tuple[Quality, SecondOpinion | None]:
        """Return how well a hologram, whoever made it, shows a target, and what an independent model says.

        `phase` is as `simulate` takes it. The target fills the region by default, as in `optimize`.
        The opinion is about the light of the detector `pixel`, on some rows.
        """
        shown = frames_rad("phase", phase, bits=bit_depth)
        wanted = target_light(target, self.shape, target_encoding, Placement(fit, area, region_px(region)))
        with refusals():
            facts = json.loads(self.native.quality(shown, wanted, region_px(region)))
        return quality_of(facts["quality"]), opinion_of(facts["second_opinion"])

    def losses(
        self,
        phases: Array,
        captures: Array,
        *,
        region: Region | None = None,
        detector: words.Detector = "pixel",
    ) -> list[float]:
        """Return how well the model predicts each capture: mean squared error, at the best gain and offset of each."""
        word = choose("detector", detector, get_args(words.Detector))
        with refusals():
            sets = (phase_rad("phases", phases, axes=3), light("captures", captures, axes=3))
            return engine.losses(self.native, *sets, region_px(region), word)

    def __repr__(self) -> str:
        optics = f"{show_length(self.wavelength_m)} at {show_length(self.distance_m)}"
        return f"<DisplayModel {self.kind}, {self.shape[1]}x{self.shape[0]} px, {optics}>"


class SimulatedDisplay:
    """A display with imperfections and its camera, which exist only in the engine: for trying out `learn`.

    `simulated` is the seed that draws the imperfections, or a `lightpath.SimulatedBench` with its properties, as of a
    server's displays. The camera is in place, unless that says `misalignment_px`.
    """

    def __init__(
        self,
        resolution: str | tuple[int, int],
        *,
        wavelength: Length,
        pixel_pitch: Length,
        distance: Length,
        simulated: int | SimulatedBench = 1,
    ) -> None:
        optics = optics_json(resolution, {"wavelength": wavelength, "pixel_pitch": pixel_pitch, "distance": distance})
        bench = SimulatedBench(seed=simulated) if isinstance(simulated, int) else simulated
        with refusals():
            self._native = engine.SimulatedDisplay(optics, json.dumps(bench.properties()))

    def photograph(self, hologram: Hologram | Phase, *, seed: int = 0, bit_depth: int = 8) -> Photograph:
        """Return a photograph of a hologram, in linear light. `seed` is that of the camera's noise.

        `hologram` is as `DisplayModel.simulate` takes it, with one pattern. NumPy takes the photograph as an array.
        """
        check_type("seed", seed, "int")
        with refusals():
            pixels = self._native.photograph(phase_rad("hologram", hologram, bits=bit_depth), seed)
        return Photograph.of_pixels(pixels)
