"""Pictures of concepts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import lightpath
import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

from pictures.light import PITCH_M, critical_distance_m, pixel_light, propagate, scaled, transfer_phase
from pictures.strip import Studio, as_seen, drawn, grey, strip

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy.typing as npt

FINER = 4
DISTANCE, DISTANCE_M = "25mm", 25e-3
# Part of the scene that is shown enlarged: rows, columns.
DETAIL = (slice(60, 110), slice(40, 120))


def detectors(studio: Studio) -> Image.Image:
    """One hologram for the sample points and one for pixels, both as points, between them, and as pixels."""
    display = studio.display("ideal", simulated=None)
    shown = {}
    for detector in ("point", "pixel"):
        hologram = display.optimize(studio.scene(), distance=DISTANCE, detector=detector)
        fine = propagate(np.exp(1j * hologram.phase), DISTANCE_M, finer=FINER)
        light, rows, columns = np.abs(fine) ** 2, *DETAIL
        full = np.quantile(pixel_light(fine, FINER)[DETAIL], 0.995) / 255
        inside = light[rows.start * FINER : rows.stop * FINER, columns.start * FINER : columns.stop * FINER]
        middles = np.abs(propagate(np.exp(1j * hologram.phase), DISTANCE_M)) ** 2
        points = np.kron(middles[DETAIL], np.ones((FINER, FINER)))
        pixels = np.kron(pixel_light(fine, FINER)[DETAIL], np.ones((FINER, FINER)))
        for name, seen in (("at the points", points), ("between them, too", inside), ("as pixels", pixels)):
            shown[f"optimized for {detector}s: {name}"] = as_seen((seen / full).clip(0, 255))
    return strip(shown, columns=3)


def sampling(_studio: Studio) -> Image.Image:
    """The phase of the transfer function below and above the critical distance, and its samples."""
    pixels = 160
    critical_m = critical_distance_m(pixels)
    samples = np.fft.fftshift(np.fft.fftfreq(2 * pixels, PITCH_M))
    fine = np.linspace(samples[0], samples[-1], 8000)
    figure, both = plt.subplots(2, 1, figsize=(7.6, 4.6), layout="constrained", sharex=True)
    for axes, factor in zip(both, (0.5, 2.5), strict=True):
        for frequency, style in ((fine, "-"), (samples, ".")):
            shown = frequency > 0.55 * samples[-1]
            phase = np.cos(transfer_phase(frequency, factor * critical_m))
            axes.plot(frequency[shown] / 1e3, phase[shown], style, markersize=6, linewidth=0.8)
        axes.set_title(f"{factor * critical_m * 1e3:.0f} mm: {factor:g} times the critical distance", fontsize=10)
        axes.set_ylabel("real part of H")
    both[1].set_xlabel("frequency [cycles/mm]; line: the wave, dots: its samples")
    return drawn(figure)


def padding(_studio: Studio) -> Image.Image:
    """A bright square that leaves the frame: with padding it leaves, without it comes in again on the other side."""
    field = np.zeros((160, 256), complex)
    field[60:100, 196:236] = 1
    # A wedge that steers the light to the right, by half of the highest angle.
    field *= np.exp(1j * np.pi / 2 * np.arange(256))
    shown = {"at the SLM, steered to the right": as_seen(scaled(np.abs(field) ** 2))}
    for pad, name in ((2, "25 mm behind, padded"), (1, "25 mm behind, not padded")):
        shown[name] = as_seen(scaled(np.abs(propagate(field, DISTANCE_M, pad=pad)) ** 2, 0.999))
    return strip(shown)


def speckle(studio: Studio) -> Image.Image:
    """Photographs of holograms that begin with a narrow and with a full range of random phases."""
    display = studio.display("speckle", simulated=lightpath.SimulatedBench(seed=1, strength=0.3))
    shown = {"target": grey(studio.scene())}
    for range_rad, name in ((0.5, "phases within 0.5 rad"), (6.28, "phases of a full turn")):
        start = lightpath.RandomPhase(range_rad=range_rad)
        hologram = display.optimize(studio.scene(), distance=DISTANCE, initial_phase=start)
        shown[f"photograph, {name}"] = studio.lab.score(display.photograph(hologram, seed=1), studio.scene()).aligned
    return strip(shown)


def knowledge(studio: Studio) -> Image.Image:
    """Kernels of one display from different photographs: with free frequencies, and with a physical model."""
    display = studio.display("bench")
    datasets = []
    for half in range(2):
        dataset = display.create_dataset(f"half-{half}", distance=DISTANCE)
        for picture in studio.training()[half::2]:
            hologram = display.optimize(picture, distance=DISTANCE, kernel="ideal", iterations=60)
            dataset.add(hologram, display.photograph(hologram, seed=half))
        dataset.finalize(validation_fraction=0, test_fraction=0)
        datasets.append(dataset)
    light = np.fft.fftshift(
        np.abs(np.fft.fft2(np.exp(1j * hologram.phase), [2 * n for n in hologram.phase.shape])) ** 2
    )
    reach = 0.5e-3 / PITCH_M
    figure, all_axes = plt.subplots(1, 3, figsize=(12, 3.4), sharey=True)
    shown = [
        ("light of a hologram [dB]", _decibels(light), "viridis", (-60, 0)),
        ("free frequencies: difference [rad]", _difference(datasets, "dense"), "magma", (0, 0.4)),
        ("model of a display: difference [rad]", _difference(datasets, "display"), "magma", (0, 0.4)),
    ]
    for axes, (title, values, colours, (low, high)) in zip(all_axes, shown, strict=True):
        image = axes.imshow(values, cmap=colours, vmin=low, vmax=high, extent=(-reach, reach, reach, -reach))
        figure.colorbar(image, ax=axes, shrink=0.8)
        axes.set_title(title, fontsize=9)
        axes.set_xlabel("fx [cycles/mm]")
        print(f"{title}: mean {values.mean():.3g}, largest {values.max():.3g}")
    all_axes[0].set_ylabel("fy [cycles/mm]")
    return drawn(figure, 80).quantize(256, dither=Image.Dither.NONE)


def _difference(datasets: list[lightpath.Dataset], model: Literal["dense", "display"]) -> npt.NDArray[Any]:
    """Return how much the phases of kernels from two datasets differ, smoothed as `_decibels` does."""
    first, second = (dataset.learn(model=model).fetch().transfer_function for dataset in datasets)
    turned = np.fft.fftshift(first * np.conj(second))
    # A phase that is the same at all frequencies cannot be seen, so it is taken away.
    turned *= np.exp(-1j * np.angle(turned.sum()))
    return _smoothed(np.abs(np.angle(turned)))


def _decibels(light: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return light relative to its brightest part, smoothed so that grain does not hide where it is."""
    smooth = _smoothed(light)
    return np.asarray(10 * np.log10(smooth / smooth.max() + 1e-9))


