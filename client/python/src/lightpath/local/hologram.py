"""Optimization of holograms, with the same results as the server's jobs."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, cast, get_args

import numpy as np

from lightpath import words
from lightpath.complex_targets import as_light
from lightpath.errors import InvalidArgument
from lightpath.hologram import Hologram
from lightpath.initial_phases import named, options_of, parts_of
from lightpath.local.arrays import Array, as_array, is_array, phase_rad
from lightpath.local.displays import displays_of
from lightpath.local.engine import engine, refusals
from lightpath.local.optics import choose
from lightpath.local.options import LossOptions, OptimizeOptions
from lightpath.local.progress import Progress, listener
from lightpath.local.targets import Placement, colour_of, target_light
from lightpath.options import check, given, region_px
from lightpath.quality import Expected, ShownPicture, opinion_of, quality_of
from lightpath.signature import with_options

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import numpy.typing as npt
    from typing_extensions import Unpack

    from lightpath.local.display import DisplayModel
    from lightpath.pictures import Picture

_COLOURS = 3


@with_options(OptimizeOptions)
def optimize(
    target: Picture | Sequence[Picture], *, progress: Progress = False, **options: Unpack[OptimizeOptions]
) -> Hologram:
    """Find phases with which a display shows a picture, several at several distances, or a picture in colour.

    - `target`: a file, a PIL image, an array or a tensor. With several distances: one picture for each, or one picture
      for all (with the option `depth_map` for a picture with depth). With `method="double-phase"` also a complex field
      [y][x], whose amplitude and phase the image gets.
    - `progress`: a function that gets step, number of steps and loss, or True for a bar

    Give the optics of an ideal display (`wavelength`, `pixel_pitch`, `distance`), or a learned `kernel`. The same
    picture, options and seed give the same bytes as a server. Ctrl-C stops the optimization.
    """
    check(options, OptimizeOptions)
    own = given(options)
    targets = as_light(list(target) if isinstance(target, list | tuple) else [cast("Picture", target)], own)
    displays = displays_of(targets[0], own)
    search = _Search(targets, displays, own)
    with refusals(), listener(progress, "optimize") as listen:
        done = [search.run(index, listen) for index in range(len(displays))]
    return _hologram(displays, done)


class _Search:
    """The search for the phases of each wavelength: what is the same for all of them."""

    def __init__(
        self, targets: Sequence[Picture], displays: Sequence[Sequence[DisplayModel]], options: dict[str, Any]
    ) -> None:
        self._targets, self._displays, self._options = targets, displays, options
        planes = len(displays[0])
        if len(targets) not in {1, planes}:
            fix = "give one picture, or one for each distance"
            raise InvalidArgument("target", f"has {len(targets)} pictures for {planes} distances", fix)
        if "depth_map" in options and planes == 1:
            raise InvalidArgument("depth_map", "is given for one distance", "give several, such as distance=[…, …]")
        start = named(options.get("initial_phase"))
        frames = options.get("subframes", 1)
        self._text = json.dumps(self._search(start))
        self._given = None
        if options_of(start) == {"given": None}:
            shown = as_array("initial_phase", start) if is_array(start) else phase_rad("initial_phase", start)
            self._given = parts_of(shown, len(displays), frames)

    def _search(self, start: Any) -> dict[str, Any]:
        options = self._options
        method = choose("method", options.get("method", "lbfgs"), get_args(words.Method))
        return {
            "compared": _compared(options),
            "method": {"adam": {"learning_rate": options.get("learning_rate", 0.1)}} if method == "adam" else method,
            "iterations": options.get("iterations", 200),
            "seed": options.get("seed", 0),
            "initial_phase": options_of(start),
            "subframes": options.get("subframes", 1),
            "bit_depth": options.get("bit_depth", 8),
            "quantization_aware": options.get("quantization_aware", False),
            "judge": choose("judge", options.get("judge", "full"), get_args(words.Judging)),
        }

    def run(self, index: int, listen: Callable[[int, int, float], Any] | None) -> tuple[Any, ...]:
        """Optimize the hologram of one wavelength."""
        displays, count = self._displays[index], len(self._displays)
        colour = colour_of([each[0].wavelength_m for each in self._displays], index)
        lights = [_light(each, displays[0].shape, self._options, colour) for each in self._targets]
        frames = None
        if self._given is not None:
            frames = np.stack([phase_rad("initial_phase", each) for each in self._given[index]])

        def told(step: int, steps: int, loss: float) -> None:
            if listen is not None:
                listen(index * steps + step, count * steps, loss)

        return engine.optimize(
            [each.native for each in displays],
            lights if len(lights) == len(displays) else lights * len(displays),
            self._text,
            (self._map("weight_mask", displays[0].shape), self._map("depth_map", displays[0].shape), frames),
            told,
        )

    def _map(self, name: str, shape: tuple[int, int]) -> npt.NDArray[np.float32] | None:
        return linear_map(name, shape, self._options)


def linear_map(name: str, shape: tuple[int, int], options: dict[str, Any]) -> npt.NDArray[np.float32] | None:
    """Return a picture of weights or depths in an option, as the engine takes it; None: it is not given."""
    if name not in options:
        return None
    return target_light(options[name], shape, "linear", Placement.of(options), name=name)


def _hologram(displays: Sequence[Sequence[DisplayModel]], done: Sequence[tuple[Any, ...]]) -> Hologram:
    facts = [json.loads(each[5]) for each in done]
    colours = []
    if len(done) == _COLOURS:
        # The longest wavelength is red.
        order = sorted(range(_COLOURS), key=lambda index: -displays[index][0].wavelength_m)
        colours = [engine.colour(*(done[i][3][plane] for i in order)) for plane in range(len(displays[0]))]
    x_px, y_px, width_px, height_px = facts[0]["region"]
    return Hologram(
        phases=np.stack([each[0] for each in done]),
        levels_png=[each[2] for each in done],
        reconstructions_png=[each[3] for each in done],
        colours_png=colours,
        pictures=[
            [_shown(model, plane) for model, plane in zip(models, fact["planes"], strict=True)]
            for models, fact in zip(displays, facts, strict=True)
        ],
        losses=[each[4][-1] for each in done],
        intensity_scales=[fact["intensity_scale"] for fact in facts],
        region=(x_px, y_px, width_px, height_px),
        models=displays,
        loss_histories=[tuple(each[4]) for each in done],
        lights=[each[1] for each in done],
    )


def _shown(model: DisplayModel, facts: dict[str, Any]) -> ShownPicture:
    quality = None if facts["quantized_quality"] is None else quality_of(facts["quantized_quality"])
    return ShownPicture(
        wavelength_m=model.wavelength_m,
        distance_m=model.distance_m,
        quality=quality,
        optimized_quality=None if facts["quality"] is None else quality_of(facts["quality"]),
        # How large the error of a model on photographs is, a server knows from test photographs.
        expected=None if quality is None else Expected(quality.pixel.psnr_db, None, model.kind),
        second_opinion=opinion_of(facts["second_opinion"]),
        kernel=model.kind,
    )


class HologramLoss:
    """The loss of phases for one target, with its exact gradient, for an optimization of your own.

    `loss(phase)` returns the loss, and `loss.gradient(phase)` the loss and its gradient ∂L/∂φ [1/rad], both at the gain
    that fits best. `lightpath.torch.HologramLoss` is the same for PyTorch.
    """

    @with_options(LossOptions)
    def __init__(self, target: Picture, **options: Unpack[LossOptions]) -> None:
        """Prepare the loss for a target, of one wavelength at one distance."""
        check(options, LossOptions)
        own = given(options)
        displays = displays_of(target, own)
        if (len(displays), len(displays[0])) != (1, 1):
            raise InvalidArgument("distance", "and wavelength have several values", "make a HologramLoss for each")
        self.kernel = displays[0][0]
        """The display whose light is compared."""
        self.gain: float = 1.0
        """The gain that fitted best in the last evaluation."""
        wanted, weight = _light(target, self.kernel.shape, own, None), linear_map("weight_mask", self.kernel.shape, own)
        with refusals():
            self._native = engine.HologramLoss(self.kernel.native, wanted, json.dumps(_compared(own)), weight)

    def __call__(self, phase: Array) -> float:
        """Return the loss of a phase [rad]."""
        return self.gradient(phase)[0]

    def gradient(self, phase: Array) -> tuple[float, npt.NDArray[np.float32]]:
        """Return the loss of a phase [rad] and its gradient."""
        with refusals():
            loss, self.gain, gradient = self._native.evaluate(phase_rad("phase", phase))
        return loss, gradient


def _light(
    target: Picture, shape: tuple[int, int], options: dict[str, Any], colour: int | None
) -> npt.NDArray[np.float32]:
    return target_light(target, shape, options.get("target_encoding", "srgb"), Placement.of(options), colour=colour)


def _compared(options: dict[str, Any]) -> dict[str, Any]:
    return {
        "loss": {
            "quantity": choose("loss", options.get("loss", "intensity"), get_args(words.Quantity)),
            "total_variation": options.get("total_variation", 0.0),
            "speckle": options.get("speckle", 0.0),
        },
        "detector": choose("detector", options.get("detector", "pixel"), get_args(words.Detector)),
        "region": region_px(options.get("region")),
    }
