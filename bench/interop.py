#!/usr/bin/env python3
"""Holograms and kernels between Lightpath, odak, torchoptics and slmsuite: whether they mean the same, in numbers and a picture.

    bench/interop.py --out interop

checks that

- a hologram of Lightpath shows its target in odak and torchoptics, whose fields equal Lightpath's where they use the same
  frequencies;
- a hologram of odak gets the same quality from Lightpath as from a direct integral in double precision;
- a `kernel.pt` that PyTorch writes, as the paper's code does, propagates in Lightpath as in odak, and back;
- an SLM of slmsuite realizes the phase of a hologram, from radians and from grey levels.

Prints a table, and writes PREFIX.md and PREFIX.png. Needs what bench/peers.py needs, and a minute more for slmsuite.
"""

import argparse
import pathlib
import subprocess
import sys
import tempfile

import peers

ROWS, COLUMNS = 192, 256
WAVELENGTH, PITCH, DISTANCE = 515e-9, 8e-6, 0.02
OPTICS = {"wavelength": WAVELENGTH, "pixel_pitch": PITCH, "distance": DISTANCE}
# Relative L2 error of a convolution in single precision, with some room.
SINGLE = 1e-5


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", default="interop", metavar="PREFIX", help="write PREFIX.md and PREFIX.png")
    parser.add_argument("--environment", type=pathlib.Path, default=peers.ROOT / "target" / "bench-environment")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if not given.inside:
        python = peers.engine_environment(given.environment.resolve())
        out = str(pathlib.Path(given.out).resolve())
        # odak leaves a log in the folder that it runs in.
        with tempfile.TemporaryDirectory() as scratch:
            sys.exit(subprocess.run([python, __file__, "--inside", "--out", out], cwd=scratch, check=False).returncode)
    rows, pictures = [], {}
    holograms(rows, pictures)
    odak_scored(rows)
    kernels(rows)
    slm(rows)
    text = "\n".join(["| what | found | bound |", "|---|---|---|"] + [f"| {what} | {found} | {bound} |" for what, found, bound in rows])
    print(text)
    pathlib.Path(f"{given.out}.md").write_text(text + "\n", encoding="utf-8")
    draw(pictures, f"{given.out}.png")


