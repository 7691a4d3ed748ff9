"""What an exact model sees of a phase hologram: the angular spectrum of the first diffraction order, as a direct integral in
NumPy and float64.

    u(x, y) = integral of A(v) H(v) exp(i 2 pi (vx x + vy y)) over |vx|, |vy| <= 1/2 cycle per pixel
    A(v) = sum of exp(i phase) exp(-i 2 pi (vx x + vy y)),  H(f) = exp(i 2 pi z sqrt(1/lambda^2 - f^2)),  f = v / pitch

The integral is computed by Gauss-Legendre quadrature, 64 panels along each axis, as products of matrices: there are no Fourier
transforms and no padded frame, so light that leaves the image cannot come back into it.

Three detectors: `point`, the intensity at the pixels' centres; `pixel`, its integral over each pixel (four Gauss nodes along each
axis); `supersampled`, the intensity at (+-1/4, +-1/4) px, each place by itself. PSNR in dB for a peak of 1, the gain fitted, on
evenly distributed rows of the middle 80 % of each axis.

    python judge.py PHASE.npy TARGET.npy [--wavelength 515e-9] [--distance 0.15] [--pitch 8e-6] [--rows 96]
"""

import argparse
import json

import numpy as np

PANELS = 64


def frequencies(side, spread):
    """Nodes of each panel, [nodes, panels], in cycles per pixel, and their weights, [nodes]."""
    nodes = int(np.pi / 2 * (side + spread) / PANELS) + 8
    node, weight = np.polynomial.legendre.leggauss(nodes)
    panels = np.arange(PANELS)
    return (panels + 0.5 + 0.5 * node[:, None]) / PANELS - 0.5, 0.5 * weight / PANELS


def waves(frequency, place):
    """exp(i 2 pi frequency place), [frequencies, places]."""
    cycles = np.outer(frequency, place)
    return np.exp(2j * np.pi * (cycles - np.round(cycles)))


def field(phase, wavelength, distance, pitch, rows, columns):
    """The field at places `rows` and `columns` [px], without its piston, [rows, columns]."""
    height, width = phase.shape
    modulated = np.exp(1j * phase.astype(np.float64))
    end = 0.5 * wavelength / pitch
    spread = abs(distance) / pitch * end / np.sqrt(max(1 - 2 * end**2, 0.04))
    along_x, weight_x = frequencies(width, spread)
    along_y, weight_y = frequencies(height, spread)
    fy = along_y.ravel()
    weight_y = np.repeat(weight_y, PANELS)
    to_fy = waves(-fy, np.arange(height))
    to_rows = waves(fy, rows).T * weight_y
    image = np.zeros((len(rows), len(columns)), np.complex128)
    for fx, weight in zip(along_x, weight_x):
        spectrum = to_fy @ (modulated @ waves(-fx, np.arange(width)).T)
        squared = (wavelength / pitch) ** 2 * (fy[:, None] ** 2 + fx[None, :] ** 2)
        root = np.sqrt(np.maximum(1 - squared, 0))
        cycles = -distance / wavelength * squared / (1 + root)
        spectrum *= np.exp(2j * np.pi * (cycles - np.round(cycles))) * (squared < 1)
        image += weight * ((to_rows @ spectrum) @ waves(fx, columns))
    return image


def middle(side):
    """From 10 % to 90 %."""
    start = int(0.1 * side + 0.5)
    return start, side - start


def psnr_db(lights, target):
    """Of all given lights together, at the gain that suits them best."""
    overlap = sum(float(np.sum(light * target)) for light in lights)
    energy = sum(float(np.sum(light * light)) for light in lights)
    gain = overlap / energy if energy else 0.0
    errors = [float(np.mean((gain * light - target) ** 2)) for light in lights]
    return -10 * np.log10(np.mean(errors))


def judge(phase, target, wavelength, distance, pitch, rows_max):
    """PSNR of a phase hologram [rad] in each detector."""
    (top, bottom), (left, right) = middle(phase.shape[0]), middle(phase.shape[1])
    count = min(rows_max, bottom - top)
    rows = top + (2 * np.arange(count) + 1) * (bottom - top) // (2 * count)
    columns = np.arange(left, right)
    wanted = target[rows][:, columns].astype(np.float64)
    node, weight = np.polynomial.legendre.leggauss(4)
    places = np.concatenate([[0.0], [-0.25, 0.25], 0.5 * node])

    def beside(indices):
        return (indices[None, :] + places[:, None]).ravel()

    light = np.abs(field(phase, wavelength, distance, pitch, beside(rows), beside(columns))) ** 2
    light = light.reshape(len(places), count, len(places), len(columns))
    weights = 0.25 * np.outer(weight, weight)
    integrated = np.einsum("ij,irjc->rc", weights, light[3:, :, 3:])
    samples = [light[i, :, j] for i in (1, 2) for j in (1, 2)]
    return {
        "point_db": psnr_db([light[0, :, 0]], wanted),
        "pixel_db": psnr_db([integrated], wanted),
        "supersampled_db": psnr_db(samples, wanted),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("phase", help="phase [rad], .npy, [height, width]")
    parser.add_argument("target", help="intensity in linear light, 0 to 1, .npy, [height, width]")
    parser.add_argument("--wavelength", type=float, default=515e-9, help="[m]")
    parser.add_argument("--distance", type=float, default=0.15, help="[m]")
    parser.add_argument("--pitch", type=float, default=8e-6, help="[m]")
    parser.add_argument("--rows", type=int, default=96, help="most rows that are compared")
    given = parser.parse_args()
    phase, target = np.load(given.phase), np.load(given.target)
    print(json.dumps(judge(phase, target, given.wavelength, given.distance, given.pitch, given.rows)))


if __name__ == "__main__":
    main()
