"""Pictures of the pages that teach: a first hologram and kernel, and a calibration."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import lightpath
import matplotlib.pyplot as plt
import numpy as np
from lightpath import plot

from pictures.strip import Studio, as_seen, drawn, grey, strip

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy.typing as npt
    from PIL import Image

DISTANCE = "25mm"
PRACTICE: dict[str, Any] = {"seed": 4, "misalignment_px": 3.0, "rotation_rad": 0.014, "drift_px_per_hour": 0.1}
FULL_RANGE_RAD = 6.28


@functools.cache
def _learned(studio: Studio) -> lightpath.Display:
    """Return the display of the first ten minutes, after its kernel was promoted."""
    display = studio.display("bench")
    holograms = display.optimize_all(studio.training(), distance=DISTANCE, iterations=60)
    dataset = display.create_dataset("first", distance=DISTANCE)
    for hologram in holograms:
        dataset.add(hologram, display.photograph(hologram, seed=1))
    dataset.finalize()
    dataset.learn().promote()
    return display


def first_hologram(studio: Studio) -> Image.Image:
    """Target, hologram, expectation and photograph."""
    display = studio.display("bench")
    hologram = display.optimize(studio.scene(), distance=DISTANCE, kernel="ideal")
    return strip(
        {
            "target": studio.scene(),
            "hologram: grey levels for the SLM": hologram.levels,
            f"expected, {hologram.expected.psnr_db:.0f} dB": hologram.reconstruction,
            "photograph": as_seen(display.photograph(hologram, seed=1).pixels),
        },
        columns=2,
        zoom=1.4,
    )


def first_kernel(studio: Studio) -> Image.Image:
    """The photographs before and after learning."""
    display = _learned(studio)
    shown = {"target": grey(studio.scene())}
    for kernel, name in (("ideal", "for ideal optics"), ("active", "through the learned kernel")):
        hologram = display.optimize(studio.scene(), distance=DISTANCE, kernel=kernel)
        score = studio.lab.score(display.photograph(hologram, seed=1), studio.scene())
        shown[f"{name}, {score.psnr_db:.1f} dB"] = score.aligned
    return strip(shown)


@functools.cache
def _practice(studio: Studio) -> tuple[lightpath.Display, list[lightpath.Hologram]]:
    display = studio.display("lab", simulated=lightpath.SimulatedBench(**PRACTICE))
    pictures = studio.training()
    holograms = display.optimize_all(pictures[:6], distance=DISTANCE, iterations=60)
    start = lightpath.RandomPhase(range_rad=FULL_RANGE_RAD)
    wide = display.optimize_all(pictures[6:], distance=DISTANCE, iterations=60, initial_phase=start)
    return display, holograms + wide


def exposure(studio: Studio) -> Image.Image:
    """The same photograph, well exposed, over-exposed and under-exposed."""
    display, holograms = _practice(studio)
    light = display.photograph(holograms[0], seed=1).pixels.astype(float)
    return strip(
        {
            "well exposed": as_seen(light),
            "over-exposed fourfold": as_seen((4 * light).clip(0, 255)),
            "too dark": as_seen(light / 12),
        }
    )


@functools.cache
def _dots(studio: Studio, hours: float = 0.0) -> tuple[lightpath.Hologram, lightpath.Photograph]:
    display, _ = _practice(studio)
    hologram = display.optimize(display.calibration_target(), distance=DISTANCE, kernel="ideal", iterations=100)
    return hologram, display.photograph(hologram, seed=1, elapsed_s=3600 * hours)


def dots(studio: Studio) -> Image.Image:
    """The dots, their photograph, and the photograph after the alignment."""
    hologram, photograph = _dots(studio)
    display, _ = _practice(studio)
    dataset = display.create_dataset("dots", distance=DISTANCE)
    dataset.align(dots=photograph)
    matrix = np.reshape(list(dataset.refresh().message.alignment.homography), (3, 3))
    seen = _resampled(photograph.pixels.astype(float), matrix)
    # A level line through a row of dots shows that the camera is turned.
    rows = display.calibration_target().mean(axis=1)
    level = int(np.argmax(rows[: len(rows) // 3]))
    shown = {}
    for name, light in (("photograph", photograph.pixels), ("aligned", seen)):
        picture = np.repeat(as_seen(light)[:, :, None], 3, axis=2)
        picture[level] = (255, 60, 60)
        shown[name] = picture
    return strip({"hologram of dots": hologram.levels, **shown})


def _resampled(picture: npt.NDArray[Any], matrix: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return a photograph as the display's pixels see it: the matrix leads from these to the photograph's pixels."""
    height, width = picture.shape
    y, x = np.mgrid[:height, :width]
    u, v, w = matrix @ np.stack([x.ravel(), y.ravel(), np.ones(x.size)])
    columns, rows = np.rint(u / w).astype(int), np.rint(v / w).astype(int)
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    seen = np.where(inside, picture[rows.clip(0, height - 1), columns.clip(0, width - 1)], 0)
    return np.asarray(seen.reshape(height, width))


