"""Holograms in this process: the server's bytes, an independent simulation, gradients, interruption."""

from __future__ import annotations

import io
import os
import signal
import threading
import time
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import DISTANCE, create_bench, target
from PIL import Image

import lightpath
from lightpath import local

if TYPE_CHECKING:
    from pathlib import Path

    import numpy.typing as npt


OPTICS: dict[str, Any] = {"wavelength": "515nm", "pixel_pitch": "8um", "distance": DISTANCE}


@pytest.mark.parametrize("options", [{}, {"method": "adam", "seed": 7}, {"loss": "amplitude", "detector": "point"}])
def test_the_same_request_gives_the_same_hologram_as_a_server(lab: lightpath.Lab, options: Any) -> None:
    display = create_bench(lab)
    there = display.optimize(target(3), distance=DISTANCE, iterations=12, kernel="ideal", **options)
    here = local.optimize(target(3), iterations=12, **options, **OPTICS)
    assert_same(here, there)
    np.testing.assert_array_equal(here.phase, there.phase)
    assert here.quality == there.quality
    assert here.second_opinion == there.second_opinion
    # A server's light comes from a picture of 8 bits, whose steps are larger where it is bright.
    assert np.abs(np.clip(here.light, 0, 1) - there.light).max() < 0.005


def test_less_judging_leaves_the_hologram_as_it_is(lab: lightpath.Lab) -> None:
    display = create_bench(lab)
    full = local.optimize(target(3), iterations=3, **OPTICS)
    for judge in ("quick", "none"):
        here = local.optimize(target(3), iterations=3, judge=judge, **OPTICS)
        there = display.optimize(target(3), distance=DISTANCE, iterations=3, kernel="ideal", judge=judge)
        for hologram in (here, there):
            np.testing.assert_array_equal(hologram.phase, full.phase)
            assert hologram.second_opinion is None
            if judge == "quick":
                assert hologram.quality == full.quality
                continue
            assert hologram.pictures[0][0].quality is None
            assert "not judged (judge none)" in repr(hologram)
            assert "not judged (judge none)" in hologram._repr_html_()
            with pytest.raises(lightpath.InvalidArgument, match=r"quality is unknown: not judged .judge none."):
                _ = hologram.quality
    with pytest.raises(local.EngineRefused, match="judge is none, but must be quick or full"):
        local.optimize(target(3), iterations=0, initial_phase=full.phase, judge="none", **OPTICS)


def test_colours_planes_and_subframes_are_those_of_a_server(lab: lightpath.Lab) -> None:
    wavelengths, distances = ["450nm", "638nm", "520nm"], ["10mm", "12mm"]
    display = lab.create_display("colours", resolution="64x48", pixel_pitch="8um", wavelength=wavelengths)
    random = np.random.default_rng(1)
    colours = random.integers(0, 256, (48, 64, 3), np.uint8)
    options: dict[str, Any] = {
        "distance": distances,
        "wavelength": wavelengths,
        "depth_map": random.integers(0, 256, (48, 64), np.uint8),
        "weight_mask": random.integers(0, 256, (48, 64), np.uint8),
        "subframes": 2,
        "iterations": 3,
        "initial_phase": lightpath.RandomPhase(range_rad=3.0),
    }
    here = local.optimize(colours, pixel_pitch="8um", **options)
    there = display.optimize(colours, kernel="ideal", **options)
    assert_same(here, there)
    assert here.phase.shape == (3, 2, 48, 64)
    # Given phases start each wavelength and subframe.
    options.update(iterations=1, initial_phase=here.phase)
    assert_same(local.optimize(colours, pixel_pitch="8um", **options), display.optimize(colours, **options))
    pictures = [target(1)[:48, :64], target(2)[:48, :64]]
    stack = local.optimize(pictures, wavelength="520nm", pixel_pitch="8um", distance=distances, iterations=3)
    assert_same(stack, display.optimize(pictures, wavelength="520nm", distance=distances, iterations=3))
    assert stack.light.shape == (2, 48, 64)
    models = [
        lightpath.local.DisplayModel.ideal("64x48", wavelength="520nm", pixel_pitch="8um", distance=z)
        for z in distances
    ]
    assert local.optimize(pictures, kernel=models, iterations=3).levels_png == stack.levels_png
    with pytest.raises(lightpath.InvalidArgument, match="kernel has 2 models for 2 wavelengths and 2 distances"):
        local.optimize(pictures, kernel=[models[0], blue(distances[1])])


