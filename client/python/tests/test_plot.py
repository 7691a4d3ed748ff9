"""Figures of holograms, pictures, kernels and losses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
import pytest
from conftest import target
from matplotlib.patches import Rectangle

import lightpath
import lightpath.local
from lightpath import v1

mpl.use("Agg")
import matplotlib.pyplot as plt

from lightpath import plot

if TYPE_CHECKING:
    from collections.abc import Iterator


OPTICS: dict[str, Any] = {"wavelength": "515nm", "pixel_pitch": "8um", "distance": "20mm"}


@pytest.fixture(autouse=True)
def close_figures() -> Iterator[None]:
    yield
    plt.close("all")


def learned() -> lightpath.LearnedKernel:
    """A kernel of free space, in which one frequency is turned by 1 rad."""
    version = v1.KernelVersion(name="displays/a/kernels/k/versions/1")
    source = np.full((48, 64), 0.5, np.complex64)
    blank = lightpath.LearnedKernel(version, np.ones((96, 128), np.complex64), source, 8e-6, 515e-9, 0.02, {}, {})
    transfer = blank.free_space().astype(np.complex64)
    transfer[0, 0] *= np.exp(1j)
    return lightpath.LearnedKernel(version, transfer, source, 8e-6, 515e-9, 0.02, {}, {})


def test_pictures_have_millimetres_and_a_bar_with_units() -> None:
    axes = plot.phase(np.linspace(-7, 7, 96 * 160).reshape(96, 160), pixel_pitch_m=8e-6)
    assert axes.get_xlabel() == "x [mm]"
    left, right, bottom, top = axes.images[0].get_extent()
    assert (left, top) == (0, 0)
    assert (right, bottom) == pytest.approx((1.28, 0.768))
    values = np.asarray(axes.images[0].get_array())
    assert 0 <= values.min() <= values.max() <= 2 * np.pi
    assert axes.child_axes[0].get_ylabel() == "phase [rad]"
    assert plot.picture(target(1)).get_xlabel() == "x [px]"
    figure = plot.pictures({"one": target(1), "two": target(2)})
    assert [axes.get_title() for axes in figure.axes[:2]] == ["one", "two"]
    with pytest.raises(lightpath.InvalidArgument):
        plot.pictures({})


def test_holograms_are_drawn_with_their_region_and_headline() -> None:
    hologram = lightpath.local.optimize(target(1), iterations=2, **OPTICS)
    figure = plot.hologram(hologram, pixel_pitch_m=8e-6)
    assert "dB at most" in figure.get_suptitle()
    shown = figure.axes[1]
    assert shown.get_title() == "in the dark: light that the picture does not need"
    (frame,) = (each for each in shown.patches if isinstance(each, Rectangle))
    assert (frame.get_x(), frame.get_width()) == pytest.approx((0.128, 1.024))
    dark = [each.get_datalim(shown.transData) for each in shown.collections]
    assert sum(each.width * each.height for each in dark) == pytest.approx(1.28 * 0.768 - 1.024 * 0.608)
    whole = lightpath.local.optimize(target(1), iterations=2, region=(0, 0, 160, 96), **OPTICS)
    assert not plot.hologram(whole).axes[1].collections


def test_transfer_functions_show_what_a_kernel_adds_to_free_space() -> None:
    figure = plot.transfer_function(learned())
    phase = np.array(figure.axes[1].images[0].get_array())
    assert phase[48, 64] == pytest.approx(1, abs=1e-5)
    phase[48, 64] = 0
    assert np.abs(phase).max() < 1e-5
    assert figure.axes[0].get_xlabel() == "fx [cycles/mm]"
    assert figure.axes[0].images[0].get_extent()[1] == pytest.approx(62.5)
    amplitude = np.asarray(plot.source(learned()).axes[0].images[0].get_array())
    assert np.all(amplitude == 0.5)


def test_losses_have_a_logarithmic_axis() -> None:
    axes = plot.loss([1.0, 0.1, 0.01], label="display")
    assert axes.get_yscale() == "log"
    assert np.asarray(axes.lines[0].get_xdata()).tolist() == [1, 2, 3]


def test_learned_kernels_show_themselves() -> None:
    assert learned()._repr_png_().startswith(b"\x89PNG")
    assert "515 nm, 20 mm" in learned()._repr_html_()
