"""Gradients in PyTorch. `client/python/check --with-torch` installs PyTorch, some gigabytes, and runs these tests."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from conftest import target

import lightpath
from lightpath import local

pytest.importorskip("torch", reason="PyTorch is not installed: run client/python/check --with-torch")

import torch

from lightpath.torch import HologramLoss, Propagator, propagate

OPTICS: dict[str, Any] = {"wavelength": "515nm", "pixel_pitch": "8um", "distance": "2mm"}


def random_field(rows: int, columns: int, seed: int = 1) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(rows, columns, dtype=torch.complex128, generator=generator)


def test_gradcheck_passes_in_double_precision() -> None:
    """With PyTorch's own tolerances: complex128 fields are propagated in f64."""
    for size, optics in [((6, 5), OPTICS), ((4, 7), {**OPTICS, "method": "fraunhofer", "regardless": True})]:
        propagator = Propagator((size[1], size[0]), **optics)
        field = random_field(*size).requires_grad_()
        assert torch.autograd.gradcheck(propagator, (field,))
        assert torch.autograd.gradgradcheck(propagator, (field,))
        image = random_field(*propagator(field).shape).requires_grad_()
        assert torch.autograd.gradcheck(propagator.adjoint, (image,))


def test_single_and_double_precision_agree_with_numpy() -> None:
    field = random_field(12, 20)
    transfer = local.transfer_function("20x12", **OPTICS)
    expected = np.fft.ifft2(transfer * np.fft.fft2(field.numpy(), s=transfer.shape))[:12, :20]
    single, double = propagate(field.to(torch.complex64), **OPTICS), propagate(field, **OPTICS)
    assert (single.dtype, double.dtype) == (torch.complex64, torch.complex128)
    for image in (single, double):
        assert np.linalg.norm(image.numpy() - expected) < 2e-6 * np.linalg.norm(expected)


def test_conjugates_batches_and_devices_are_kept() -> None:
    propagator = Propagator("20x12", **OPTICS)
    fields = torch.stack([random_field(12, 20, seed) for seed in range(4)]).reshape(2, 2, 12, 20)
    images = propagator(fields.conj())
    assert images.shape == fields.shape
    assert images.device == fields.device
    assert torch.equal(images[1, 0], propagator(fields[1, 0].conj().resolve_conj()))
    with pytest.raises(lightpath.InvalidArgument, match=r"type torch\.float64: give complex ones"):
        propagator(fields.real)


def loss_in_torch(phase: torch.Tensor, wanted: torch.Tensor, optics: dict[str, Any]) -> torch.Tensor:
    """The engine's loss at the sample points in the middle 80 %, with a fitted gain, written with PyTorch."""
    rows, columns = wanted.shape
    light = Propagator((columns, rows), **optics)(torch.polar(torch.ones_like(phase), phase)).abs() ** 2
    top, left = round(0.1 * rows), round(0.1 * columns)
    middle = (slice(top, rows - top), slice(left, columns - left))
    seen, aimed = light[middle], wanted[middle]
    gain = ((seen * aimed).sum() / (seen**2).sum()).detach()
    return ((gain * seen - aimed) ** 2).mean()


def test_the_engines_loss_has_the_gradient_of_pytorch() -> None:
    """PyTorch differentiates the same loss through the double propagation; the engine computes both in f32."""
    wanted = torch.from_numpy(target(1)[:40, :60] / 255)
    phase = torch.rand(40, 60, dtype=torch.float64, generator=torch.Generator().manual_seed(1)).requires_grad_()
    expected = loss_in_torch(phase, wanted, OPTICS)
    (gradient,) = torch.autograd.grad(expected, phase)
    own = HologramLoss(wanted, target_encoding="linear", detector="point", **OPTICS)
    found = own(phase)
    found.backward()
    assert phase.grad is not None
    assert abs(found.item() - expected.item()) < 1e-5 * expected.item()
    assert torch.linalg.norm(phase.grad - gradient) < 1e-5 * torch.linalg.norm(gradient)


def test_gradcheck_of_the_loss_within_single_precision() -> None:
    """The engine's loss is f32: it has a relative error of some 1e-7. A step of 0.01 rad makes that an error of
    2e-7 L / 0.02 rad = 1e-5 L in a difference, and the curvature an error of about the same size."""
    wanted = torch.from_numpy(target(2)[:8, :10] / 255).clamp(0.1, 1)
    loss = HologramLoss(wanted, target_encoding="linear", region=(0, 0, 10, 8), **OPTICS)
    phase = torch.rand(8, 10, dtype=torch.float64, generator=torch.Generator().manual_seed(3)).requires_grad_()
    assert torch.autograd.gradcheck(loss, (phase,), eps=1e-2, atol=3e-5 * loss(phase).item(), rtol=1e-3)


def test_a_training_loop_of_ones_own_works() -> None:
    wanted = torch.from_numpy(target(3) / 255).to(torch.float32)
    propagator = Propagator("160x96", wavelength="515nm", pixel_pitch="8um", distance="20mm")
    phase = torch.rand(96, 160, generator=torch.Generator().manual_seed(4)).requires_grad_()
    optimizer = torch.optim.Adam([phase], lr=0.1)
    losses = []
    for _ in range(60):
        optimizer.zero_grad()
        light = propagator(torch.polar(torch.ones_like(phase), phase)).abs() ** 2
        gain = ((light * wanted).sum() / (light**2).sum()).detach()
        loss = ((gain * light - wanted) ** 2).mean()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert losses[-1] < 0.1 * losses[0]