def blue(distance: str) -> local.DisplayModel:
    return local.DisplayModel.ideal("64x48", wavelength="450nm", pixel_pitch="8um", distance=distance)


def assert_same(here: lightpath.Hologram, there: lightpath.Hologram) -> None:
    """Bytes and figures are the same. A server rounds none of them."""
    np.testing.assert_array_equal(here.phases, there.phases)
    assert here.levels_png == there.levels_png
    assert here.reconstructions_png == there.reconstructions_png
    assert here.colours_png == there.colours_png
    assert here.losses == there.losses
    assert (here.region, here.distances_m, here.intensity_scales) == (
        there.region,
        there.distances_m,
        there.intensity_scales,
    )
    assert here.pictures == there.pictures


def test_complex_targets_get_amplitude_and_phase_by_double_phase_alone(lab: lightpath.Lab) -> None:
    y, x = np.mgrid[:96, :160]
    amplitude = np.exp(-(((x - 80) / 40) ** 2) - ((y - 48) / 25) ** 2)
    wanted = amplitude * np.exp(1.5j * np.sin(x / 9) + 1j * np.cos(y / 7))
    hologram = local.optimize(wanted, method="double-phase", **OPTICS)
    # The encoding has its error in the outer half of the band, which a filter takes away.
    spectrum = np.fft.fft2(hologram.kernel.field(hologram))
    inner = (np.abs(np.fft.fftfreq(96))[:, np.newaxis] < 0.25) & (np.abs(np.fft.fftfreq(160)) < 0.25)
    shown = np.fft.ifft2(spectrum * inner)
    inside = (slice(20, 76), slice(40, 120))

    def likeness(field: npt.NDArray[Any]) -> float:
        one, other = shown[inside].ravel(), field[inside].ravel()
        return float(abs(np.vdot(one, other)) / np.linalg.norm(one) / np.linalg.norm(other))

    assert likeness(wanted) > 0.95
    assert likeness(amplitude) < 0.7
    with pytest.warns(UserWarning, match="double phase needs optics that filter"):
        there = create_bench(lab).optimize(wanted, method="double-phase", distance=DISTANCE)
    # The target of a server has 16 bits. Where it is dark, little decides on the phase.
    assert np.abs(np.exp(1j * there.phase) - np.exp(1j * hologram.phase))[inside].max() < 0.01
    with pytest.raises(lightpath.InvalidArgument, match="target is a complex field, but lbfgs compares light alone"):
        local.optimize(wanted, **OPTICS)


def test_a_hologram_shows_its_target_in_plain_numpy() -> None:
    wanted = np.zeros((96, 160), np.float32)
    wanted[20:70, 40:120] = np.linspace(0.2, 1, 80, dtype=np.float32)
    hologram = local.optimize(wanted, target_encoding="linear", iterations=60, detector="point", fit="exact", **OPTICS)
    transfer = local.transfer_function("160x96", wavelength="515nm", pixel_pitch="8um", distance=DISTANCE)
    shown = np.fft.ifft2(transfer * np.fft.fft2(np.exp(1j * hologram.phase), s=transfer.shape))[:96, :160]
    light = np.abs(shown[10:86, 16:144]) ** 2
    inside = wanted[10:86, 16:144]
    gain = np.sum(light * inside) / np.sum(light**2)
    psnr_db = -10 * np.log10(np.mean((gain * light - inside) ** 2))
    assert psnr_db > 25
    assert abs(psnr_db - hologram.optimized_quality.point.psnr_db) < 0.05
    assert len(hologram.loss_history) == 60
    assert hologram.loss_history[-1] < 0.1 * hologram.loss_history[0]
    assert hologram.phase.dtype == np.float32
    assert 0 <= hologram.phase.min() < hologram.phase.max() < 2 * np.pi


def test_files_have_the_grey_levels_of_the_phase(tmp_path: Path) -> None:
    for bits in (8, 10):
        hologram = local.optimize(target(1), iterations=3, bit_depth=bits, **OPTICS)
        expected = np.rint(hologram.phase.astype(np.float64) / (2 * np.pi) * 2**bits) % 2**bits
        hologram.save(tmp_path / "hologram.png")
        with Image.open(tmp_path / "hologram.png") as image:
            np.testing.assert_array_equal(np.asarray(image), expected)
        np.testing.assert_array_equal(hologram.levels, expected)
    hologram.save(tmp_path / "hologram.npy")
    np.testing.assert_array_equal(np.load(tmp_path / "hologram.npy"), hologram.phase)
    hologram.save_reconstruction(tmp_path / "shown.png")
    with Image.open(tmp_path / "shown.png") as image:
        np.testing.assert_array_equal(np.asarray(image), hologram.reconstruction)
        linear = np.clip(hologram.light, 0, 1)
        srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        assert np.abs(np.asarray(image) - 255 * srgb).max() < 0.51
    assert "<img" in hologram._repr_html_()
    assert Image.open(io.BytesIO(hologram._repr_png_())).format == "PNG"
    with pytest.raises(lightpath.InvalidArgument, match=r"end it with \.png"):
        hologram.save("hologram.bmp")