@functools.cache
def _version(studio: Studio) -> lightpath.KernelVersion:
    display, holograms = _practice(studio)
    dataset = display.create_dataset("bench-1", distance=DISTANCE)
    dataset.align(dots=_dots(studio)[1])
    for hologram in holograms:
        dataset.add(hologram, display.photograph(hologram, seed=1))
    dataset.finalize()
    return dataset.learn()


def report(studio: Studio) -> Image.Image:
    """What the kernel changes, and the light on the modulator."""
    learned = _version(studio).fetch()
    first, second = drawn(plot.transfer_function(learned), 80), drawn(plot.source(learned), 80)
    return strip(
        {"what the kernel changes at each frequency": first, "the light on the modulator": second}, columns=1, colours=0
    )


def judge(studio: Studio) -> Image.Image:
    """Photographs of a new picture, without and with the kernel."""
    display, _ = _practice(studio)
    shown = {"target": grey(studio.scene())}
    for kernel, name in (("ideal", "for ideal optics"), (_version(studio).number, "through version 1")):
        hologram = display.optimize(studio.scene(), distance=DISTANCE, kernel=kernel)
        score = studio.lab.score(display.photograph(hologram, seed=1), studio.scene())
        shown[f"{name}, {score.psnr_db:.1f} dB"] = score.aligned
    return strip(shown)


def drift(studio: Studio) -> Image.Image:
    """How photographs worsen while the camera drifts, with the old and with a renewed alignment."""
    display, holograms = _practice(studio)
    version = _version(studio).number
    losses: dict[str, list[float]] = {"with the first alignment": [], "with a new alignment": []}
    hours = [0, 5, 10, 20, 40]
    for hour in hours:
        for name, alignment in (("with the first alignment", 0), ("with a new alignment", hour)):
            dataset = display.create_dataset(f"{name.split(' ')[1]}-{name.split(' ')[2]}-{hour}", distance=DISTANCE)
            dataset.align(dots=_dots(studio, alignment)[1])
            for hologram in holograms[::2]:
                dataset.add(hologram, display.photograph(hologram, seed=2, elapsed_s=3600 * hour))
            # Finalizing must not move the photographs back: the picture shows what an old alignment costs.
            dataset.finalize(keep_alignment=True)
            losses[name].append(float(np.mean(list(dataset.evaluate(version).losses.values()))))
    figure, axes = plt.subplots(figsize=(6.4, 3.2), layout="constrained")
    for name, values in losses.items():
        axes.semilogy(hours, values, "o-", label=name)
    axes.set_xlabel("hours since the calibration")
    axes.set_ylabel("loss of the kernel")
    axes.legend()
    return drawn(figure)


PICTURES: dict[str, Callable[[Studio], Image.Image]] = {
    "first-hologram": first_hologram,
    "first-kernel": first_kernel,
    "exposure": exposure,
    "dots": dots,
    "report": report,
    "judge": judge,
    "drift": drift,
}