def holograms(rows, pictures):
    """A hologram of Lightpath in each package."""
    import numpy as np
    import odak
    import torch
    import torchoptics
    from lightpath import local

    target = picture()
    hologram = local.optimize(target, target_encoding="linear", detector="point", iterations=100, **OPTICS)
    field = torch.from_numpy(hologram.field)
    pictures["target"] = target
    pictures["Lightpath, band response"] = brightest(local.propagate(field, **OPTICS).intensity, target)

    def odak_propagates(kind, kernel=None):
        k = odak.learn.wave.wavenumber(WAVELENGTH)
        return odak.learn.wave.propagate_beam(
            field, k, DISTANCE, PITCH, WAVELENGTH, propagation_type=kind, kernel=kernel, zero_padding=[True, False, True]
        ).numpy()  # fmt: skip

    banded = local.propagate(field, method="band-limited", regardless=True, **OPTICS).field
    plain = odak_propagates("Bandlimited Angular Spectrum")
    transfer = local.transfer_function((COLUMNS, ROWS), method="band-limited", regardless=True, **OPTICS)
    corrected = odak_propagates("custom", torch.from_numpy(np.fft.fftshift(transfer)))
    torchoptics.set_default_spacing(PITCH)
    torchoptics.set_default_wavelength(WAVELENGTH)
    seen = torchoptics.Field(field.to(torch.complex128), z=0).propagate_to_z(
        DISTANCE, propagation_method="ASM", asm_pad=[ROWS // 2, COLUMNS // 2]
    )
    spectrum = local.propagate(field, method="angular-spectrum", regardless=True, **OPTICS).field
    own = psnr_db(np.abs(spectrum) ** 2, target)
    for name, image, expected, bound in [
        ("torchoptics, angular spectrum", seen.data.numpy(), spectrum, SINGLE),
        ("odak, the kernel of Lightpath's band limit", corrected, banded, SINGLE),
        ("odak, its own band limit", plain, banded, None),
    ]:
        error = difference(image, expected)
        db = psnr_db(np.abs(image) ** 2, target)
        rows.append((f"hologram of Lightpath in {name}: field against Lightpath's", f"{error:.1e}", bound or "its frequencies are off"))
        rows.append((f"hologram of Lightpath in {name}: PSNR (Lightpath: {own:.1f} dB)", f"{db:.1f} dB", "" if bound is None else "±0.1 dB"))
        pictures[name] = brightest(np.abs(image) ** 2, target)
        if bound is None:
            assert error > 0.01, "odak's frequencies are the bins of the transform now: bound this case, too"
        else:
            assert error < bound, (name, error)
            assert abs(db - own) < 0.1, (name, db, own)


def odak_scored(rows):
    """A hologram of odak, judged by Lightpath and by a direct integral."""
    import judge
    import numpy as np
    import odak
    import torch
    from lightpath import local

    target = picture()
    found, _ = odak.learn.wave.stochastic_gradient_descent(
        torch.from_numpy(target), WAVELENGTH, DISTANCE, PITCH, propagation_type="Bandlimited Angular Spectrum",
        n_iteration=60, learning_rate=0.1,
    )  # fmt: skip
    phase = torch.angle(found).detach().numpy().astype(np.float32)
    display = local.DisplayModel.ideal((COLUMNS, ROWS), **OPTICS)
    quality, opinion = display.quality(phase, target, target_encoding="linear")
    exact = judge.judge(phase, target, WAVELENGTH, DISTANCE, PITCH, ROWS)
    for detector in ("point", "pixel", "supersampled"):
        own, other = getattr(quality, detector).psnr_db, exact[f"{detector}_db"]
        rows.append((f"hologram of odak, scored by Lightpath, {detector}", f"{own:.2f} dB; direct integral {other:.2f} dB", "0.1 dB"))
        assert abs(own - other) < 0.1, (detector, own, other)
    assert opinion is not None
    assert abs(opinion.independent_psnr_db - opinion.engine_psnr_db) < 0.1


def kernels(rows):
    """Kernels in the form of the paper's code: amplitude and phase of the inner half of H, written by PyTorch."""
    import numpy as np
    import odak
    import torch
    from lightpath import local

    random = torch.Generator().manual_seed(1)
    kernel = torch.rand(1, 2, ROWS, COLUMNS, generator=random)
    field = torch.polar(torch.ones(ROWS, COLUMNS), 6 * torch.rand(ROWS, COLUMNS, generator=random))
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "kernel.pt"
        torch.save(kernel, path)
        display = local.DisplayModel.load(path, resolution=(COLUMNS, ROWS), **OPTICS)
        display.save(path, "pt")
        back = torch.load(path, weights_only=True)
    transfer = odak.learn.tools.zero_pad(kernel[0, 0] * torch.exp(1j * kernel[0, 1]))
    k = odak.learn.wave.wavenumber(WAVELENGTH)
    expected = odak.learn.wave.propagate_beam(
        field, k, DISTANCE, PITCH, WAVELENGTH, propagation_type="custom", kernel=transfer, zero_padding=[True, False, True]
    )
    error = difference(local.propagate(field, kernel=display).field, expected.numpy(), piston=False)
    rows.append(("`kernel.pt` of PyTorch: field through it, against odak's", f"{error:.1e}", SINGLE))
    assert error < SINGLE
    again = back[0, 0] * torch.exp(1j * back[0, 1])
    error = difference(again.numpy(), (kernel[0, 0] * torch.exp(1j * kernel[0, 1])).numpy(), piston=False)
    rows.append(("the same kernel, written by Lightpath and read by `torch.load(weights_only=True)`", f"{error:.1e}", 1e-6))
    assert error < 1e-6
    assert back.shape == kernel.shape
    assert np.isfinite(back.numpy()).all()


def slm(rows):
    """A simulated SLM of slmsuite, whose levels delay light the less the higher they are (its default), or the more."""
    import numpy as np
    from lightpath import local
    from slmsuite.hardware.slms.simulated import SimulatedSLM

    target = picture()
    hologram = local.optimize(target, target_encoding="linear", detector="point", iterations=100, **OPTICS)
    display = hologram.kernel
    expected = hologram.quality.point.psnr_db
    device = SimulatedSLM((COLUMNS, ROWS), pitch_um=(8, 8))
    device.set_phase(hologram.phase.copy())
    realized = np.asarray(device.get_realized_phase(), np.float32)
    rest = np.angle(np.exp(1j * (realized - hologram.phase)) * np.exp(-1j * np.mean(realized[:1, :1] - hologram.phase[:1, :1])))
    rows.append(("slmsuite, `set_phase(hologram.phase)`: realized phase, without a constant", f"{np.abs(rest).max() / (2 * np.pi) * 256:.2f} levels", "1 level"))
    assert np.abs(rest).max() < 2 * np.pi / 256 * 1.01
    shown, _ = display.quality(realized, target, target_encoding="linear")
    rows.append(("slmsuite, `set_phase(hologram.phase)`: PSNR of what it shows", f"{shown.point.psnr_db:.2f} dB", f"{expected:.2f} ± 0.1 dB"))
    assert abs(shown.point.psnr_db - expected) < 0.1
    # Levels go to the hardware as they are. On an SLM whose levels delay the light less they show the conjugate field,
    # whose image is behind the SLM; such an SLM needs the phase in radians, or 256 minus the levels.
    for name, levels, good in [("levels", hologram.levels, False), ("256 - levels", (-hologram.levels).astype(np.uint8), True)]:
        device.set_phase(levels)
        shown, _ = display.quality(np.asarray(device.get_realized_phase(), np.float32), target, target_encoding="linear")
        bound = f"{expected:.2f} ± 0.1 dB" if good else "below 15 dB: the image is behind the SLM"
        rows.append((f"slmsuite, `set_phase({name})`: PSNR of what its default response shows", f"{shown.point.psnr_db:.2f} dB", bound))
        assert abs(shown.point.psnr_db - expected) < 0.1 if good else shown.point.psnr_db < 15


def picture():
    """Stripes of rising frequency, steps of grey, and a disc: linear light, 0 to 1."""
    import numpy as np

    y, x = np.mgrid[:ROWS, :COLUMNS]
    light = np.full((ROWS, COLUMNS), 0.15, np.float32)
    light[30:80, 40:220] = (0.5 + 0.5 * np.cos(2 * np.pi * (x / 60) ** 2))[30:80, 40:220]
    light[95:115, 40:220] = ((x // 20) % 9 / 8)[95:115, 40:220]
    light[(y - 145) ** 2 + (x - 90) ** 2 < 22**2] = 1
    light[(abs(y - 145) < 20) & (abs(x - 170) < 30)] = 0
    return light.astype(np.float32)


def middle(plane):
    top, left = round(0.1 * plane.shape[0]), round(0.1 * plane.shape[1])
    return plane[top : plane.shape[0] - top, left : plane.shape[1] - left]


def brightest(light, target):
    """The light in the brightness of the target."""
    return light * (middle(light) * middle(target)).sum() / (middle(light) ** 2).sum()


def psnr_db(light, target):
    import numpy as np

    return float(-10 * np.log10(np.mean((middle(brightest(light, target)) - middle(target)) ** 2)))


def difference(image, expected, *, piston=True):
    """Relative L2 error. Lightpath omits the piston exp(ikz), a constant phase that the others have."""
    import numpy as np

    image, expected = image.astype(np.complex128), expected.astype(np.complex128)
    if piston:
        overlap = np.vdot(image, expected)
        image = image * overlap / abs(overlap)
    return float(np.linalg.norm(image - expected) / np.linalg.norm(expected))


def draw(pictures, path):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, all_axes = plt.subplots(1, len(pictures), figsize=(3.6 * len(pictures), 3.2), layout="constrained")
    for axes, (name, light) in zip(all_axes, pictures.items(), strict=True):
        axes.imshow(light, cmap="gray", vmin=0, vmax=1)
        axes.set_title(name, fontsize=9)
        axes.set_axis_off()
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