def test_levels_simulate_as_the_reconstruction_says() -> None:
    hologram = local.optimize(target(2), iterations=5, **OPTICS)
    light = hologram.kernel.simulate(hologram.levels)
    np.testing.assert_allclose(hologram.intensity_scale * light, hologram.light, rtol=1e-4, atol=1e-5)


def test_any_phase_can_be_judged(tmp_path: Path) -> None:
    hologram = local.optimize(target(2), iterations=5, **OPTICS)
    quality, opinion = hologram.kernel.quality(hologram.phase, target(2))
    assert quality == hologram.optimized_quality
    assert opinion is not None
    assert abs(opinion.engine_psnr_db - opinion.independent_psnr_db) < 0.5
    hologram.save(tmp_path / "foreign.png")
    hologram.save(tmp_path / "foreign.npy")
    kinds: list[Any] = [hologram, hologram.levels, hologram.levels.astype(np.int64), tmp_path / "foreign.png"]
    for kind in kinds:
        displayed, _ = hologram.kernel.quality(kind, target(2))
        assert abs(displayed.pixel.psnr_db - hologram.quality.pixel.psnr_db) < 1e-3
    assert hologram.kernel.quality(tmp_path / "foreign.npy", target(2))[0] == quality
    light = hologram.kernel.simulate(np.stack([hologram.phase, np.zeros_like(hologram.phase)]))
    alone = [hologram.kernel.simulate(each) for each in (hologram.phase, np.zeros_like(hologram.phase))]
    np.testing.assert_allclose(light, np.mean(alone, axis=0), rtol=1e-5, atol=1e-6)
    with pytest.raises(lightpath.InvalidArgument, match=r"phase has grey levels from 0 to 300.*give bit_depth"):
        hologram.kernel.simulate(np.arange(301).reshape(7, 43))


def test_pictures_are_fitted_and_regions_count(tmp_path: Path) -> None:
    Image.fromarray(target(4)).save(tmp_path / "photo.png")
    wide = local.optimize(tmp_path / "photo.png", resolution="96x96", fit="cover", iterations=2, **OPTICS)
    assert wide.phase.shape == (96, 96)
    with pytest.raises(local.EngineRefused, match=r"region\.width_px is 200"):
        local.optimize(target(4), region=(0, 0, 200, 10), **OPTICS)


def test_only_weighted_pixels_count() -> None:
    wanted, weight = target(4) / 255, np.zeros((96, 160))
    weight[30:60, 30:60] = 1
    hologram = local.optimize(
        wanted, target_encoding="linear", weight_mask=weight, iterations=40, area="display", **OPTICS
    )
    errors = (hologram.light - wanted) ** 2
    assert np.mean(errors[30:60, 30:60]) < 0.1 * np.mean(errors[:, 80:])


def test_a_given_phase_starts_the_search() -> None:
    first = local.optimize(target(5), iterations=20, **OPTICS)
    again = local.optimize(target(5), iterations=1, initial_phase=first.phase, **OPTICS)
    # One iteration evaluates the given phase. In the first run the last of 20 iterations may have been worse.
    assert again.loss <= first.loss * (1 + 1e-4)
    # None judges it as it is.
    judged = local.optimize(target(5), iterations=0, initial_phase=first.phase, **OPTICS)
    assert judged.quality == first.quality
    assert abs(judged.loss - again.loss) < 1e-3 * again.loss


def test_progress_is_told_and_its_exceptions_stop_the_work() -> None:
    told: list[tuple[int, int, float]] = []
    hologram = local.optimize(target(1), iterations=4, progress=lambda *state: told.append(state), **OPTICS)
    assert [step for step, _, _ in told] == [1, 2, 3, 4]
    assert tuple(loss for _, _, loss in told) == hologram.loss_history

    def stop(step: int, _total: int, _loss: float) -> None:
        if step == 2:
            raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        local.optimize(target(1), iterations=10_000, progress=stop, **OPTICS)


