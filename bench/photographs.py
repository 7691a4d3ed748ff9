#!/usr/bin/env python3
"""How much of what a photograph lacks is the display's fault, and how much that of the model that made the hologram?

Takes photographs of holograms that odak's recipe made for an ideal display, and the targets. Makes the holograms again with odak,
shows them on a simulated display without flaws, whose light is computed exactly, and scores what a camera sees there
and the real photographs by the same means. Does the same with Lightpath's holograms. Prints a table.

    bench/photographs.py --target usaf1951.png --photo usaf1951_ideal.png usaf1951_learned.png

The display is that of Kavakli, Urey and Aksit (2022): 1920x1080 px of 8 um, 515 nm, 0.15 m. The recipe takes a target's values as
they are stored. Needs what bench/peers.py needs.
"""

import argparse
import contextlib
import json
import os
import pathlib
import subprocess
import tempfile
import time

import peers

PIXELS = (1920, 1080)
OPTICS = ["--wavelength", "515e-9", "--distance", "0.15", "--pitch", "8e-6"]
# A seed draws flaws in proportion to the strength: there are none. The camera has little noise.
PERFECT = ["--simulated-seed", "1", "--simulated-strength", "1e-6", "--camera-noise", "1e-4"]
COLUMNS = {
    "psnrDb": ("PSNR", "{:.1f} dB"),
    "psnrWithOffsetDb": ("with offset", "{:.1f} dB"),
    "ssim": ("SSIM", "{:.2f}"),
    "speckleContrast": ("speckle contrast", "{:.2f}"),
    "resolutionCyclesPerPx": ("resolution [cycles/px]", "{:.3f}"),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--target", required=True, type=pathlib.Path, help="the target picture")
    parser.add_argument("--photo", nargs="*", default=[], type=pathlib.Path, help="photographs of holograms of this target")
    parser.add_argument("--iterations", type=int, default=200, help="of odak's gradient descent")
    parser.add_argument("--environment", type=pathlib.Path, default=peers.ROOT / "target" / "bench-environment")
    parser.add_argument("--keep", type=pathlib.Path, help="keep the holograms and what is seen of them in this folder")
    given = parser.parse_args()
    python = peers.environment(given.environment.resolve())
    programs = build()
    with contextlib.ExitStack() as stack:
        folder = given.keep.resolve() if given.keep else pathlib.Path(stack.enter_context(tempfile.TemporaryDirectory()))
        folder.mkdir(parents=True, exist_ok=True)
        lightpath = stack.enter_context(server(programs, folder))
        lightpath("display", "create", "perfect", "--resolution", "1920x1080", "--pixel-pitch", "8um", "--wavelength", "515nm", *PERFECT)
        holograms = {"odak": folder / "odak.png", "Lightpath": folder / "lightpath.png"}
        odak_hologram(given, python, folder, holograms["odak"])
        show = ["--display", "perfect", "--distance", "150mm"]
        peers.say("Lightpath's hologram")
        lightpath("hologram", "optimize", given.target, *show, "--target-encoding", "linear", "-o", holograms["Lightpath"])
        rows = {}
        for name, hologram in holograms.items():
            seen = folder / f"{hologram.stem}-seen.png"
            lightpath("simulate", *show, "--pattern", hologram, "-o", seen)
            rows[f"{name}'s hologram on a display without flaws"] = score(lightpath, given.target, seen)
        for photo in given.photo:
            rows[photo.stem] = score(lightpath, given.target, photo)
    print(table(given.target.stem, rows))


def build():
    peers.say("building")
    subprocess.run(["cargo", "build", "--release", "--quiet", "--bins"], cwd=peers.ROOT, check=True)
    return peers.ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "release"


@contextlib.contextmanager
def server(programs, folder):
    """A server for this run; gives a function that runs the command line and returns its output."""
    with tempfile.TemporaryDirectory() as data:
        log = (folder / "server.log").open("w")
        command = [programs / "lightpathd", "serve", "--data-dir", data, "--listen", "127.0.0.1:0"]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True)
        try:
            url = process.stdout.readline().split()[-1]

            def lightpath(*words):
                done = subprocess.run([programs / "lightpath", "--server", url, *words], check=True, capture_output=True, text=True)
                return done.stdout

            yield lightpath
        finally:
            process.terminate()
            process.wait()
            log.close()


def odak_hologram(given, python, folder, out):
    """The hologram as grey levels: the phase as a part of 2 pi, of 256."""
    target, phase = folder / "target.npy", folder / "odak.npy"
    size = [str(side) for side in PIXELS]
    prepare = [python, peers.HERE / "prepare.py", given.target.resolve(), target, *size, "linear"]
    subprocess.run(prepare, cwd=folder, check=True)
    peers.say("odak's hologram: some minutes")
    started = time.monotonic()
    job = ["--target", target, "--out", phase, "--iterations", str(given.iterations), *OPTICS]
    # odak leaves a log in the folder that it runs in.
    job = [python, peers.HERE / "torch_job.py", "odak", *job]
    done = subprocess.run(job, cwd=folder, check=True, capture_output=True, text=True)
    reported = json.loads(done.stdout)
    peers.say(f"odak's own figure: {reported['reported_at_best_gain_db']:.1f} dB, after {time.monotonic() - started:.0f} s")
    script = (
        "import sys, numpy as np; from PIL import Image; phase = np.load(sys.argv[1]); "
        "Image.fromarray((np.round(phase / (2 * np.pi) * 256) % 256).astype(np.uint8)).save(sys.argv[2])"
    )
    subprocess.run([python, "-c", script, phase, out], check=True)


def score(lightpath, target, photo):
    peers.say(f"scoring {photo.name}")
    answer = lightpath("photo", "score", photo, "--target", target, "--target-encoding", "linear", "--output", "json")
    return json.loads(answer)["channels"][0]


def table(target, rows):
    lines = [f"| {target} | " + " | ".join(name for name, _ in COLUMNS.values()) + " |", "|---" * (1 + len(COLUMNS)) + "|"]
    for name, row in rows.items():
        cells = [form.format(row[key]) if row.get(key) is not None else "" for key, (_, form) in COLUMNS.items()]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
