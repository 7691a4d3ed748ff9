"""Makes the field that bench/propagators.py propagates, and compares the images of the packages with two references in float64.

    python propagate_errors.py FOLDER --size 1920 1080 --make
    python propagate_errors.py FOLDER --size 1920 1080 --images Lightpath odak

The field has a smooth random phase, as holograms have, and a constant amplitude. `same` is the relative L2 error against the formula that
the package computes, on the padded frame; None for Lightpath's default method, which has no padded frame. `exact` is that against the
integral over the band of the pixels (judge.py) on some rows. The piston exp(ikz) is fitted.
"""

import argparse
import json
import pathlib

import judge
import numpy as np

BAND_LIMITED = "odak"
WITHOUT_FRAME = "Lightpath, its default method"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--size", nargs=2, type=int, required=True, metavar=("WIDTH", "HEIGHT"))
    parser.add_argument("--make", action="store_true", help="write field.npy and do no more")
    parser.add_argument("--images", nargs="*", default=[], help="files without .npy")
    parser.add_argument("--exact-rows", type=int, default=8)
    parser.add_argument("--wavelength", type=float, default=515e-9, help="[m]")
    parser.add_argument("--distance", type=float, default=0.15, help="[m]")
    parser.add_argument("--pitch", type=float, default=8e-6, help="[m]")
    given = parser.parse_args()
    width, height = given.size
    if given.make:
        # Single precision has rounding errors enough: the phase is rounded before, so that all packages get the same field.
        phase = smooth_phase(height, width).astype(np.float32)
        np.save(given.folder / "phase.npy", phase)
        np.save(given.folder / "field.npy", np.exp(1j * phase.astype(np.float64)).astype(np.complex64))
        return
    phase = np.load(given.folder / "phase.npy")
    field = np.load(given.folder / "field.npy").astype(np.complex128)
    spectrum = np.fft.fft2(field, s=(2 * height, 2 * width))
    plain, limited = transfers(height, width, given)
    same = {False: back(spectrum * plain, field.shape), True: back(spectrum * limited, field.shape)}
    rows = (2 * np.arange(given.exact_rows) + 1) * height // (2 * given.exact_rows)
    exact = judge.field(phase, given.wavelength, given.distance, given.pitch, rows, np.arange(width))
    found = {}
    for name in given.images:
        image = np.load(given.folder / f"{name}.npy").astype(np.complex128)
        formula = None if name == WITHOUT_FRAME else difference(image, same[name == BAND_LIMITED])
        found[name] = {"same": formula, "exact": difference(image[rows], exact)}
    print(json.dumps(found))


def smooth_phase(height, width):
    """Random phases in [0, 1) rad: the light spreads over the band of the pixels, but is strongest in its middle."""
    return np.random.default_rng(1).random((height, width))


def transfers(height, width, given):
    """H of the angular spectrum without its piston, and with Matsushima's band limit in the form that odak has."""
    fy = np.fft.fftfreq(2 * height, given.pitch)[:, np.newaxis]
    fx = np.fft.fftfreq(2 * width, given.pitch)[np.newaxis]
    squared = given.wavelength**2 * (fx**2 + fy**2)
    plain = np.exp(-2j * np.pi * given.distance / given.wavelength * squared / (1 + np.sqrt(1 - squared)))

    def limit(side):
        return 1 / (given.wavelength * np.sqrt((2 * given.distance / (2 * side * given.pitch)) ** 2 + 1))

    return plain, plain * ((abs(fx) < limit(width)) & (abs(fy) < limit(height)))


def back(spectrum, shape):
    return np.fft.ifft2(spectrum)[: shape[0], : shape[1]]


def difference(image, expected):
    overlap = np.vdot(image, expected)
    return float(np.linalg.norm(image * overlap / abs(overlap) - expected) / np.linalg.norm(expected))


if __name__ == "__main__":
    main()
