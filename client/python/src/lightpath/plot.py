"""Figures with matplotlib: pictures in millimetres, spectra in cycles per millimetre, colour bars with units.

Each function draws into `axes`, or into a new figure, and returns the axes. It needs matplotlib: `pip install
"lightpath[plot]"`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Rectangle

from lightpath import png
from lightpath.errors import InvalidArgument

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy.typing as npt
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from lightpath.hologram import Hologram
    from lightpath.learned import LearnedKernel

_GREY_AXES = 2


def phase(
    phase_rad: Hologram | npt.NDArray[Any], *, pixel_pitch_m: float | None = None, axes: Axes | None = None
) -> Axes:
    """Draw a phase [y][x] in radians, with a cyclic colour map from 0 to 2π."""
    # Of several phases of a hologram the first one.
    values = phase_rad if isinstance(phase_rad, np.ndarray) else phase_rad.phases[0, 0]
    axes = _axes(axes)
    image = axes.imshow(
        np.mod(values, 2 * np.pi), cmap="twilight", vmin=0, vmax=2 * np.pi, extent=_extent(values, pixel_pitch_m)
    )
    bar = _bar(image, axes, "phase [rad]")
    bar.set_ticks([0, np.pi, 2 * np.pi], labels=["0", "π", "2π"])
    _label_plane(axes, pixel_pitch_m)
    return axes


def picture(
    pixels: npt.NDArray[Any],
    *,
    pixel_pitch_m: float | None = None,
    title: str = "",
    label: str = "grey level",
    axes: Axes | None = None,
) -> Axes:
    """Draw a picture [y][x] or [y][x][3], from black to the type's largest value or, for floats, to the largest."""
    axes = _axes(axes)
    full = np.iinfo(pixels.dtype).max if pixels.dtype.kind in "ui" else float(pixels.max())
    image = axes.imshow(pixels, cmap="gray", vmin=0, vmax=full, extent=_extent(pixels, pixel_pitch_m))
    if pixels.ndim == _GREY_AXES:
        _bar(image, axes, label)
    axes.set_title(title)
    _label_plane(axes, pixel_pitch_m)
    return axes


