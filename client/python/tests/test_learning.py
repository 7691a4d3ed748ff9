"""The whole loop on a simulated display, and what the learned kernel gives to other packages."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import DISTANCE, Server, create_bench, target

import lightpath
from lightpath import v1
from lightpath.sync.kernels import fetch_file

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import numpy.typing as npt


@pytest.fixture(scope="module")
def version(server: Server) -> Iterator[lightpath.KernelVersion]:
    """A kernel learned from eight photographs, and promoted."""
    with lightpath.connect(server.url) as lab:
        yield learn(create_bench(lab))


def learn(bench: lightpath.Display) -> lightpath.KernelVersion:
    dataset = bench.create_dataset("bench-1", distance=DISTANCE)
    holograms = list(bench.optimize_all(map(target, range(8)), distance=DISTANCE, iterations=30))
    pairs = [(hologram, bench.photograph(hologram)) for hologram in holograms]
    dataset.add(*pairs[0])
    # The same pair again changes nothing.
    dataset.add_all(pairs)
    assert len(dataset.pairs()) == dataset.message.pair_count == 8
    assert all(pair.findings for pair in dataset.pairs(with_findings=True))
    with pytest.raises(lightpath.InvalidArgument, match="pair_ids"):
        dataset.add_all(pairs, pair_ids=["one"])
    prepared = dataset.finalize(test_fraction=0.25)
    counts = prepared.split_counts
    assert (counts.train + counts.validation, counts.test) == (6, 2)
    version = dataset.learn(epochs=4, refinement_evaluations=10, degree=5)
    version.promote(reason="test")
    return version


def test_learned_holograms_look_better(
    lab: lightpath.Lab, bench: lightpath.Display, version: lightpath.KernelVersion
) -> None:
    wanted = target(100)
    scores = {}
    for kernel in ("ideal", "active"):
        hologram = bench.optimize(wanted, distance=DISTANCE, kernel=kernel, iterations=80)
        scores[kernel] = lab.score(bench.photograph(hologram, seed=3), wanted)
    assert scores["active"].psnr_db > scores["ideal"].psnr_db + 5
    assert scores["active"].aligned.shape == (96, 160)
    assert version.metrics.test_loss < version.metrics.ideal_test_loss / 10
    assert version.model == "display"
    assert len(version.learning().loss_history) > 4


def test_kernels_have_versions_moves_and_evaluations(
    lab: lightpath.Lab, bench: lightpath.Display, version: lightpath.KernelVersion, tmp_path: Path
) -> None:
    kernel = bench.kernel(distance=DISTANCE)
    assert kernel.active_version == kernel.version(1).number == 1
    assert [each.name for each in kernel.versions()] == [version.name]
    assert [move.reason for move in kernel.moves()] == ["test"]
    assert kernel.name in {each.name for each in lab.kernels()}
    dataset = lab.dataset("bench-1")
    assert dataset.evaluate().loss() < dataset.evaluate("ideal").loss() / 10
    losses = dataset.evaluate(1).losses
    assert losses.keys() == {pair.id for pair in dataset.pairs()}
    kernel.set_alias("best", 1)
    assert dataset.evaluate("best").losses == dataset.evaluate(version).losses == losses
    with pytest.raises(lightpath.InvalidRequest, match=r"must be an alias of .*: best"):
        dataset.evaluate("worst")
    with pytest.raises(lightpath.NotFound, match="versions/7"):
        dataset.learn(start_version=7)
    found = kernel.save(tmp_path / "kernel.lpk", format="compact")
    assert found.version == 1
    assert (tmp_path / "kernel.lpk").stat().st_size < 10_000
    with pytest.raises(lightpath.PreconditionFailed, match="no earlier active version") as caught:
        kernel.rollback()
    assert caught.value.reason == "NO_EARLIER_VERSION"
    states = kernel.watch()
    assert next(states).active_version == 1
    again = bench.import_kernel(tmp_path / "kernel.lpk", distance=DISTANCE)
    assert again.promote(force=True, reason="test").active_version == 2
    assert any(state.active_version == 2 for state in states)
    assert kernel.refresh().rollback(reason="test").active_version == 1
    assert again.deprecate("a copy").message.deprecation.reason == "a copy"
    assert version.compare(again).transfer_difference < 1e-3


def test_report_has_a_page_arrays_and_figures(version: lightpath.KernelVersion, tmp_path: Path) -> None:
    report = version.report()
    assert report.page.startswith(b"<!")
    assert report.arrays["loss_history"].size > 4
    assert report.figures
    report.save(tmp_path / "report.html")
    assert (tmp_path / "report.html").read_bytes() == report.page


def test_transfer_function_is_that_of_the_file(lab: lightpath.Lab, version: lightpath.KernelVersion) -> None:
    learned = version.fetch()
    rows, columns = 2 * 96, 2 * 160
    assert learned.transfer_function.shape == (rows, columns)
    assert learned.transfer_function.dtype == np.complex64
    assert (learned.wavelength_m, learned.distance_m, learned.pixel_pitch_m) == (515e-9, 0.02, 8e-6)
    # The server's other form has H alone, with zero frequency in the middle.
    _, content = fetch_file(lab.connection, version.name.partition("/versions")[0], 1, "complex64")
    alone = np.load(io.BytesIO(content))
    assert np.array_equal(alone[rows // 2, columns // 2], learned.transfer_function[0, 0])
    assert np.array_equal(np.fft.ifftshift(alone), learned.transfer_function)
    assert learned.fx[1] == pytest.approx(1 / (columns * 8e-6))
    # The learned display is nearly free space: at low frequencies H turns with them as free space does.
    near = (slice(0, 12), slice(0, 12))
    turned = learned.transfer_function[near] * np.conj(learned.free_space()[near])
    assert np.abs(np.angle(turned * np.conj(turned[0, 0]))).max() < 0.5


def test_predicted_light_is_that_of_the_server(
    lab: lightpath.Lab, bench: lightpath.Display, version: lightpath.KernelVersion
) -> None:
    """The reconstruction at the sample points, computed here with NumPy, is the server's."""
    learned = version.fetch()
    hologram = bench.optimize(target(5), distance=DISTANCE, iterations=40, detector="point")
    shown = hologram.levels / 256 * 2 * np.pi
    zero_order = complex(learned.arrays["photometry"][2], learned.arrays["photometry"][3])
    field = learned.source * (np.exp(1j * learned.phase_response(shown)) + zero_order)
    light = np.abs(learned.propagate(field)) ** 2
    encoded = hologram.reconstruction / 255
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    # Values at full scale are clipped. The steps of 8 bits are at most 0.9 % of the light.
    shows = (hologram.reconstruction > 20) & (hologram.reconstruction < 255)
    gain = (linear[shows] @ light[shows]) / (light[shows] @ light[shows])
    assert np.abs(gain * light[shows] - linear[shows]).max() < 0.01
    assert lab.job(hologram.job.name).ended


