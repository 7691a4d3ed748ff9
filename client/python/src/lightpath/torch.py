"""Lightpath's propagation and loss in PyTorch, with exact gradients, for training loops of your own.

```python
from lightpath.torch import Propagator

propagator = Propagator("1920x1080", wavelength="515nm", pixel_pitch="8um", distance="150mm")
image = propagator(torch.polar(amplitude, phase))  # complex64, on the processor
((image.abs() ** 2 - target) ** 2).mean().backward()
```

Propagation is linear, u ↦ A u, so its gradient is the adjoint Aᴴ, which the engine applies by the conjugate transfer
function. The computation runs on the processor. Tensors of other devices are copied there and back.

It needs PyTorch: `pip install "lightpath[torch]"`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import torch

from lightpath import local
from lightpath.errors import InvalidArgument
from lightpath.local.optics import REQUIRED, OpticsOptions
from lightpath.local.options import LossOptions
from lightpath.signature import with_options

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from lightpath.local.propagation import Precision
    from lightpath.pictures import Picture

__all__ = ["HologramLoss", "Propagator", "propagate"]


_FORWARD, _ADJOINT = False, True


class Propagator(torch.nn.Module):
    """Propagation of complex fields [..][rows][columns] to a distance, as a layer without parameters.

    complex64 fields are computed in single precision, complex128 in double.
    """

    @with_options(OpticsOptions, required=REQUIRED)
    def __init__(self, resolution: str | tuple[int, int], **optics: Unpack[OpticsOptions]) -> None:
        super().__init__()
        self._resolution, self._optics = resolution, optics
        self._prepared: dict[torch.dtype, local.Propagator] = {}
        self.plan = local.plan(resolution, **optics)
        """Which method is used, and why."""

    def forward(self, field: torch.Tensor) -> torch.Tensor:
        """Return the field at the distance, of the same type and on the same device."""
        image: torch.Tensor = _Apply.apply(field, self._for(field.dtype), _FORWARD)
        return image

    def adjoint(self, field: torch.Tensor) -> torch.Tensor:
        """Return Aᴴ applied to a field in the image."""
        back: torch.Tensor = _Apply.apply(field, self._for(field.dtype), _ADJOINT)
        return back

    def _for(self, dtype: torch.dtype) -> local.Propagator:
        if dtype not in (torch.complex64, torch.complex128):
            fix = "give complex ones, such as torch.polar(amplitude, phase)"
            raise InvalidArgument("field", f"has values of type {dtype}", fix)
        if dtype not in self._prepared:
            precision: Precision = "single" if dtype == torch.complex64 else "double"
            self._prepared[dtype] = local.Propagator(self._resolution, precision=precision, **self._optics)
        return self._prepared[dtype]


class _Apply(torch.autograd.Function):
    """A or Aᴴ. The gradient of one is the other, so that gradients of gradients exist, too."""

    @staticmethod
    def forward(ctx: Any, field: torch.Tensor, propagator: local.Propagator, adjoint: bool) -> torch.Tensor:  # noqa: FBT001
        ctx.propagator, ctx.adjoint = propagator, adjoint
        image = propagator.adjoint(field) if adjoint else propagator(field)
        return torch.from_numpy(image).to(field.device)

    @staticmethod
    def backward(ctx: Any, gradient: torch.Tensor) -> tuple[torch.Tensor, None, None]:
        return _Apply.apply(gradient, ctx.propagator, not ctx.adjoint), None, None


@with_options(OpticsOptions, required=REQUIRED)
def propagate(field: torch.Tensor, **optics: Unpack[OpticsOptions]) -> torch.Tensor:
    """Return a complex field at a distance. For many fields of the same optics, make a `Propagator`."""
    image: torch.Tensor = Propagator((field.shape[-1], field.shape[-2]), **optics)(field)
    return image


class HologramLoss(torch.nn.Module):
    """The engine's own loss of a hologram's phase, with the engine's gradient.

    `HologramLoss(target, …)(phase)` is the loss of `lightpath.local.optimize` at the gain that fits best, as a scalar
    tensor. Phases are [rows][columns], and computed in single precision.
    """

    @with_options(LossOptions)
    def __init__(self, target: Picture, **options: Unpack[LossOptions]) -> None:
        super().__init__()
        self.loss = local.HologramLoss(target, **options)
        """The same loss on arrays."""

    def forward(self, phase: torch.Tensor) -> torch.Tensor:
        """Return the loss of a phase [rad]."""
        loss: torch.Tensor = _Loss.apply(phase, self.loss)
        return loss


class _Loss(torch.autograd.Function):
    """Loss and gradient come from one evaluation. There is no second derivative."""

    @staticmethod
    def forward(ctx: Any, phase: torch.Tensor, loss: local.HologramLoss) -> torch.Tensor:
        value, gradient = loss.gradient(phase)
        ctx.save_for_backward(torch.from_numpy(gradient).to(phase))
        return phase.new_tensor(value)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, scale: torch.Tensor) -> tuple[torch.Tensor, None]:
        (gradient,) = ctx.saved_tensors
        return scale * gradient, None
