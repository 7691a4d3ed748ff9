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
def test_the_same_request_gives_the_same_bytes_as_a_server(lab: lightpath.Lab, options: Any) -> None:
    display = create_bench(lab)
    there = display.optimize(target(3), distance=DISTANCE, iterations=12, kernel="ideal", **options)
    here = local.optimize(target(3), iterations=12, **options, **OPTICS)
    np.testing.assert_array_equal(here.phase, there.phase)
    assert here.levels_png == there.levels_png[0][0]
    assert here.reconstruction_png == there.reconstructions_png[0][0]
    assert here.loss == there.loss
    judgements = there.result.wavelengths[0].planes[0].judgements
    independent = [each for each in judgements if each.model == lightpath.v1.Judgement.MODEL_INDEPENDENT]
    assert here.quality.pixel.psnr_db == there.judgement("optimized", "pixel").psnr_db.value
    assert here.quantized_quality.supersampled.psnr_db == there.judgement("displayed", "supersampled").psnr_db.value
    assert here.second_opinion is not None
    assert [here.second_opinion.independent_psnr_db] == [each.psnr_db.value for each in independent]


def test_a_hologram_shows_its_target_in_plain_numpy() -> None:
    wanted = np.zeros((96, 160), np.float32)
    wanted[20:70, 40:120] = np.linspace(0.2, 1, 80, dtype=np.float32)
    hologram = local.optimize(wanted, target_encoding="linear", iterations=60, detector="point", **OPTICS)
    transfer = local.transfer_function("160x96", wavelength="515nm", pixel_pitch="8um", distance=DISTANCE)
    shown = np.fft.ifft2(transfer * np.fft.fft2(np.exp(1j * hologram.phase), s=transfer.shape))[:96, :160]
    light = np.abs(shown[10:86, 16:144]) ** 2
    inside = wanted[10:86, 16:144]
    gain = np.sum(light * inside) / np.sum(light**2)
    psnr_db = -10 * np.log10(np.mean((gain * light - inside) ** 2))
    assert psnr_db > 25
    assert abs(psnr_db - hologram.quality.point.psnr_db) < 0.05
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
        linear = np.clip(hologram.reconstruction, 0, 1)
        srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        assert np.abs(np.asarray(image) - 255 * srgb).max() < 0.51
    assert "<img" in hologram._repr_html_()
    assert Image.open(io.BytesIO(hologram._repr_png_())).format == "PNG"
    with pytest.raises(lightpath.InvalidArgument, match=r"end it with \.png"):
        hologram.save("hologram.bmp")


def test_levels_simulate_as_the_reconstruction_says() -> None:
    hologram = local.optimize(target(2), iterations=5, **OPTICS)
    light = hologram.kernel.simulate(hologram.levels)
    np.testing.assert_allclose(hologram.intensity_scale * light, hologram.reconstruction, rtol=1e-4, atol=1e-5)


def test_any_phase_can_be_judged() -> None:
    hologram = local.optimize(target(2), iterations=5, **OPTICS)
    quality, opinion = hologram.kernel.quality(hologram.phase, target(2))
    assert quality == hologram.quality
    assert opinion is not None
    assert abs(opinion.engine_psnr_db - opinion.independent_psnr_db) < 0.5
    quantized, _ = hologram.kernel.quality(hologram.levels, target(2))
    assert abs(quantized.pixel.psnr_db - hologram.quantized_quality.pixel.psnr_db) < 1e-3


def test_pictures_are_fitted_and_regions_count(tmp_path: Path) -> None:
    Image.fromarray(target(4)).save(tmp_path / "photo.png")
    wide = local.optimize(tmp_path / "photo.png", resolution="96x96", fit="cover", iterations=2, **OPTICS)
    assert wide.phase.shape == (96, 96)
    with pytest.raises(local.EngineRefused, match=r"region_of_interest\.width_px is 200"):
        local.optimize(target(4), region=(0, 0, 200, 10), **OPTICS)


def test_only_weighted_pixels_count() -> None:
    wanted, weight = target(4) / 255, np.zeros((96, 160))
    weight[30:60, 30:60] = 1
    hologram = local.optimize(wanted, target_encoding="linear", weight=weight, iterations=40, **OPTICS)
    errors = (hologram.reconstruction - wanted) ** 2
    assert np.mean(errors[30:60, 30:60]) < 0.1 * np.mean(errors[:, 80:])


def test_a_given_phase_starts_the_search() -> None:
    first = local.optimize(target(5), iterations=20, **OPTICS)
    again = local.optimize(target(5), iterations=1, initial_phase=first.phase, **OPTICS)
    # One iteration evaluates the given phase. In the first run the last of 20 iterations may have been worse.
    assert again.loss <= first.loss * (1 + 1e-4)


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
        ({"initial_phase": np.zeros((3, 4))}, "initial_phase is 4×3 px, but must be 160×96 px"),
        ({"iterations": 0}, "iterations is 0, but must be at least 1"),
        ({"bit_depth": 40}, "bit_depth"),
        ({"fit": "crop"}, "fit is .crop.: choose one of contain"),
        ({"kernel": local.DisplayModel.ideal("160x96", wavelength=5e-7, pixel_pitch=8e-6, distance=0.02)}, "leave out"),
    ]
    for options, text in wrong:
        with pytest.raises(ValueError, match=text):
            local.optimize(target(1), **options, **OPTICS)
    with pytest.raises(TypeError, match="unknown option iteration;"):
        local.optimize(target(1), iteration=3, **OPTICS)  # type: ignore[call-arg]
    with pytest.raises(lightpath.InvalidArgument, match="divide by 255"):
        local.optimize(target(1).astype(np.float32), **OPTICS)
    with pytest.raises(local.EngineRefused, match="target_intensity is empty"):
        local.optimize(np.zeros((96, 160), np.uint8), **OPTICS)
    with pytest.raises(lightpath.InvalidArgument, match="resolution is not given"):
        local.optimize("photo.png", **OPTICS)
    with pytest.raises(lightpath.InvalidArgument, match="are not all given"):
        local.optimize(target(1), wavelength="515nm")