def test_control_c_stops_an_optimization_in_its_middle() -> None:
    # A program that was started in the background may ignore Ctrl-C.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    large = np.kron(target(6), np.ones((10, 10), np.uint8))
    threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        local.optimize(large, iterations=10_000, **OPTICS)
    assert time.monotonic() - start < 10
    # The engine works afterwards.
    assert local.optimize(target(1), iterations=2, **OPTICS).loss > 0


def test_the_gradient_of_the_loss_agrees_with_differences() -> None:
    random = np.random.default_rng(1)
    phase, direction = random.uniform(0, 6, (96, 160)), random.standard_normal((96, 160))
    for detector in ("point", "pixel", "supersampled"):
        loss = local.HologramLoss(target(7), detector=detector, **OPTICS)
        value, gradient = loss.gradient(phase)
        assert loss(phase) == value
        expected = float(np.sum(gradient.astype(np.float64) * direction))
        # The loss has a relative error of some 1e-7 from single precision. A step of 1e-3 rad along a direction of
        # 15360 pixels changes it by some 1e-4 of itself, so the quotient is off by some 1e-3; the third derivative
        # adds less.
        step = 1e-3
        found = (loss(phase + step * direction) - loss(phase - step * direction)) / (2 * step)
        assert abs(found - expected) < 1e-2 * float(np.linalg.norm(gradient)), detector


def test_the_loss_is_that_of_the_optimization() -> None:
    loss = local.HologramLoss(target(8), **OPTICS)
    hologram = local.optimize(target(8), iterations=30, **OPTICS)
    # L-BFGS keeps the best phase, which some iteration evaluated, before it is wrapped.
    assert abs(loss(hologram.phase) - min(hologram.loss_history)) < 1e-4 * loss(hologram.phase)


def descend(loss: local.HologramLoss, phase: npt.NDArray[Any], rate: float, steps: int) -> npt.NDArray[Any]:
    for _ in range(steps):
        _, gradient = loss.gradient(phase)
        phase = phase - rate * gradient / np.sqrt(np.mean(gradient**2))
    return phase


def test_ones_own_descent_lowers_the_loss() -> None:
    loss = local.HologramLoss(target(9), **OPTICS)
    start = np.random.default_rng(2).uniform(0, 1, (96, 160))
    assert loss(descend(loss, start, 0.05, 30)) < 0.3 * loss(start)


def test_wrong_options_are_refused() -> None:
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"method": "sgd"}, "method is .sgd.: choose one of lbfgs, adam"),
        ({"detector": "eye"}, "detector is .eye.: choose one of pixel"),
        ({"initial_phase": "flat"}, "initial_phase is .flat.: choose one of recommended"),
        ({"initial_phase": np.zeros((3, 4))}, "initial_phase"),
        ({"iterations": 0}, "iterations is 0, but must be at least 1"),
        ({"iterations": "9"}, "iterations is '9' .str.: give a whole number"),
        ({"distance": {"z": 1}}, "distance is a dict: give one number in metres, or text with a unit"),
        ({"seed": True}, "seed is True .bool.: give a whole number"),
        ({"region": 5}, "region is 5: give x, y, width and height"),
        ({"subframes": 0}, "subframes"),
        ({"depth_map": np.ones((96, 160))}, "depth_map is given for one distance"),
        ({"distance": ["20mm", "2cm"]}, "distance has 20 mm twice"),
        ({"bit_depth": 40}, "bit_depth"),
        ({"fit": "crop"}, "fit is .crop.: choose one of contain"),
        ({"judge": "some"}, "judge is .some.: choose one of full, quick, none"),
        ({"kernel": local.DisplayModel.ideal("160x96", wavelength=5e-7, pixel_pitch=8e-6, distance=0.02)}, "leave out"),
    ]
    for options, text in wrong:
        with pytest.raises(ValueError, match=text):
            local.optimize(target(1), **{**OPTICS, **options})
    with pytest.raises(TypeError, match="unknown option iteration;"):
        local.optimize(target(1), iteration=3, **OPTICS)  # type: ignore[call-arg]
    with pytest.raises(lightpath.InvalidArgument, match="divide by 255"):
        local.optimize(target(1).astype(np.float32), **OPTICS)
    with pytest.raises(local.EngineRefused, match="target is empty"):
        local.optimize(np.zeros((96, 160), np.uint8), **OPTICS)
    with pytest.raises(lightpath.InvalidArgument, match="resolution is not given"):
        local.optimize("photo.png", **OPTICS)
    with pytest.raises(lightpath.InvalidArgument, match="are not all given"):
        local.optimize(target(1), wavelength="515nm")
