"""What an exact model sees of a phase hologram: an independent band-limited angular spectrum in NumPy, all in float64.

    H(fx, fy) = exp(i 2 pi z sqrt(1/lambda^2 - fx^2 - fy^2)),  zero-padded twofold, exact frequencies n/(N pitch)
    kept where (fx/limit_x)^2 + (lambda fy)^2 <= 1 and (fy/limit_y)^2 + (lambda fx)^2 <= 1,
    limit = 1 / (lambda sqrt((2 z / (N pitch))^2 + 1))            (Matsushima and Shimobaba 2009)

Three detectors: `point`, the intensity at the pixels' centres; `pixel`, the mean of four sub-samples at (+-1/4, +-1/4) px;
`supersampled`, each of those by itself. PSNR in dB for a peak of 1, the gain fitted, in the middle 80 % of each axis.

    python judge.py PHASE.npy TARGET.npy [--wavelength 515e-9] [--distance 0.15] [--pitch 8e-6]
"""

import argparse
import json

import numpy as np


def transfer_function(height, width, wavelength, distance, pitch):
    """H on the padded grid of (height, width), without its piston; zero where it is not sampled finely enough."""
    fy = np.fft.fftfreq(height, pitch)[:, None]
    fx = np.fft.fftfreq(width, pitch)[None, :]
    squared = fx**2 + fy**2
    root = np.sqrt(np.maximum(1 - wavelength**2 * squared, 0))
    cycles = -distance * wavelength * squared / (1 + root)

    def limit(samples):
        return 1 / (wavelength * np.sqrt((2 * distance / (samples * pitch)) ** 2 + 1))

    kept = (fx / limit(width)) ** 2 + (wavelength * fy) ** 2 <= 1
    kept &= (fy / limit(height)) ** 2 + (wavelength * fx) ** 2 <= 1
    return np.exp(2j * np.pi * (cycles - np.round(cycles))) * kept


def middle(side):
    """From 10 % to 90 %."""
    start = int(0.1 * side + 0.5)
    return slice(start, side - start)


def psnr_db(lights, target):
    """Of all given lights together, at the gain that suits them best."""
    overlap = sum(float(np.sum(light * target)) for light in lights)
    energy = sum(float(np.sum(light * light)) for light in lights)
    gain = overlap / energy if energy else 0.0
    errors = [float(np.mean((gain * light - target) ** 2)) for light in lights]
    return -10 * np.log10(np.mean(errors))


def judge(phase, target, wavelength, distance, pitch):
    """PSNR of a phase hologram [rad] in each detector."""
    height, width = phase.shape
    padded = np.zeros((2 * height, 2 * width), np.complex128)
    padded[:height, :width] = np.exp(1j * phase.astype(np.float64))
    spectrum = np.fft.fft2(padded)
    spectrum *= transfer_function(2 * height, 2 * width, wavelength, distance, pitch)
    del padded
    fy = np.fft.fftfreq(2 * height)[:, None]
    fx = np.fft.fftfreq(2 * width)[None, :]
    region = (middle(height), middle(width))
    wanted = target[region].astype(np.float64)

    def light(dy, dx):
        field = np.fft.ifft2(spectrum * np.exp(2j * np.pi * (fy * dy + fx * dx)))
        return (np.abs(field[:height, :width]) ** 2)[region]

    samples = [light(dy, dx) for dy in (-0.25, 0.25) for dx in (-0.25, 0.25)]
    return {
        "point_db": psnr_db([light(0.0, 0.0)], wanted),
        "pixel_db": psnr_db([sum(samples) / 4], wanted),
        "supersampled_db": psnr_db(samples, wanted),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("phase", help="phase [rad], .npy, [height, width]")
    parser.add_argument("target", help="intensity in linear light, 0 to 1, .npy, [height, width]")
    parser.add_argument("--wavelength", type=float, default=515e-9, help="[m]")
    parser.add_argument("--distance", type=float, default=0.15, help="[m]")
    parser.add_argument("--pitch", type=float, default=8e-6, help="[m]")
    given = parser.parse_args()
    phase, target = np.load(given.phase), np.load(given.target)
    print(json.dumps(judge(phase, target, given.wavelength, given.distance, given.pitch)))


if __name__ == "__main__":
    main()
