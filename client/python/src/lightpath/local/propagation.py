"""Propagation of fields through free space.

Every method is a linear convolution: the engine pads the field with zeros, so that no light comes back from the other
side of the frame. Fields omit the piston exp(ikz), which is the same everywhere.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, get_args

import numpy as np

from lightpath.errors import InvalidArgument
from lightpath.local.arrays import Array, as_array, complex_field
from lightpath.local.display import DisplayModel
from lightpath.local.engine import engine, refusals
from lightpath.local.optics import REQUIRED, OpticsOptions, choose, optics_json
from lightpath.plans import Plan, plan_of
from lightpath.signature import with_options
from lightpath.units import resolution_px

if TYPE_CHECKING:
    import numpy.typing as npt
    from typing_extensions import Unpack

    from lightpath.local.optics import Method
    from lightpath.units import Length

Precision: TypeAlias = Literal["single", "double"]
"""`single`: complex64. `double`: complex128, which takes some three times longer."""

_AXES = 2


@dataclass(frozen=True, eq=False)
class Propagated:
    """A field at a distance."""

    field: npt.NDArray[Any]
    """Complex amplitudes [..][y][x], without the piston exp(ikz)."""
    plan: Plan
    """The method, why it was chosen, and its limitations."""

    @property
    def intensity(self) -> npt.NDArray[Any]:
        """Light |u|² at the sample points."""
        intensity: npt.NDArray[Any] = self.field.real**2 + self.field.imag**2
        return intensity


class Propagator:
    """A prepared propagation of fields of one size, for many fields. It keeps its transfer function in memory.

    `propagator(field)` takes and returns complex arrays [rows][columns], with any axes before them. `adjoint` is the
    exact adjoint Aᴴ: with the convolutions of free space, propagation by the conjugate transfer function.

    `precision` is `single` (complex64) or `double` (complex128).
    """

    @with_options(OpticsOptions, required=REQUIRED)
    def __init__(
        self,
        resolution: str | tuple[int, int],
        *,
        precision: Precision = "single",
        **optics: Unpack[OpticsOptions],
    ) -> None:
        choose("precision", precision, get_args(Precision))
        with refusals():
            self._native = engine.Propagator(optics_json(resolution, optics), precision == "double")
        self.plan = plan_of(json.loads(self._native.plan))
        window = self.plan.report["window"]
        width_px, height_px = resolution_px(resolution)
        self.shape: tuple[int, int] = (height_px, width_px)
        """Rows and columns of the field."""
        self.image_shape: tuple[int, int] = (window["height_px"], window["width_px"])
        """Rows and columns of the image."""
        self._dtype: type[np.complex64 | np.complex128] = np.complex128 if precision == "double" else np.complex64

    def __call__(self, field: Array) -> npt.NDArray[Any]:
        """Return the field at the distance."""
        return self._each("field", field, self.shape, self._native.forward)

    def adjoint(self, field: Array) -> npt.NDArray[Any]:
        """Return Aᴴ applied to a field in the image."""
        return self._each("field", field, self.image_shape, self._native.adjoint)

    def _each(self, name: str, values: Array, shape: tuple[int, int], work: Any) -> npt.NDArray[Any]:
        fields = complex_field(name, values, self._dtype)
        if fields.shape[-2:] != shape:
            problem = f"has the shape {fields.shape}"
            raise InvalidArgument(name, problem, f"give [{shape[0]}][{shape[1]}], for which this was prepared")
        with refusals():
            if fields.ndim == len(shape):
                image: npt.NDArray[Any] = work(fields)
                return image
            images = np.stack([work(each) for each in fields.reshape(-1, *shape)])
        return images.reshape(*fields.shape[:-2], *images.shape[-2:])

    def __repr__(self) -> str:
        return f"<Propagator {self.shape[1]}x{self.shape[0]} px, {self.plan.method}>"


def propagate(
    field: Array,
    *,
    wavelength: Length | None = None,
    pixel_pitch: Length | None = None,
    distance: Length | None = None,
    method: Method = "auto",
    regardless: bool = False,
    precision: Precision = "single",
    kernel: DisplayModel | None = None,
) -> Propagated:
    """Propagate a field [rows][columns], given on the display's pixels, to a distance.

    - `field`: complex amplitudes. Real numbers (floats) are amplitudes with the phase 0
    - `method`: propagation method; `auto`: the planner chooses. `regardless`: use it even where it is not valid
    - `precision`: `single` (complex64) or `double` (complex128)

    A `Propagator` is faster for many fields of the same optics. With a `kernel` the
    field passes the learned optics instead, which have their own wavelength, pitch and distance.
    """
    own = (wavelength, pixel_pitch, distance)
    if kernel is not None:
        if own != (None, None, None) or (method, regardless, precision) != ("auto", False, "single"):
            raise InvalidArgument("kernel", "has optics of its own", "leave out all other arguments")
        return Propagated(kernel.propagate(field), kernel.plan)
    if wavelength is None or pixel_pitch is None or distance is None:
        raise InvalidArgument("wavelength, pixel_pitch and distance", "are not all given", "give them, or a kernel")
    shape = as_array("field", field).shape
    if len(shape) < _AXES:
        raise InvalidArgument("field", f"has the shape {shape}", "give [rows][columns]")
    propagator = Propagator(
        (shape[-1], shape[-2]),
        wavelength=wavelength,
        pixel_pitch=pixel_pitch,
        distance=distance,
        method=method,
        regardless=regardless,
        precision=precision,
    )
    return Propagated(propagator(field), propagator.plan)


@with_options(OpticsOptions, required=REQUIRED)
def plan(resolution: str | tuple[int, int], **optics: Unpack[OpticsOptions]) -> Plan:
    """Return which method suits the optics, or what to expect of the given method. Computes no field."""
    with refusals():
        return plan_of(json.loads(engine.plan(optics_json(resolution, optics))))


@with_options(OpticsOptions, required=REQUIRED)
def transfer_function(resolution: str | tuple[int, int], **optics: Unpack[OpticsOptions]) -> npt.NDArray[np.complex64]:
    """Return H of free space, complex64 [2 rows][2 columns], zero frequency at [0][0] as in `numpy.fft.fft2`.

    `numpy.fft.ifft2(H * numpy.fft.fft2(field, s=H.shape))[:rows, :columns]` propagates with it.
    """
    return DisplayModel.ideal(resolution, **optics).transfer_function
