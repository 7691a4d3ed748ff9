"""Optimization of holograms, with the same results as the server's jobs."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from lightpath import html, png, words
from lightpath.errors import InvalidArgument
from lightpath.local.arrays import Array, as_array, is_array, light, phase_rad
from lightpath.local.display import DisplayModel
from lightpath.local.engine import engine, refusals
from lightpath.local.optics import check, choose
from lightpath.local.options import LossOptions, OptimizeOptions
from lightpath.local.progress import Progress, listener
from lightpath.local.quality import Quality, SecondOpinion, opinion_of, quality_of, target_light
from lightpath.units import show_length

if TYPE_CHECKING:
    import os

    import numpy.typing as npt
    from typing_extensions import Unpack

    from lightpath.pictures import Picture

_AXES = 2


@dataclass(frozen=True, eq=False)
class Hologram:
    """An optimized hologram. Planes are [y][x]."""

    phase: npt.NDArray[np.float32] = field(repr=False)
    """Phase in [0, 2π) [rad], before it is rounded to grey levels."""
    reconstruction: npt.NDArray[np.float32] = field(repr=False)
    """What the display should show: linear light in the brightness of the target, for the rounded phase."""
    levels_png: bytes = field(repr=False)
    """The PNG file for the display: grey level = phase / 2π · 2^bits."""
    reconstruction_png: bytes = field(repr=False)
    """The reconstruction as an sRGB picture."""
    quality: Quality
    """Quality of the phase."""
    quantized_quality: Quality = field(repr=False)
    """Quality of the grey levels, as the display shows them."""
    second_opinion: SecondOpinion | None = field(repr=False)
    """Of an independent model, on some rows; None where it would take too long."""
    intensity_scale: float = field(repr=False)
    """Factor from the light of `DisplayModel.simulate` to the brightness of the target."""
    loss_history: tuple[float, ...] = field(repr=False)
    """Loss of each iteration, before it changed the phase."""
    kernel: DisplayModel
    """The display that the hologram was optimized for; its `plan` has the propagation method."""

    @property
    def loss(self) -> float:
        """Loss of the last iteration."""
        return self.loss_history[-1]

    @property
    def levels(self) -> npt.NDArray[Any]:
        """Grey levels for the display, uint8 or (above 8 bits) uint16."""
        return png.decode(self.levels_png)

    @property
    def field(self) -> npt.NDArray[np.complex64]:
        """The field behind an ideal modulator, exp(i phase)."""
        return np.asarray(np.exp(1j * self.phase), np.complex64)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the hologram: `.png` for the display as it is, or `.npy` of the phase in radians."""
        path = Path(path)
        if path.suffix == ".png":
            path.write_bytes(self.levels_png)
        elif path.suffix == ".npy":
            np.save(path, self.phase, allow_pickle=False)
        else:
            raise InvalidArgument("path", f'is "{path}"', "end it with .png (levels) or .npy (radians)")

    def save_reconstruction(self, path: str | os.PathLike[str]) -> None:
        """Write what the display should show as an sRGB PNG."""
        path = Path(path)
        if path.suffix != ".png":
            raise InvalidArgument("path", f'is "{path}"', "end it with .png")
        path.write_bytes(self.reconstruction_png)

    def _repr_png_(self) -> bytes:
        return png.thumbnail(self.reconstruction_png, html.PICTURE_SIDE_PX)

    def _repr_html_(self) -> str:
        pictures = html.picture("levels for the display", self.levels_png)
        pictures += html.picture("what it shows", self.reconstruction_png)
        optics = f"{show_length(self.kernel.wavelength_m)} at {show_length(self.kernel.distance_m)}"
        seen = self.quantized_quality.pixel
        rows: list[tuple[str, object]] = [
            ("optics", f"{optics}, {self.kernel.plan.method}"),
            ("kernel", self.kernel.kind),
            ("PSNR", f"{seen.psnr_db:.1f} dB"),
            ("diffraction efficiency", f"{seen.diffraction_efficiency:.1%}"),
        ]
        return pictures + html.table("Hologram", rows)


