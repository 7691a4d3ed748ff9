# %% [markdown]
# # An optimization of one's own, without a server
#
# `lightpath.local` is Lightpath's engine in this process. This notebook propagates a hologram by a plain Fourier
# transform without padding and by the engine, and descends along the gradients of both. It needs matplotlib, and no
# server.

# %%
import matplotlib.pyplot as plt
import numpy as np

from lightpath import local

ROWS, COLUMNS = 128, 192
OPTICS = {"wavelength": "515nm", "pixel_pitch": "8um", "distance": "25mm"}
print(local.plan((COLUMNS, ROWS), **OPTICS))

# %% [markdown]
# The plain transform: H of the angular spectrum on the hologram's own pixels. The transform is periodic, so light that
# leaves the picture on one side comes back on the other.

# %%
fy, fx = np.fft.fftfreq(ROWS, 8e-6)[:, np.newaxis], np.fft.fftfreq(COLUMNS, 8e-6)
transfer = np.exp(2j * np.pi * 25e-3 * (np.sqrt(515e-9**-2 - fx**2 - fy**2) - 1 / 515e-9))


def plain(field):
    return np.fft.ifft2(transfer * np.fft.fft2(field))


def plain_adjoint(field):
    return np.fft.ifft2(transfer.conj() * np.fft.fft2(field))


engine = local.Propagator((COLUMNS, ROWS), **OPTICS)

# %% [markdown]
# A target, and a descent that both propagators share. L = mean (s |A c|² − t)² with c = exp(iφ) has the gradient
# ∂L/∂φ = 4 s / N · Im(c* Aᴴ (s |A c|² − t) A c). Adam takes the steps.

# %%
y, x = np.mgrid[:ROWS, :COLUMNS]
target = np.full((ROWS, COLUMNS), 0.1)
target[25:60, 30:160] = np.where((x // 10 + y // 10) % 2, 1.0, 0.2)[25:60, 30:160]
target[(y - 90) ** 2 + (x - 60) ** 2 < 18**2] = 0.8
target[75:105, 100:160] = np.linspace(0, 1, 60)


def descend(propagate, adjoint, steps=120, rate=0.1):
    phase = np.random.default_rng(1).random((ROWS, COLUMNS))
    mean, square, losses = 0.0, 0.0, []
    for step in range(1, steps + 1):
        field = np.exp(1j * phase)
        image = propagate(field)
        light = np.abs(image) ** 2
        gain = np.sum(light * target) / np.sum(light**2)
        rest = gain * light - target
        losses.append(np.mean(rest**2))
        gradient = 4 * gain / rest.size * np.imag(field.conj() * adjoint(rest * image))
        mean, square = 0.9 * mean + 0.1 * gradient, 0.999 * square + 0.001 * gradient**2
        phase -= rate * (mean / (1 - 0.9**step)) / (np.sqrt(square / (1 - 0.999**step)) + 1e-12)
    return phase, losses


by_plain, plain_losses = descend(plain, plain_adjoint)
by_engine, engine_losses = descend(engine, engine.adjoint)
print(f"loss by its own model: plain {plain_losses[-1]:.2e}, engine {engine_losses[-1]:.2e}")

# %% [markdown]
# What the two holograms really show: the engine's light, and the opinion of an independent model on some rows. The
# plain transform promised a good picture, because it let light come back.

# %%
display = local.DisplayModel.ideal((COLUMNS, ROWS), **OPTICS)
whole = (0, 0, COLUMNS, ROWS)
shown = {"target": target}
results = [("plain transform", by_plain, plain_losses), ("engine", by_engine, engine_losses)]
for name, phase, promised in results:
    quality, opinion = display.quality(phase, target, region=whole, target_encoding="linear")
    real_db = quality.point.psnr_db
    print(f"{name}: promised {-10 * np.log10(promised[-1]):.1f} dB, shows {real_db:.1f} dB at the sample points")
    print(
        f"  pixels: {opinion.engine_psnr_db:.1f} dB by the engine, {opinion.independent_psnr_db:.1f} dB independently"
    )
    light = display.simulate(phase, detector="point")
    shown[f"{name}: {real_db:.1f} dB"] = light * np.sum(light * target) / np.sum(light**2)

# %%
figure, axes = plt.subplots(1, 4, figsize=(15, 3.2), layout="constrained")
for each, (name, light) in zip(axes, shown.items(), strict=False):
    each.imshow(light, cmap="gray", vmin=0, vmax=1)
    each.set_title(name)
    each.set_axis_off()
axes[3].semilogy(plain_losses, label="plain transform, by itself")
axes[3].semilogy(engine_losses, label="engine")
axes[3].set_xlabel("step")
axes[3].set_ylabel("loss (mean squared error)")
axes[3].legend()
figure.savefig("figure-own-loop.png")

# %% [markdown]
# With PyTorch the loop is shorter: `lightpath.torch.Propagator` is a layer with this gradient.
