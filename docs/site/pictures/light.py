"""A small, plain simulation of light in NumPy, for pictures of what the engine does."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt

Field = Any
PITCH_M, WAVELENGTH_M = 8e-6, 515e-9


def critical_distance_m(pixels: int) -> float:
    """Return the distance up to which the transfer function of a padded side is sampled finely enough."""
    return 2 * pixels * PITCH_M**2 / WAVELENGTH_M


def transfer_phase(frequency_per_m: npt.NDArray[Any], distance_m: float) -> npt.NDArray[Any]:
    """Return the phase of the transfer function along an axis, without its constant part [rad]."""
    root = np.sqrt(WAVELENGTH_M**-2 - frequency_per_m**2)
    return np.asarray(2 * np.pi * distance_m * (root - 1 / WAVELENGTH_M))


def propagate(field: Field, distance_m: float, *, pad: int = 2, finer: int = 1) -> Field:
    """Return a field after a distance by the angular spectrum, without the padding.

    With `finer`, each pixel has that many points along each side, which lie evenly around its middle.
    """
    height, width = field.shape
    rows, columns = pad * height, pad * width
    fy, fx = (np.fft.fftfreq(n, PITCH_M) for n in (rows, columns))
    square = fx[None, :] ** 2 + fy[:, None] ** 2
    transfer = np.exp(2j * np.pi * distance_m * (np.sqrt(WAVELENGTH_M**-2 - square) - 1 / WAVELENGTH_M))
    # From the middle of a pixel to its first point.
    offset_m = (1 / finer - 1) / 2 * PITCH_M
    moved = np.exp(2j * np.pi * offset_m * (fx[None, :] + fy[:, None]))
    spectrum = np.fft.fftshift(np.fft.fft2(field, (rows, columns)) * transfer * moved)
    # More points of the same field: the same spectrum with zeros around it.
    around = [((finer - 1) * n // 2, (finer - 1) * n - (finer - 1) * n // 2) for n in (rows, columns)]
    fine = np.fft.ifft2(np.fft.ifftshift(np.pad(spectrum, around))) * finer**2
    return fine[: finer * height, : finer * width]


def pixel_light(fine: Field, finer: int) -> npt.NDArray[Any]:
    """Return the light that pixels integrate, from a field with `finer` points along each side of a pixel."""
    light = np.abs(fine) ** 2
    height, width = light.shape
    return np.asarray(light.reshape(height // finer, finer, width // finer, finer).mean(axis=(1, 3)))


def scaled(light: npt.NDArray[Any], brightest: float = 0.995) -> npt.NDArray[Any]:
    """Return light from 0 to 255, where the brightest pixels are cut."""
    return np.asarray((255 * light / np.quantile(light, brightest)).clip(0, 255))
