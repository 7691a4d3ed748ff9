"""Propagation in this process, against plain NumPy in double precision."""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import lightpath
from lightpath import local

OPTICS: dict[str, Any] = {"wavelength": "515nm", "pixel_pitch": "8um", "distance": "3mm"}
# Largest relative L2 error of a convolution in single precision: some units in the last place for each of the
# log2(n) stages of the transforms.
SINGLE = 2e-6


def random_field(rows: int, columns: int, seed: int = 1) -> npt.NDArray[np.complex128]:
    random = np.random.default_rng(seed)
    return random.standard_normal((rows, columns)) + 1j * random.standard_normal((rows, columns))


def distance_of(found: npt.NDArray[Any], expected: npt.NDArray[Any]) -> float:
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


def angular_spectrum(field: npt.NDArray[Any], wavelength_m: float, pitch_m: float, z_m: float) -> npt.NDArray[Any]:
    """Return the angular spectrum on a field padded twofold, without the piston: the textbook's formula."""
    rows, columns = field.shape
    fy, fx = np.fft.fftfreq(2 * rows, pitch_m)[:, np.newaxis], np.fft.fftfreq(2 * columns, pitch_m)
    transfer = np.exp(2j * np.pi * z_m * (np.sqrt(wavelength_m**-2 - fx**2 - fy**2) - 1 / wavelength_m))
    return np.asarray(np.fft.ifft2(transfer * np.fft.fft2(field, s=transfer.shape))[:rows, :columns])


def test_the_angular_spectrum_is_that_of_numpy() -> None:
    field = random_field(48, 70)
    expected = angular_spectrum(field, 515e-9, 8e-6, 3e-3)
    single = local.propagate(field, method="angular-spectrum", **OPTICS)
    assert single.field.dtype == np.complex64
    assert distance_of(single.field, expected) < SINGLE
    double = local.propagate(field, method="angular-spectrum", precision="double", **OPTICS)
    assert double.field.dtype == np.complex128
    # The formula above subtracts phases of 4e4 rad, which float64 holds to 7e-12 rad.
    assert distance_of(double.field, expected) < 1e-11
    np.testing.assert_allclose(double.intensity, np.abs(expected) ** 2, rtol=1e-9)


def test_the_planned_method_is_exact_where_the_padded_frame_is_not() -> None:
    """A direct integral over the pixels' band judges: no transform, no padding, no frame."""
    field, wavelength_m, pitch_m, z_m = random_field(24, 32), 515e-9, 8e-6, 12e-3
    node, node_weight = np.polynomial.legendre.leggauss(400)
    cycles, weight = node / 2, node_weight / 2
    along_y = np.exp(2j * np.pi * np.outer(np.arange(24), cycles))
    along_x = np.exp(2j * np.pi * np.outer(np.arange(32), cycles))
    squared = (cycles[:, np.newaxis] ** 2 + cycles**2) / pitch_m**2
    transfer = np.exp(2j * np.pi * z_m * (np.sqrt(wavelength_m**-2 - squared) - 1 / wavelength_m))
    spectrum = along_y.conj().T @ field @ along_x.conj() * transfer * np.outer(weight, weight)
    expected = along_y @ spectrum @ along_x.T
    optics: dict[str, Any] = {"wavelength": wavelength_m, "pixel_pitch": pitch_m, "distance": z_m}
    planned = local.propagate(field, **optics)
    assert planned.plan.method == "band-response"
    assert "exact" in planned.plan.explanation
    assert distance_of(planned.field, expected) < 1e-4
    padded = local.propagate(field, method="angular-spectrum", regardless=True, **optics)
    assert distance_of(padded.field, expected) > 0.2


def test_the_transfer_function_is_in_the_order_of_numpy() -> None:
    field = random_field(40, 30)
    for method in ("angular-spectrum", "band-response"):
        transfer = local.transfer_function("30x40", method=method, **OPTICS)
        assert transfer.shape == (80, 60)
        expected = np.fft.ifft2(transfer * np.fft.fft2(field, s=transfer.shape))[:40, :30]
        assert distance_of(local.propagate(field, method=method, **OPTICS).field, expected) < SINGLE


@pytest.mark.parametrize(
    "method", ["auto", "band-limited", "rayleigh-sommerfeld", "scaled", "scaled-fresnel", "fraunhofer"]
)
def test_the_adjoint_is_the_adjoint(method: Any) -> None:
    optics: dict[str, Any] = {"wavelength": 633e-9, "pixel_pitch": "10um", "distance": "40mm", "method": method}
    if method != "auto":
        optics["regardless"] = True
    propagator = local.Propagator("36x28", precision="double", **optics)
    field, image = random_field(28, 36), random_field(*propagator.image_shape, seed=2)
    there, back = np.vdot(image, propagator(field)), np.vdot(propagator.adjoint(image), field)
    assert abs(there - back) < 1e-10 * abs(there)


