"""Propagates a field several times in one package; prints a line of JSON, and writes the image.

    python propagate_job.py PACKAGE FIELD.npy IMAGE.npy --calls 7

| package | what runs |
|---|---|
| `lightpath` | `lightpath.local`, complex64 |
| `odak` | `propagate_beam`, twofold padding, complex64 |
| `torchoptics` | its angular spectrum method, twofold padding, complex128: its own precision |

*whole* is a call that also makes the transfer function, *prepared* one with a transfer function made before. All packages propagate by
the angular spectrum, with its band limit in odak; Lightpath's default method takes a transfer function of the same size.
"""

import argparse
import json
import time

import numpy as np


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("package", choices=["lightpath", "odak", "torchoptics"])
    parser.add_argument("field", help="complex64, .npy")
    parser.add_argument("image", help="where to write the image, .npy")
    parser.add_argument("--method", default="angular-spectrum", help="of Lightpath")
    parser.add_argument("--calls", type=int, default=7)
    parser.add_argument("--wavelength", type=float, default=515e-9, help="[m]")
    parser.add_argument("--distance", type=float, default=0.15, help="[m]")
    parser.add_argument("--pitch", type=float, default=8e-6, help="[m]")
    parser.add_argument("--threads", type=int, default=2)
    given = parser.parse_args()
    field = np.load(given.field)
    package = {"lightpath": lightpath_calls, "odak": odak_calls}.get(given.package, torchoptics_calls)
    whole, prepare = package(field, given)
    before = memory_bytes("VmRSS")
    whole_s, image = timed(whole, given.calls)
    prepared = prepare()
    prepared_s, _ = timed(prepared, given.calls)
    np.save(given.image, np.asarray(image))
    memory = {"memory_before_bytes": before, "memory_peak_bytes": memory_bytes("VmHWM")}
    print(json.dumps({"whole_s": whole_s, "prepared_s": prepared_s, **memory}))


def lightpath_calls(field, given):
    from lightpath import local

    optics = {"wavelength": given.wavelength, "pixel_pitch": given.pitch, "distance": given.distance, "method": given.method}
    rows, columns = field.shape
    return lambda: local.propagate(field, **optics).field, lambda: bind(local.Propagator((columns, rows), **optics), field)


def odak_calls(field, given):
    import odak
    import torch

    torch.set_num_threads(given.threads)
    field, k = torch.from_numpy(field), odak.learn.wave.wavenumber(given.wavelength)
    rows, columns = (2 * side for side in field.shape)
    optics = [k, given.distance, given.pitch, given.wavelength]

    def whole():
        padding = {"zero_padding": [True, False, True]}
        return odak.learn.wave.propagate_beam(field, *optics, propagation_type="Bandlimited Angular Spectrum", **padding)

    def prepare():
        kernel = odak.learn.wave.get_band_limited_angular_spectrum_kernel(rows, columns, given.pitch, given.wavelength, given.distance)
        padding = {"zero_padding": [True, False, True]}
        return lambda: odak.learn.wave.propagate_beam(field, *optics, propagation_type="custom", kernel=kernel, **padding)

    return whole, prepare


def torchoptics_calls(field, given):
    import torch
    import torchoptics
    from torchoptics.propagation.angular_spectrum_method import apply_transfer_function, calculate_transfer_function

    torch.set_num_threads(given.threads)
    torchoptics.set_default_spacing(given.pitch)
    torchoptics.set_default_wavelength(given.wavelength)
    rows, columns = field.shape
    source = torchoptics.Field(torch.from_numpy(field.astype(np.complex128)), z=0)
    padding = [rows // 2, columns // 2]

    def whole():
        return source.propagate_to_z(given.distance, propagation_method="ASM", asm_pad=padding).data

    def prepare():
        pad = torch.tensor(padding)
        transfer = calculate_transfer_function(source, torch.tensor(given.distance, dtype=torch.double), pad, "ASM")
        inside = (slice(rows // 2, rows // 2 + rows), slice(columns // 2, columns // 2 + columns))
        return lambda: apply_transfer_function(transfer, source, pad)[inside].contiguous()

    return whole, prepare


def bind(work, field):
    return lambda: work(field)


def timed(work, calls):
    """Times of all calls but the first, which makes plans and memory, and what the last one returned."""
    times = []
    for _ in range(calls + 1):
        start = time.perf_counter()
        result = work()
        times.append(time.perf_counter() - start)
    return times[1:], result


def memory_bytes(name):
    """Of the process; None where the system does not tell."""
    try:
        with open("/proc/self/status", encoding="ascii") as status:
            lines = dict(line.split(":", 1) for line in status)
        return 1024 * int(lines[name].split()[0])
    except (OSError, KeyError):
        return None


if __name__ == "__main__":
    main()
