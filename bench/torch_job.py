"""One hologram job in a PyTorch package; prints a line of JSON as `optics/examples/bench_job.rs` does.

`odak`: its `stochastic_gradient_descent` as it is; a loss function is handed in that is the default one and takes the time.
`torchoptics`: a phase modulator, its angular spectrum method with twofold padding, and PyTorch's Adam on the same loss.
"""

import argparse
import json
import math
import time

import numpy as np
import torch


class Clock:
    """Mean squared error over the full frame, with the time at which each was known."""

    def __init__(self):
        self.start = time.perf_counter()
        self.time_s, self.loss = [], []

    def __call__(self, light, target):
        loss = torch.nn.functional.mse_loss(light, target)
        self.loss.append(float(loss))
        self.time_s.append(time.perf_counter() - self.start)
        return loss


def odak_job(target, given, clock):
    from odak.learn.wave import stochastic_gradient_descent

    hologram, reconstruction = stochastic_gradient_descent(
        target,
        given.wavelength,
        given.distance,
        given.pitch,
        propagation_type="Bandlimited Angular Spectrum",
        n_iteration=given.iterations,
        loss_function=clock,
        learning_rate=given.learning_rate,
    )
    return torch.angle(hologram).detach(), (reconstruction.abs() ** 2).detach()


def torchoptics_job(target, given, clock):
    import torchoptics

    torchoptics.set_default_spacing(given.pitch)
    torchoptics.set_default_wavelength(given.wavelength)
    # Its own precision is double: in single, k·z alone would be off by a tenth of a radian.
    target = target.double()
    phase = (given.phase_range * torch.rand(target.shape, dtype=torch.double)).requires_grad_()
    optimizer = torch.optim.Adam([phase], lr=given.learning_rate)
    padding = [target.shape[0] // 2, target.shape[1] // 2]

    def light():
        field = torchoptics.Field(torch.exp(1j * phase), z=0)
        seen = field.propagate_to_z(given.distance, propagation_method="ASM", asm_pad=padding)
        return seen.data.abs() ** 2

    for _ in range(given.iterations):
        optimizer.zero_grad()
        clock(light(), target).backward()
        optimizer.step()
    with torch.no_grad():
        return phase.detach(), light()


def reported_db(light, target):
    """PSNR that the package's own model sees over the full frame: as it is, and at the gain that suits it best."""
    light, target = light.double().numpy(), target.double().numpy()
    gain = float(np.sum(light * target) / np.sum(light * light))
    return [-10 * math.log10(np.mean((s * light - target) ** 2)) for s in (1.0, gain)]


def memory_peak_bytes():
    """Of the whole process; None where the system does not tell."""
    try:
        with open("/proc/self/status", encoding="ascii") as status:
            lines = dict(line.split(":", 1) for line in status)
        return 1024 * int(lines["VmHWM"].split()[0])
    except (OSError, KeyError):
        return None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("package", choices=["odak", "torchoptics"])
    parser.add_argument("--target", required=True, help="intensity, .npy")
    parser.add_argument("--out", required=True, help="phase [rad], .npy")
    parser.add_argument("--iterations", type=int, default=200)
    parser.add_argument("--learning-rate", type=float, default=0.1)
    parser.add_argument("--phase-range", type=float, default=1.0, help="[rad]; odak draws normal numbers of its own")
    parser.add_argument("--wavelength", type=float, default=515e-9, help="[m]")
    parser.add_argument("--distance", type=float, default=0.15, help="[m]")
    parser.add_argument("--pitch", type=float, default=8e-6, help="[m]")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    given = parser.parse_args()

    torch.set_num_threads(given.threads)
    torch.manual_seed(given.seed)
    target = torch.from_numpy(np.load(given.target).astype(np.float32))
    clock = Clock()
    job = odak_job if given.package == "odak" else torchoptics_job
    phase, light = job(target, given, clock)
    total_s = time.perf_counter() - clock.start
    reported, reported_at_best_gain = reported_db(light, target)
    np.save(given.out, phase.numpy().astype(np.float32))
    print(
        json.dumps(
            {
                "time_s": clock.time_s,
                "loss": clock.loss,
                "total_s": total_s,
                "reported_db": reported,
                "reported_at_best_gain_db": reported_at_best_gain,
                "memory_peak_bytes": memory_peak_bytes(),
            }
        )
    )


if __name__ == "__main__":
    main()