def test_directional_differences_agree_with_the_adjoint_in_single_precision() -> None:
    """L = Σ w |A u|² has the gradient 2 Aᴴ w A u. It is quadratic, so a central difference of any step is exact."""
    propagator = local.Propagator("40x32", **OPTICS)
    field, direction, weight = (
        random_field(32, 40),
        random_field(32, 40, seed=2),
        np.random.default_rng(3).random((32, 40)),
    )

    def loss(u: npt.NDArray[Any]) -> float:
        return float(np.sum(weight * np.abs(propagator(u).astype(np.complex128)) ** 2))

    gradient = 2 * propagator.adjoint(weight * propagator(field))
    expected = float(np.real(np.vdot(gradient, direction)))
    found = (loss(field + direction) - loss(field - direction)) / 2
    assert abs(found - expected) < 1e-4 * abs(expected)


def test_leading_axes_are_kept() -> None:
    propagator = local.Propagator((20, 16), **OPTICS)
    fields = np.stack([random_field(16, 20, seed) for seed in range(6)]).reshape(2, 3, 16, 20)
    images = propagator(fields)
    assert images.shape == fields.shape
    np.testing.assert_array_equal(images[1, 2], propagator(fields[1, 2]))
    np.testing.assert_array_equal(propagator(fields[:, :, ::-1, ::2].repeat(2, axis=-1))[0, 0].shape, (16, 20))


def test_plans_say_what_to_expect() -> None:
    near = local.plan("1920x1080", wavelength="515nm", pixel_pitch="8um", distance="150mm")
    assert (near.method, near.warnings) == ("band-response", ())
    assert abs(near.critical_distance_y_m - 0.268) < 1e-3
    assert "268.4" in str(near)
    far = local.plan("1920x1080", wavelength="515nm", pixel_pitch="8um", distance="500mm", method="band-limited")
    assert {"BAND_LIMITED", "WRAP_AROUND"} <= {each.code for each in far.warnings}
    with pytest.raises(local.EngineRefused, match="cannot be used for this setup") as refused:
        local.plan("1920x1080", wavelength="515nm", pixel_pitch="8um", distance="500mm", method="angular-spectrum")
    assert (refused.value.reason, refused.value.field) == ("UNSUITABLE", "method")


def test_wrong_arguments_are_named_with_a_fix() -> None:
    field = random_field(8, 8)
    for wrong, text in [
        (field.real.astype(np.int64), "field has values of type int64: give complex amplitudes"),
        (field[0], r"field has the shape \(8,\): give \[rows\]\[columns\]"),
        (np.where(np.eye(8), np.nan, field), r"field is not a finite number at \[0\]\[0\]: replace it"),
        (field * 1e300, "field is not a finite number at"),
    ]:
        with pytest.raises(lightpath.InvalidArgument, match=text):
            local.propagate(wrong, **OPTICS)
    with pytest.raises(lightpath.InvalidArgument, match="field is a list: give an array"):
        local.Propagator("8x8", **OPTICS)([[1j]])  # type: ignore[arg-type]
    real = local.propagate(np.abs(field), **OPTICS).field
    np.testing.assert_array_equal(real, local.propagate(np.abs(field).astype(complex), **OPTICS).field)
    with pytest.raises(lightpath.InvalidArgument, match=r"field has the shape \(8, 8\): give \[9\]\[8\]"):
        local.Propagator("8x9", **OPTICS)(field)
    with pytest.raises(
        lightpath.InvalidArgument, match='wavelength is 515 without a unit, which is 515 m: write "515nm"'
    ):
        local.propagate(field, wavelength=515, pixel_pitch="8um", distance="3mm")
    with pytest.raises(lightpath.InvalidArgument, match=r"method is .fresnel.: choose one of auto, band-response"):
        local.propagate(field, method="fresnel", **OPTICS)  # type: ignore[arg-type]
    with pytest.raises(local.EngineRefused, match="pixel_pitch is 1, but must be 1e-8 to 1e-2 m") as refused:
        local.propagate(field, wavelength="515nm", pixel_pitch="1m", distance="3mm")
    assert refused.value.field == "pixel_pitch"
    with pytest.raises(lightpath.InvalidArgument, match="are not all given: give them, or a kernel"):
        local.propagate(field, wavelength="515nm", pixel_pitch="8um")
    some: dict[str, Any] = {"wavelength": "515nm", "pixel_pitch": "8um"}
    with pytest.raises(TypeError, match="missing keyword argument distance"):
        local.plan("8x8", **some)
    with pytest.raises(TypeError, match="unknown option z"):
        local.plan("8x8", z=1, **OPTICS)  # type: ignore[call-arg]


def test_other_threads_run_while_a_field_propagates() -> None:
    propagator, field = local.Propagator("512x512", **OPTICS), random_field(512, 512).astype(np.complex64)
    done, ticks = threading.Event(), 0

    def work() -> None:
        for _ in range(8):
            propagator(field)
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    while not done.is_set():
        time.sleep(1e-3)
        ticks += 1
    thread.join()
    # With the lock held, the main thread would wait for each computation.
    assert ticks > 20


def test_processes_that_fork_compute_on(tmp_path: Any) -> None:
    import multiprocessing  # noqa: PLC0415

    field = random_field(16, 16)
    before = local.propagate(field, **OPTICS).field
    context = multiprocessing.get_context("fork")
    path = tmp_path / "image.npy"
    child = context.Process(target=_propagate_to, args=(field, path))
    child.start()
    child.join(60)
    assert child.exitcode == 0
    np.testing.assert_array_equal(np.load(path), before)


def _propagate_to(field: npt.NDArray[Any], path: Any) -> None:
    np.save(path, local.propagate(field, **OPTICS).field)
