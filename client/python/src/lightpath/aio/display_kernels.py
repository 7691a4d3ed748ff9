"""Asynchronous kernels of a display by distance, and what a version must show before the display uses it."""

from __future__ import annotations

import uuid
from dataclasses import dataclass
from typing import TYPE_CHECKING

from lightpath import v1
from lightpath.aio.kernels import Kernel, KernelVersion
from lightpath.aio.resource import Resource
from lightpath.promotion import PromotionGate, read_gate
from lightpath.units import Length, metres, place

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lightpath import words


@dataclass(frozen=True)
class NearestKernels:
    """The kernels of a display that are nearest to a distance."""

    kernels: list[Kernel]
    """Kernels with an active version, the nearest first: at most one on each side of the distance, or one at it."""
    can_be_interpolated: bool
    """Whether `Display.interpolate_kernel` can make a kernel for the distance."""


class DisplayKernels(Resource):
    """What a display has besides single kernels: neighbours of a distance, and the promotion gate."""

    async def nearest_kernels(self, *, distance: Length, wavelength: Length | None = None) -> NearestKernels:
        """Return the kernels whose distances are nearest to a distance.

        ```python
        if display.nearest_kernels(distance="155mm").can_be_interpolated:
            display.interpolate_kernel(distance="155mm").promote()
        ```
        """
        request = v1.FindNearestKernelsRequest(display=self.name, place=place(distance))
        if wavelength is not None:
            request.wavelength_m = metres("wavelength", wavelength)
        found = await self._connection.call(self._connection.kernels.FindNearestKernels, request)
        return NearestKernels([Kernel(self._connection, each) for each in found.kernels], found.can_be_interpolated)

    async def interpolate_kernel(self, *, distance: Length, wavelength: Length | None = None) -> KernelVersion:
        """Make a version for a distance between those that `Lab.learn` learned together, and return it.

        Raises `InvalidRequest` if the distance was photographed or is not between the others, and `PreconditionFailed`
        if no distances were learned together.
        """
        request = v1.InterpolateKernelRequest(display=self.name, place=place(distance), request_id=str(uuid.uuid4()))
        if wavelength is not None:
            request.wavelength_m = metres("wavelength", wavelength)
        call = self._connection.kernels.InterpolateKernel
        return KernelVersion(self._connection, await self._connection.call(call, request))

    async def promotion_gate(self) -> PromotionGate:
        """Return what versions must show before they become active, with the gates that were set before."""
        request = v1.GetPromotionGateRequest(display=self.name)
        return read_gate(await self._connection.call(self._connection.kernels.GetPromotionGate, request))

    async def set_promotion_gate(
        self,
        *,
        loss_reduction_min: float | None = None,
        worse_than_ideal_allowed: bool = False,
        test_pairs_min: int = 0,
        formats: Sequence[words.KernelFormat] = (),
        reason: str = "",
    ) -> PromotionGate:
        """Set what versions must show before they become active. What is not given is not checked.

        - `loss_reduction_min`: how much lower the held-out loss must be than that of the active version, as a part
          of it, 0 to 1
        - `worse_than_ideal_allowed`: whether a version may be active that is no better than the ideal kernel
        - `test_pairs_min`: least number of test pairs with which the version was measured
        - `formats`: formats in which the version must be available, besides those that devices use

        ```python
        display.set_promotion_gate(loss_reduction_min=0.02, test_pairs_min=4, reason="first series")
        print(version.check_promotion().failures)
        ```
        """
        gate = v1.PromotionGate(
            loss_reduction_min=loss_reduction_min,
            worse_than_ideal_allowed=worse_than_ideal_allowed,
            test_pairs_min=test_pairs_min,
            formats=formats,
        )
        request = v1.SetPromotionGateRequest(display=self.name, gate=gate, reason=reason)
        return read_gate(await self._connection.call(self._connection.kernels.SetPromotionGate, request))