def _smoothed(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    return np.asarray(Image.fromarray(values.astype(np.float32)).resize((64, 40), Image.Resampling.BOX))


def orders(studio: Studio) -> Image.Image:
    """A hologram for the first order alone, seen on a display that shows all orders of its pixels."""
    filtered = studio.display("filtered", simulated=lightpath.SimulatedBench(seed=1, strength=0.02))
    bare = studio.display(
        "bare", simulated=lightpath.SimulatedBench(seed=1, strength=0.02), orders=lightpath.AllOrders()
    )
    shown = {}
    for made_for in (filtered, bare):
        hologram = made_for.optimize(studio.scene(), distance="10mm")
        for display, name in ((filtered, "with a filter"), (bare, "without a filter")):
            score = studio.lab.score(display.photograph(hologram.levels, distance="10mm"), studio.scene())
            kind = "first order" if made_for is filtered else "all orders"
            shown[f"made for {kind},\nseen {name}: {score.psnr_db:.1f} dB"] = score.aligned
    return strip(shown, columns=2)


def second_opinion(studio: Studio) -> Image.Image:
    """What methods promise, and what the independent model finds."""
    display = studio.display("ideal", simulated=None)
    distances = [5, 10, 20, 38]
    figure, axes = plt.subplots(figsize=(7, 3.4), layout="constrained")
    methods: list[tuple[Literal["band-response", "angular-spectrum"], str]]
    methods = [("band-response", "tab:blue"), ("angular-spectrum", "tab:orange")]
    for method, colour in methods:
        promised: list[float] = []
        found: list[float] = []
        for distance in distances:
            hologram = display.optimize(studio.scene(), distance=f"{distance}mm", propagation=method)
            opinion = hologram.second_opinion
            assert opinion is not None
            promised.append(opinion.engine_psnr_db)
            found.append(opinion.independent_psnr_db)
        axes.plot(distances, promised, "o--", color=colour, label=f"{method}: promised")
        axes.plot(distances, found, "o-", color=colour, label=f"{method}: found by the independent model")
    axes.set_xlabel("distance [mm]")
    axes.set_ylabel("PSNR [dB]")
    axes.legend(fontsize=9)
    return drawn(figure)


PICTURES: dict[str, Callable[[Studio], Image.Image]] = {
    "detectors": detectors,
    "sampling": sampling,
    "padding": padding,
    "speckle": speckle,
    "knowledge": knowledge,
    "orders": orders,
    "second-opinion": second_opinion,
}
