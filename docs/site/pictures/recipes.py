"""Pictures of the recipes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import lightpath
import numpy as np

from pictures.light import propagate, scaled
from pictures.strip import Studio, as_seen, grey, strip

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy.typing as npt
    from PIL import Image

DISTANCE = "25mm"
WAVELENGTHS = ["638nm", "520nm", "450nm"]
DEPTHS = ["24mm", "26mm", "28mm"]


def _colours(planes: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """Return planes [3][y][x] as a picture [y][x][3]."""
    return np.moveaxis(planes, 0, 2)


def colour(studio: Studio) -> Image.Image:
    """A colour picture: three phases, and what they show together."""
    display = studio.display("rgb", wavelength=WAVELENGTHS, simulated=None)
    hologram = display.optimize(studio.scene(), distance=DISTANCE, wavelength=WAVELENGTHS)
    return strip(
        {
            "target": studio.scene(),
            "hologram for red, 638 nm": hologram.all_levels[0][0],
            "shown: red, green and blue": hologram.reconstruction,
        }
    )


def _seen_at(hologram: lightpath.Hologram) -> dict[str, Any]:
    planes = zip(hologram.distances_m, hologram.reconstructions[0], strict=True)
    return {f"seen at {distance_m * 1e3:.0f} mm": plane for distance_m, plane in planes}


def focal_stack(studio: Studio) -> Image.Image:
    """Three pictures at three distances, of one hologram."""
    display = studio.display("plain", simulated=None)
    pictures = studio.training()[:3]
    hologram = display.optimize(pictures, distance=["20mm", "25mm", "30mm"])
    targets = {f"target at {z} mm": picture for z, picture in zip((20, 25, 30), pictures, strict=True)}
    return strip({**targets, **_seen_at(hologram)}, columns=3)


def depth_map(studio: Studio) -> Image.Image:
    """A picture whose parts are at three distances."""
    display = studio.display("plain", simulated=None)
    hologram = display.optimize(studio.scene(), distance=DEPTHS, depth_map=studio.depth())
    return strip(
        {"target": grey(studio.scene()), "depth: white is near": studio.depth(), "": np.full((160, 256), 255, np.uint8)}
        | _seen_at(hologram),
        columns=3,
    )


def subframes(studio: Studio) -> Image.Image:
    """One frame, and the mean of eight, with a full range of phases."""
    display = studio.display("plain", simulated=None)
    start = lightpath.RandomPhase(range_rad=6.2831853)
    shown: dict[str, Any] = {"target": grey(studio.scene())}
    for count in (1, 8):
        hologram = display.optimize(
            studio.scene(), distance=DISTANCE, subframes=count, initial_phase=start, detector="supersampled"
        )
        name = "1 subframe" if count == 1 else f"{count} subframes"
        shown[f"{name}, {hologram.expected.psnr_db:.1f} dB"] = hologram.reconstruction
    return strip(shown)


def few_levels(studio: Studio) -> Image.Image:
    """A modulator of four levels: rounded, and optimized through its levels."""
    display = studio.display("two-bit", bit_depth=2, simulated=1)
    shown: dict[str, Any] = {"target": grey(studio.scene())}
    for aware, name in ((False, "rounded"), (True, "through the levels")):
        hologram = display.optimize(studio.scene(), distance=DISTANCE, quantization_aware=aware)
        score = studio.lab.score(display.photograph(hologram, seed=1), studio.scene())
        shown[f"{name}, {score.psnr_db:.1f} dB"] = score.aligned
    return strip(shown)


def several_distances(studio: Studio) -> Image.Image:
    """A distance that was never photographed, for ideal optics and through an interpolated kernel."""
    display = studio.display("rail")
    datasets = []
    for distance in ("22mm", "28mm"):
        dataset = display.create_dataset(f"at-{distance}", distance=distance)
        for picture in studio.training()[:8]:
            hologram = display.optimize(picture, distance=distance, iterations=60)
            dataset.add(hologram, display.photograph(hologram, seed=1))
        dataset.finalize()
        datasets.append(dataset)
    for version in studio.lab.learn(datasets):
        version.promote()
    display.interpolate_kernel(distance=DISTANCE).promote()
    shown: dict[str, Any] = {"target": grey(studio.scene())}
    for kernel, name in (("ideal", "ideal optics"), ("active", "interpolated kernel")):
        hologram = display.optimize(studio.scene(), distance=DISTANCE, kernel=kernel)
        score = studio.lab.score(display.photograph(hologram, seed=1), studio.scene())
        shown[f"25 mm, {name}, {score.psnr_db:.1f} dB"] = score.aligned
    return strip(shown)


def camera_gaps(studio: Studio) -> Image.Image:
    """What a camera with gaps sees of holograms for a camera without gaps and for its own pixels."""
    shown: dict[str, Any] = {"target": grey(studio.scene())}
    for fill, name in ((1.0, "declared without gaps"), (0.5, "declared with gaps")):
        display = studio.display(f"gaps-{fill:.1f}".replace(".", "-"), camera_fill_factor=fill, simulated=None)
        hologram = display.optimize(studio.scene(), distance=DISTANCE)
        light = np.abs(propagate(np.exp(1j * hologram.phase), 25e-3, finer=4)) ** 2
        height, width = hologram.phase.shape
        # The camera sees the middle half of each side.
        seen = light.reshape(height, 4, width, 4)[:, 1:3, :, 1:3].mean(axis=(1, 3))
        shown[f"seen, {name}"] = as_seen(scaled(seen))
    return strip(shown)


def all_orders(studio: Studio) -> Image.Image:
    """A bare SLM: the hologram for the first order alone, and that for all orders."""
    bench = lightpath.SimulatedBench(seed=1, strength=0.02)
    filtered = studio.display("filtered", simulated=bench)
    bare = studio.display("bare", simulated=bench, orders=lightpath.AllOrders())
    shown: dict[str, Any] = {"target": grey(studio.scene())}
    for display, name in ((filtered, "--orders first"), (bare, "--orders all")):
        hologram = display.optimize(studio.scene(), distance="10mm")
        score = studio.lab.score(bare.photograph(hologram.levels, distance="10mm"), studio.scene())
        shown[f"made with {name}, {score.psnr_db:.1f} dB"] = score.aligned
    return strip(shown)


PICTURES: dict[str, Callable[[Studio], Image.Image]] = {
    "colour": colour,
    "focal-stack": focal_stack,
    "depth-map": depth_map,
    "subframes": subframes,
    "few-levels": few_levels,
    "several-distances": several_distances,
    "camera-gaps": camera_gaps,
    "all-orders": all_orders,
}