def optimize(target: Picture, *, progress: Progress = False, **options: Unpack[OptimizeOptions]) -> Hologram:
    """Find a phase with which a display shows a picture.

    `options` are `OptimizeOptions`: the optics of an ideal display (`wavelength`, `pixel_pitch`, `distance`) or a
    learned `kernel`, and how the phase is found. The same picture, options and seed give the same bytes as a server.
    `progress` is a function that gets step, number of steps and loss, or True for a bar. Ctrl-C stops the optimization.
    """
    check(options, OptimizeOptions)
    display, wanted, weight = _problem(target, options)
    start, given = _initial(options.get("initial_phase", "recommended"), options.get("initial_range_rad", 1.0))
    method = choose("method", options.get("method", "lbfgs"), get_args(words.Method))
    own = {
        "compared": _compared(options),
        "method": {"adam": {"learning_rate": options.get("learning_rate", 0.1)}} if method == "adam" else method,
        "iterations": options.get("iterations", 200),
        "seed": options.get("seed", 0),
        "initial_phase": start,
        "bit_depth": options.get("bit_depth", 8),
        "quantization_aware": options.get("quantization_aware", False),
    }
    with refusals(), listener(progress, "optimize") as listen:
        phase, shown, levels_png, shown_png, losses, text = engine.optimize(
            display.native, wanted, json.dumps(own), (weight, given), listen
        )
    facts = json.loads(text)
    return Hologram(
        phase=phase,
        reconstruction=shown,
        levels_png=levels_png,
        reconstruction_png=shown_png,
        quality=quality_of(facts["quality"]),
        quantized_quality=quality_of(facts["quantized_quality"]),
        second_opinion=opinion_of(facts["second_opinion"]),
        intensity_scale=facts["intensity_scale"],
        loss_history=tuple(losses),
        kernel=display,
    )


class HologramLoss:
    """The loss of phases for one target, with its exact gradient, for an optimization of your own.

    `loss(phase)` returns the loss, and `loss.gradient(phase)` the loss and its gradient ∂L/∂φ [1/rad], both at the gain
    that fits best. `options` are `LossOptions`. `lightpath.torch.HologramLoss` is the same for PyTorch.
    """

    def __init__(self, target: Picture, **options: Unpack[LossOptions]) -> None:
        check(options, LossOptions)
        self.kernel, wanted, weight = _problem(target, options)
        """The display whose light is compared."""
        self.gain: float = 1.0
        """The gain that fitted best in the last evaluation."""
        with refusals():
            self._native = engine.HologramLoss(self.kernel.native, wanted, json.dumps(_compared(options)), weight)

    def __call__(self, phase: Array) -> float:
        """Return the loss of a phase [rad]."""
        return self.gradient(phase)[0]

    def gradient(self, phase: Array) -> tuple[float, npt.NDArray[np.float32]]:
        """Return the loss of a phase [rad] and its gradient."""
        with refusals():
            loss, self.gain, gradient = self._native.evaluate(phase_rad("phase", phase))
        return loss, gradient


def _problem(
    target: Picture, options: LossOptions
) -> tuple[DisplayModel, npt.NDArray[np.float32], npt.NDArray[np.float32] | None]:
    """Return the display, the target's light on its pixels, and the weights of the pixels."""
    display, weight = _display(target, options), options.get("weight")
    wanted = target_light(target, display.shape, options.get("target_encoding", "srgb"), options.get("fit", "contain"))
    return display, wanted, None if weight is None else light("weight", weight)


def _display(target: Picture, options: LossOptions) -> DisplayModel:
    own = [name for name in ("wavelength", "pixel_pitch", "distance", "resolution", "propagation") if name in options]
    kernel = options.get("kernel")
    if kernel is not None:
        if own:
            raise InvalidArgument("kernel", "has optics of its own", f"leave out {', '.join(own)}")
        return kernel
    if "wavelength" not in options or "pixel_pitch" not in options or "distance" not in options:
        raise InvalidArgument("wavelength, pixel_pitch and distance", "are not all given", "give them, or a kernel")
    resolution = options.get("resolution")
    if resolution is None:
        if not is_array(target):
            raise InvalidArgument("resolution", "is not given", 'give that of the display, such as "1920x1080"')
        height_px, width_px = as_array("target", target).shape[:_AXES]
        resolution = (width_px, height_px)
    return DisplayModel.ideal(
        resolution,
        wavelength=options["wavelength"],
        pixel_pitch=options["pixel_pitch"],
        distance=options["distance"],
        method=options.get("propagation", "auto"),
    )


def _compared(options: LossOptions) -> dict[str, Any]:
    return {
        "loss": {
            "quantity": choose("loss", options.get("loss", "intensity"), get_args(words.Quantity)),
            "total_variation": options.get("total_variation", 0.0),
            "speckle": options.get("speckle", 0.0),
        },
        "detector": choose("detector", options.get("detector", "pixel"), get_args(words.Detector)),
        "region": options.get("region"),
    }


def _initial(initial: str | Array, range_rad: float) -> tuple[Any, npt.NDArray[np.float32] | None]:
    """Return the initial phase as the engine reads it, and the phases of a given one."""
    if not isinstance(initial, str):
        return {"given": None}, phase_rad("initial_phase", initial)
    forms: dict[str, Any] = {
        "recommended": None,
        "random": {"random": {"range_rad": range_rad}},
        "constant": {"constant": {"phase_rad": 0.0}},
        "quadratic": {"quadratic": {"focal_length_m": None}},
        "back-propagated": {"back_propagated": {"range_rad": range_rad}},
    }
    choose("initial_phase", initial, forms)
    return forms[initial], None