def by_odak(field: npt.NDArray[Any], kernel: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Propagation as odak does it: padding around the field, spectra with zero frequency in the middle."""
    rows, columns = field.shape
    top, left = rows - rows // 2, columns - columns // 2
    padded = np.zeros((2 * rows, 2 * columns), complex)
    padded[top : top + rows, left : left + columns] = field
    spectrum = np.fft.fftshift(np.fft.fft2(padded)) * kernel
    return np.fft.ifft2(np.fft.ifftshift(spectrum))[top : top + rows, left : left + columns]


def by_torchoptics(field: npt.NDArray[Any], kernel: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Propagation as torchoptics does it: equal padding on both sides, zero frequency in the middle."""
    pad = (field.shape[0] // 2, field.shape[1] // 2)
    padded = np.pad(field, ((pad[0], pad[0]), (pad[1], pad[1])))
    result = np.fft.ifft2(np.fft.ifftshift(np.fft.fftshift(np.fft.fft2(padded)) * kernel))
    return result[pad[0] : -pad[0], pad[1] : -pad[1]]


def by_neural_holography(field: npt.NDArray[Any], kernel: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Propagation as neural-holography does it: zero frequency first, fields shifted in space, unitary transforms."""
    rows, columns = field.shape
    padded = np.pad(field, ((rows // 2, rows - rows // 2), (columns // 2, columns - columns // 2)))[None, None]
    axes = (-2, -1)
    spectrum = np.fft.fftn(np.fft.ifftshift(padded, axes=axes), axes=axes, norm="ortho")
    result = np.fft.fftshift(np.fft.ifftn(kernel * spectrum, axes=axes, norm="ortho"), axes=axes)
    return result[0, 0, rows // 2 : rows // 2 + rows, columns // 2 : columns // 2 + columns]


def test_other_packages_propagate_with_their_h_as_the_server_does(version: lightpath.KernelVersion) -> None:
    learned = version.fetch()
    random = np.random.default_rng(4)
    field = learned.source * np.exp(2j * np.pi * random.random(learned.source.shape))
    expected = learned.propagate(field)
    scale = np.abs(expected).max()
    others = {
        "odak": by_odak(field, learned.for_odak()),
        "torchoptics": by_torchoptics(field, learned.for_torchoptics()),
        "neural-holography": by_neural_holography(field, learned.for_neural_holography()),
    }
    for name, result in others.items():
        assert np.abs(result - expected).max() < 1e-6 * scale, name
    # In the wrong order the result is another: the check above can fail.
    wrong = by_odak(field, learned.transfer_function)
    assert np.abs(wrong - expected).max() > 0.1 * scale


def test_torchoptics_needs_even_sides(version: lightpath.KernelVersion) -> None:
    learned = version.fetch()
    odd = lightpath.LearnedKernel(
        v1.KernelVersion(), learned.transfer_function[:-2], learned.source[:-1], 8e-6, 515e-9, 0.02, {}, {}
    )
    with pytest.raises(lightpath.InvalidArgument, match="even"):
        odd.for_torchoptics()


def test_own_photographs_and_phases_make_pairs(bench: lightpath.Display, tmp_path: Path) -> None:
    dataset = bench.create_dataset("own-files", distance=DISTANCE)
    hologram = bench.optimize(target(9), distance=DISTANCE, iterations=10)
    photo = bench.photograph(hologram)
    photo.save(tmp_path / "photo.png")
    dataset.add(hologram.phase, tmp_path / "photo.png", pair_id="radians", split="test", exposure_s=0.02)
    other = bench.optimize(target(10), distance=DISTANCE, iterations=10)
    pixels = bench.photograph(other.levels, distance=DISTANCE).pixels
    dataset.add(other.levels, pixels, pair_id="levels", exposure_s=0.02)
    assert {pair.id for pair in dataset.pairs()} == {"radians", "levels"}
    assert all(pair.checks.correlation > 0.5 for pair in dataset.pairs())
    with pytest.raises(lightpath.AlreadyExists):
        dataset.add(hologram.phase, tmp_path / "photo.png", pair_id="again")
    with pytest.raises(lightpath.InvalidArgument, match="distance is missing"):
        bench.photograph(hologram.levels)
    dots = bench.optimize(bench.calibration_target(), distance=DISTANCE, kernel="ideal", iterations=40)
    aligned = dataset.align(dots=bench.photograph(dots)).alignment
    assert aligned.points >= 12
    assert aligned.residual_px < 0.5
    dataset.delete()
    with pytest.raises(lightpath.NotFound):
        dataset.refresh()
