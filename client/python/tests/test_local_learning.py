"""Displays that are learned in this process, and their files."""

from __future__ import annotations

import pickle
import subprocess
import sys
import zipfile
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import DISTANCE, program, target

import lightpath
from lightpath import local

if TYPE_CHECKING:
    from pathlib import Path

    import numpy.typing as npt
    from conftest import Server


OPTICS: dict[str, Any] = {"wavelength": "515nm", "pixel_pitch": "8um", "distance": DISTANCE}
PAIRS = 8


@pytest.fixture(scope="module")
def display() -> local.SimulatedDisplay:
    return local.SimulatedDisplay("160x96", simulated=1, **OPTICS)


@pytest.fixture(scope="module")
def pairs(display: local.SimulatedDisplay) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    phases = np.stack([local.optimize(target(i), iterations=30, **OPTICS).levels for i in range(PAIRS)])
    return phases, np.stack([display.photograph(phase, seed=i) for i, phase in enumerate(phases)])


@pytest.fixture(scope="module")
def learned(pairs: tuple[npt.NDArray[Any], npt.NDArray[Any]]) -> local.DisplayModel:
    return local.learn(*pairs, degree=5, **OPTICS)


def psnr_db(photo: npt.NDArray[Any], wanted: npt.NDArray[Any]) -> float:
    """PSNR at the best gain and offset in the middle of the picture, in linear light."""
    seen, wanted = photo[10:86, 16:144] / 255, wanted[10:86, 16:144]
    columns = np.stack([seen.ravel(), np.ones(seen.size)], axis=1)
    rest = columns @ np.linalg.lstsq(columns, wanted.ravel(), rcond=None)[0] - wanted.ravel()
    return float(-10 * np.log10(np.mean(rest**2)))


def linear(picture: npt.NDArray[np.uint8]) -> npt.NDArray[Any]:
    value = picture / 255
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def test_holograms_through_a_learned_display_look_better_on_it(
    display: local.SimulatedDisplay, learned: local.DisplayModel
) -> None:
    record = learned.record
    assert record is not None
    assert sorted([*record.training, *record.left_out, *record.validation]) == list(range(PAIRS))
    assert record.validation_loss is not None
    assert record.ideal_validation_loss is not None
    assert record.validation_loss < 0.1 * record.ideal_validation_loss
    unseen = target(50)
    ideal = local.optimize(unseen, iterations=60, area="display", **OPTICS)
    better = local.optimize(unseen, iterations=60, area="display", kernel=learned)
    photos = [display.photograph(each.levels, seed=99) for each in (ideal, better)]
    before_db, after_db = (psnr_db(photo.pixels, linear(unseen)) for photo in photos)
    assert after_db > before_db + 3
    assert "KERNEL" not in str(learned.plan)


def test_learning_is_reproducible_and_can_start_from_a_model(
    pairs: tuple[npt.NDArray[Any], npt.NDArray[Any]], learned: local.DisplayModel
) -> None:
    phases, captures = pairs[0][:4], pairs[1][:4]
    steps: list[int] = []

    def learn(**options: Any) -> local.DisplayModel:
        steps.clear()
        return local.learn(
            phases, captures, degree=5, progress=lambda step, *_: steps.append(step), **options, **OPTICS
        )

    alone, again = learn(epochs=1, refinement_evaluations=2), learn(epochs=1, refinement_evaluations=2)
    np.testing.assert_array_equal(alone.transfer_function, again.transfer_function)
    assert alone.record == again.record
    assert len(steps) > 3
    assert steps == sorted(steps)
    started = learn(epochs=1, refinement_evaluations=2, start=learned)
    assert np.mean(started.losses(*pairs)) < np.mean(alone.losses(*pairs))


def test_files_keep_the_display(learned: local.DisplayModel, tmp_path: Path) -> None:
    phase = np.random.default_rng(1).uniform(0, 6, (96, 160)).astype(np.float32)
    light = learned.simulate(phase)
    for form, error in [("safetensors", 0.0), ("npz", 0.0), ("compact", 1e-5)]:
        lost = learned.save(tmp_path / form, form)  # type: ignore[arg-type]
        back = local.DisplayModel.load(tmp_path / form)
        assert back.kind == learned.kind
        assert (back.shape, back.wavelength_m, back.distance_m) == ((96, 160), 515e-9, 0.02)
        assert np.linalg.norm(back.simulate(phase) - light) <= error * np.linalg.norm(light)
        assert not lost or form == "compact"
    with pytest.raises(lightpath.InvalidArgument, match=r"format is .hdf5.: choose one of safetensors"):
        learned.save(tmp_path / "kernel", "hdf5")  # type: ignore[arg-type]


