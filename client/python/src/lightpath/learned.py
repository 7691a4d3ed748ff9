"""A learned kernel as arrays, for NumPy and for other packages.

The server gives H(fx, fy) with which the light on the modulator, padded with zeros to twice its size, is multiplied in
the frequency domain:

```text
image = crop(IFFT(H · FFT(pad(field)))),   FFT with exp(−i2π(fx x + fy y)),   H ≈ exp(+i2π z √(1/λ² − fx² − fy²))
```

Frequencies are those of `numpy.fft.fftfreq(2 n, pixel_pitch_m)`. Packages differ only in their order and padding:

| package | order | shape of H |
|---|---|---|
| `transfer_function` | zero frequency at [0][0] | [2 rows][2 columns] |
| neural-holography | zero frequency at [0][0] | [1][1][2 rows][2 columns] |
| odak, torchoptics | zero frequency in the middle | [2 rows][2 columns] |
"""

from __future__ import annotations

import io
import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from lightpath import html, png, v1
from lightpath.errors import InvalidArgument, ProtocolError
from lightpath.units import show_length

if TYPE_CHECKING:
    import numpy.typing as npt


@dataclass(frozen=True, eq=False)
class LearnedKernel:
    """A version of a kernel, as arrays in memory. Planes are [y][x]."""

    version: v1.KernelVersion = field(repr=False)
    transfer_function: npt.NDArray[np.complex64] = field(repr=False)
    """H(fx, fy), [2 rows][2 columns], zero frequency at [0][0]: the order of `numpy.fft.fft2`."""
    source: npt.NDArray[np.complex64] = field(repr=False)
    """Light on the modulator, [rows][columns]: field = source · exp(i response(phase))."""
    pixel_pitch_m: float
    wavelength_m: float
    distance_m: float
    arrays: dict[str, npt.NDArray[Any]] = field(repr=False)
    """All numbers of the `npz` file under their names, with `transfer` in the file's own order."""
    model: dict[str, Any] = field(repr=False)
    """Model, method, orders and optics: the file's own description."""

    def __repr__(self) -> str:
        return (
            f"<LearnedKernel {self.version.name}, {show_length(self.wavelength_m)} at {show_length(self.distance_m)}>"
        )

    @property
    def fx(self) -> npt.NDArray[Any]:
        """Frequencies along x [1/m], in the order of `transfer_function`."""
        return np.fft.fftfreq(self.transfer_function.shape[1], self.pixel_pitch_m)

    @property
    def fy(self) -> npt.NDArray[Any]:
        """Frequencies along y [1/m], in the order of `transfer_function`."""
        return np.fft.fftfreq(self.transfer_function.shape[0], self.pixel_pitch_m)

    def phase_response(self, phase_rad: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
        """Return the phase that the modulator gives for a wanted phase [rad]: φ + Σ a_k sin kφ + b_k cos kφ."""
        response: npt.NDArray[np.float64] = np.array(phase_rad, np.float64)
        for k, (sine, cosine) in enumerate(self.arrays["response_harmonics"], start=1):
            response = response + sine * np.sin(k * phase_rad) + cosine * np.cos(k * phase_rad)
        return response

    def propagate(self, light: npt.NDArray[Any]) -> npt.NDArray[np.complex128]:
        """Return the field in the image plane for a field on the modulator, both complex [rows][columns].

        This is the first mode on the axis: a kernel that varies over the modulator is only approximated.
        """
        rows, columns = self.source.shape
        if light.shape != self.source.shape:
            raise InvalidArgument("light", f"has the shape {light.shape}", f"give [{rows}][{columns}]")
        # NumPy 2 transforms complex64 in single precision, NumPy 1 in double precision.
        spectrum = np.fft.fft2(np.asarray(light, np.complex128), s=(2 * rows, 2 * columns)) * self.transfer_function
        return np.asarray(np.fft.ifft2(spectrum)[:rows, :columns], np.complex128)

    def for_odak(self) -> npt.NDArray[np.complex64]:
        """Return H for odak: [2 rows][2 columns], zero frequency in the middle.

        `odak.learn.wave.propagate_beam(field, k, distance, dx, wavelength, propagation_type="custom",
        kernel=torch.from_numpy(H), zero_padding=[True, False, True])` pads, multiplies and crops with it.
        """
        return np.fft.fftshift(self.transfer_function)

    def for_torchoptics(self) -> npt.NDArray[np.complex64]:
        """Return H for torchoptics: [2 rows][2 columns], zero frequency in the middle.

        `torchoptics.propagation.angular_spectrum_method.apply_transfer_function(H, field, asm_pad)` multiplies with it,
        with `asm_pad = (rows // 2, columns // 2)` and `field.data` [rows][columns]. Raises `InvalidArgument` for an odd
        number of rows or columns: torchoptics pads both sides by the same number of pixels.
        """
        rows, columns = self.source.shape
        if rows % 2 or columns % 2:
            raise InvalidArgument(
                "kernel",
                f"is that of a display of {columns}x{rows} px",
                "torchoptics needs even numbers of both",
            )
        return np.fft.fftshift(self.transfer_function)

    def for_neural_holography(self) -> npt.NDArray[np.complex64]:
        """Return H for neural-holography: [1][1][2 rows][2 columns], zero frequency at [0][0].

        `propagation_ASM(u_in, feature_size, wavelength, z, precomped_H=torch.from_numpy(H))` pads, multiplies and crops
        with it.
        """
        return self.transfer_function[np.newaxis, np.newaxis]

    def _repr_png_(self) -> bytes:
        return png.thumbnail(_phase_picture(np.angle(self._aberration())), html.PICTURE_SIDE_PX)

    def _repr_html_(self) -> str:
        pictures = html.picture("phase of H without free space", _phase_picture(np.angle(self._aberration())))
        amplitude = np.abs(self.source)
        pictures += html.picture(
            "light on the modulator", png.encode((255 * amplitude / amplitude.max()).astype(np.uint8))
        )
        rows: list[tuple[str, object]] = [
            ("wavelength, distance", f"{show_length(self.wavelength_m)}, {show_length(self.distance_m)}"),
            ("model", self.model.get("model", "unknown")),
            *metrics_rows(self.version),
        ]
        return pictures + html.table(self.version.name, rows)

    def _aberration(self) -> npt.NDArray[np.complex128]:
        """Return H / H_ideal with zero frequency in the middle; 0 where free space passes no light."""
        return np.fft.fftshift(self.transfer_function * np.conj(self.free_space()))

    def free_space(self) -> npt.NDArray[np.complex128]:
        """Return H of free space, exp(i2π z √(1/λ² − fx² − fy²)), in the order of `transfer_function`."""
        squared = self.wavelength_m**-2 - self.fx[np.newaxis, :] ** 2 - self.fy[:, np.newaxis] ** 2
        passes = squared > 0
        return np.where(passes, np.exp(2j * np.pi * self.distance_m * np.sqrt(np.where(passes, squared, 0))), 0)


def metrics_rows(version: v1.KernelVersion) -> list[tuple[str, object]]:
    """Return what is shown of the metrics of a version."""
    if not version.HasField("metrics"):
        return [("metrics", "not measured")]
    metrics = version.metrics
    pairs = f"{metrics.train_pairs} train, {metrics.validation_pairs} validation, {metrics.test_pairs} test"
    return [
        ("pairs", pairs),
        ("loss of the test pairs", f"{metrics.test_loss:.3g}"),
        ("with the ideal kernel", f"{metrics.ideal_test_loss:.3g}"),
    ]


def from_npz(version: v1.KernelVersion, content: bytes) -> LearnedKernel:
    """Return the kernel of an `npz` file of the server."""
    with np.load(io.BytesIO(content), allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    try:
        pitch_m, wavelength_m, distance_m = (float(number) for number in arrays["pitch_wavelength_distance_m"])
        model = json.loads(str(arrays["lightpath"]))
        transfer_function, source = np.fft.ifftshift(arrays["transfer"]), arrays["source"]
    except KeyError as error:
        raise ProtocolError(f"the file of {version.name} has no array {error}") from None
    return LearnedKernel(version, transfer_function, source, pitch_m, wavelength_m, distance_m, arrays, model)


def _phase_picture(phase_rad: npt.NDArray[Any]) -> bytes:
    return png.encode((255 * (phase_rad + np.pi) / (2 * np.pi)).astype(np.uint8))