def hologram(hologram: Hologram, *, pixel_pitch_m: float | None = None) -> Figure:
    """Draw the phase of a hologram beside what it shows. The light around the region of interest is darkened.

    The headline says what a photograph is expected to show. Of several wavelengths, subframes and distances the first
    one is drawn; a colour hologram shows its colours.
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
    phase(hologram.phases[0, 0], pixel_pitch_m=pixel_pitch_m, axes=left)
    shown = png.decode((hologram.colours_png or hologram.reconstructions_png[0])[0])
    picture(shown, pixel_pitch_m=pixel_pitch_m, axes=right)
    side = 1.0 if pixel_pitch_m is None else pixel_pitch_m * 1e3
    x, y, width, height = (each * side for each in hologram.region)
    left_side, right_side, bottom, top = _extent(shown, pixel_pitch_m)
    if (width, height) != (right_side - left_side, bottom - top):
        dark = {"facecolor": "black", "alpha": 1 - png.OUTSIDE_BRIGHTNESS, "linewidth": 0}
        for low, high, begin, end in (
            (0, right_side, 0, y),
            (0, right_side, y + height, bottom),
            (0, x, y, y + height),
            (x + width, right_side, y, y + height),
        ):
            right.fill_between([low, high], begin, end, **dark)
        right.add_patch(Rectangle((x, y), width, height, fill=False, edgecolor=png.FRAME_COLOUR))
        right.set_title("in the dark: light that the picture does not need", fontsize="small")
    figure.suptitle(repr(hologram).strip("<>"), fontsize="medium")
    return figure


def pictures(named: Mapping[str, npt.NDArray[Any]], *, pixel_pitch_m: float | None = None) -> Figure:
    """Draw pictures side by side under their names, all with the same scale of grey, and return the figure."""
    if not named:
        raise InvalidArgument("named", "has no pictures", "give at least one")
    figure, all_axes = plt.subplots(1, len(named), figsize=(4 * len(named), 3.2), squeeze=False, layout="constrained")
    for axes, (name, pixels) in zip(all_axes[0], named.items(), strict=True):
        picture(pixels, pixel_pitch_m=pixel_pitch_m, title=name, axes=axes)
    return figure


def transfer_function(kernel: LearnedKernel) -> Figure:
    """Draw what a learned kernel adds to free space: amplitude and phase of H / H_ideal over the frequencies."""
    ratio = np.fft.fftshift(kernel.transfer_function * np.conj(kernel.free_space()))
    reach = 0.5e-3 / kernel.pixel_pitch_m
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    # A series can be large in a corner of the band, where little light is. The scale is that of the rest.
    largest = float(np.quantile(np.abs(ratio), 0.99))
    amplitude = left.imshow(np.abs(ratio), cmap="viridis", vmin=0, vmax=largest, extent=(-reach, reach, reach, -reach))
    _bar(amplitude, left, "amplitude |H|")
    shown = right.imshow(
        np.angle(ratio), cmap="twilight", vmin=-np.pi, vmax=np.pi, extent=(-reach, reach, reach, -reach)
    )
    _bar(shown, right, "phase of H / free space [rad]").set_ticks([-np.pi, 0, np.pi], labels=["−π", "0", "π"])
    for axes in (left, right):
        axes.set_xlabel("fx [cycles/mm]")
        axes.set_ylabel("fy [cycles/mm]")
    figure.suptitle(kernel.version.name)
    return figure


def source(kernel: LearnedKernel) -> Figure:
    """Draw the light on the modulator that a kernel learned: amplitude and phase over the modulator."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
    extent = _extent(kernel.source, kernel.pixel_pitch_m)
    _bar(left.imshow(np.abs(kernel.source), cmap="viridis", vmin=0, extent=extent), left, "amplitude")
    phase_rad = np.angle(kernel.source)
    most_rad = float(np.abs(phase_rad).max())
    bent = right.imshow(phase_rad, cmap="RdBu", vmin=-most_rad, vmax=most_rad, extent=extent)
    _bar(bent, right, "phase [rad]")
    for axes in (left, right):
        _label_plane(axes, kernel.pixel_pitch_m)
    return figure


def loss(history: Sequence[float], *, axes: Axes | None = None, label: str = "") -> Axes:
    """Draw a loss over its steps, on a logarithmic axis."""
    axes = _axes(axes)
    axes.semilogy(range(1, len(history) + 1), list(history), label=label or None)
    axes.set_xlabel("step")
    axes.set_ylabel("loss (mean squared error)")
    if label:
        axes.legend()
    return axes


def _axes(axes: Axes | None) -> Axes:
    if axes is not None:
        return axes
    return plt.subplots(layout="constrained")[1]


def _extent(pixels: npt.NDArray[Any], pixel_pitch_m: float | None) -> tuple[float, float, float, float]:
    """Return the borders of a picture, in millimetres or in pixels. y goes down."""
    height_px, width_px = pixels.shape[:2]
    side = 1.0 if pixel_pitch_m is None else pixel_pitch_m * 1e3
    return (0.0, width_px * side, height_px * side, 0.0)


def _label_plane(axes: Axes, pixel_pitch_m: float | None) -> None:
    unit = "px" if pixel_pitch_m is None else "mm"
    axes.set_xlabel(f"x [{unit}]")
    axes.set_ylabel(f"y [{unit}]")


def _bar(image: Any, axes: Axes, label: str) -> Any:
    # A bar inside the axes' own frame is as high as the picture, whatever the picture's sides are.
    return axes.figure.colorbar(image, cax=axes.inset_axes((1.03, 0, 0.04, 1)), label=label)