def test_a_server_takes_the_file_and_uses_the_same_display(
    server: Server, lab: lightpath.Lab, learned: local.DisplayModel, tmp_path: Path
) -> None:
    lab.create_display("taken", resolution="160x96", pixel_pitch="8um", wavelength="515nm")
    learned.save(tmp_path / "kernel.safetensors")
    command = [program("lightpath"), "--server", server.url, "kernel", "import", str(tmp_path / "kernel.safetensors")]
    subprocess.run([*command, "--display", "taken", "--distance", DISTANCE], check=True, capture_output=True)
    there = lab.display("taken").optimize(target(60), distance=DISTANCE, iterations=10, kernel=1)
    here = local.optimize(target(60), iterations=10, kernel=learned)
    np.testing.assert_array_equal(here.phase, there.phase)


def test_a_kernel_of_the_papers_code_is_read_without_calls(learned: local.DisplayModel, tmp_path: Path) -> None:
    """`kernel.pt` holds amplitude and phase of the inner half of H, [1][2][rows][columns]."""
    lost = learned.save(tmp_path / "kernel.pt", "pt")
    assert any("source" in each for each in lost)
    with pytest.raises(local.EngineRefused, match="give resolution, wavelength, pixel_pitch and distance"):
        local.DisplayModel.load(tmp_path / "kernel.pt")
    paper = local.DisplayModel.load(tmp_path / "kernel.pt", resolution="160x96", **OPTICS)
    assert paper.kind == "paper"
    assert paper.note is not None
    inner = np.fft.fftshift(learned.transfer_function)[48:144, 80:240]
    held = np.fft.fftshift(paper.transfer_function)
    assert np.linalg.norm(held[48:144, 80:240] - inner) < 1e-6 * np.linalg.norm(inner)
    assert np.abs(held[:48]).max() == 0
    field = np.exp(1j * np.random.default_rng(1).uniform(0, 6, (96, 160)))
    expected = np.fft.ifft2(paper.transfer_function * np.fft.fft2(field, s=(192, 320)))[:96, :160]
    image = local.propagate(field, kernel=paper)
    assert np.linalg.norm(image.field - expected) < 2e-6 * np.linalg.norm(expected)
    assert "KERNEL_WRAP_AROUND" in {each.code for each in image.plan.warnings}


class Harm:
    """Calls a function when it is unpickled by `pickle.load`."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return (open, (str(self.path), "w"))


def test_a_malicious_kernel_file_runs_nothing(learned: local.DisplayModel, tmp_path: Path) -> None:
    learned.save(tmp_path / "kernel.pt", "pt")
    with zipfile.ZipFile(tmp_path / "kernel.pt") as good, zipfile.ZipFile(tmp_path / "bad.pt", "w") as bad:
        for name in good.namelist():
            content = pickle.dumps(Harm(tmp_path / "harm")) if name.endswith("data.pkl") else good.read(name)
            bad.writestr(name, content)
    with pytest.raises(local.EngineRefused) as refused:
        local.DisplayModel.load(tmp_path / "bad.pt", resolution="160x96", **OPTICS)
    assert refused.value.reason == "INVALID_KERNEL"
    assert not (tmp_path / "harm").exists()


def test_arrays_of_pairs_are_checked(pairs: tuple[npt.NDArray[Any], npt.NDArray[Any]]) -> None:
    phases, captures = pairs
    noise = np.random.default_rng(1).integers(0, 200, captures.shape, np.uint8)
    wrong: list[tuple[Any, Any, dict[str, Any], str]] = [
        (phases, captures[:3], {}, r"captures have the shape \(3, 96, 160\): give \(8, 96, 160\)"),
        (phases[0], captures, {}, r"phases has the shape \(96, 160\): give \[count\]\[rows\]\[columns\]"),
        (phases.astype(np.uint16) * 2, captures, {}, "phases has grey levels from 0 to .*: give bit_depth, or radians"),
        (phases, captures.astype(float), {}, "captures has values from .* but light is 0 to 1"),
        (phases, captures, {"validation": 1.0}, "validation is 1.0"),
        (phases, captures, {"degree": 20}, "degree is 20, but must be 1 to 12"),
        (phases, np.full_like(captures, 255), {}, "saturated"),
        (phases, noise, {}, "do not match their holograms"),
    ]
    for first, second, options, text in wrong:
        with pytest.raises(ValueError, match=text):
            local.learn(first, second, **options, **OPTICS)


def test_without_the_engine_the_error_says_how_to_install_it() -> None:
    program_text = "import sys; sys.modules['lightpath._engine'] = None; import lightpath; import lightpath.local"
    done = subprocess.run([sys.executable, "-c", program_text], check=False, capture_output=True, text=True)
    assert done.returncode == 1
    assert "install it again without LIGHTPATH_ENGINE=none" in done.stderr
