#!/usr/bin/env python3
"""The same hologram job in Lightpath and in its peers, side by side and in turns, as a table with ratios.

Needs Python 3.10 or newer and cargo; the peers go into an environment of their own, made where it is missing (PyTorch and
what it brings: some gigabytes). See bench/README.md for what is measured and how.
"""

import argparse
import datetime
import json
import math
import os
import pathlib
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent

# Lightpath's jobs: as the peers run it; by the default method; and with the default detector and region, too.
SAME = "Lightpath, the same job"
DEFAULT = "Lightpath, its default method"
CAMERA = "Lightpath, as a camera sees it"


def main():
    given = arguments()
    python = environment(given.environment.resolve())
    bench_job = build()
    reports = []
    for source in given.target or [None]:
        with tempfile.TemporaryDirectory() as scratch:
            scratch = pathlib.Path(scratch)
            target = make_target(given, source, python, bench_job, scratch)
            runs = measure(given, python, bench_job, target, scratch)
        reports.append(summarize(given, source, python, runs))
        print(as_markdown(reports[-1]), end="\n\n", flush=True)
    text = "\n\n".join([as_markdown(report) for report in reports] + range_over_targets(reports))
    print("\n".join(range_over_targets(reports)))
    if given.out:
        pathlib.Path(f"{given.out}.md").write_text(text + "\n", encoding="utf-8")
        pathlib.Path(f"{given.out}.json").write_text(json.dumps(reports, indent=1) + "\n", encoding="utf-8")


def arguments():
    parser = argparse.ArgumentParser(
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="A try in a minute, once the environment is there:\n"
        "  bench/peers.py --size 320x180 --distance 0.05 --iterations 30 --rounds 1",
    )
    parser.add_argument(
        "--target",
        metavar="FILE",
        nargs="+",
        help="pictures or .npy of intensities, each for a comparison of its own; default: a generated test card",
    )
    parser.add_argument("--card", default="portrait", help="the generated card, where there is no --target")
    parser.add_argument("--encoding", choices=["srgb", "linear"], default="srgb", help="of the picture's values")
    parser.add_argument("--size", default="1920x1080", metavar="WIDTHxHEIGHT", help="of the display [px]")
    parser.add_argument("--pitch", type=float, default=8e-6, help="[m]")
    parser.add_argument("--wavelength", type=float, default=515e-9, help="[m]")
    parser.add_argument("--distance", type=float, default=0.15, help="[m]")
    parser.add_argument("--iterations", type=int, default=200)
    parser.add_argument("--learning-rate", type=float, default=0.1, help="of Adam [rad]")
    parser.add_argument("--phase-range", type=float, default=1.0, help="of the initial phase [rad]; odak has its own")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=3, help="turns of all jobs; times are medians over them")
    parser.add_argument("--peers", default="odak,torchoptics", help="which of them, with commas")
    parser.add_argument("--wanted-db", type=float, default=35.0, help="the quality to reach, integrated over pixels")
    parser.add_argument(
        "--environment",
        type=pathlib.Path,
        default=ROOT / "target" / "bench-environment",
        help="a virtual environment; made where it is missing, and safe to delete",
    )
    parser.add_argument("--out", metavar="PREFIX", help="write PREFIX.md and PREFIX.json")
    given = parser.parse_args()
    try:
        given.width, given.height = (int(side) for side in given.size.split("x"))
    except ValueError:
        parser.error(f"--size is {given.size}, but must be like 1920x1080")
    given.peers = [peer for peer in given.peers.split(",") if peer]
    if unknown := set(given.peers) - {"odak", "torchoptics"}:
        parser.error(f"--peers has {', '.join(sorted(unknown))}, but there are odak and torchoptics")
    return given


def environment(folder):
    python = folder / ("Scripts" if os.name == "nt" else "bin") / "python"
    complete = folder / "complete"
    if not complete.exists():
        say(f"making the peers' environment in {folder}")
        shutil.rmtree(folder, ignore_errors=True)
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", "-r", HERE / "requirements.txt"], check=True)
        complete.touch()
    return python


def engine_environment(folder):
    """The same environment with slmsuite, and lightpath and its engine as they are now, built in release."""
    python = environment(folder)
    say("installing lightpath and its engine")
    pip = [python, "-m", "pip", "install", "--quiet"]
    subprocess.run([*pip, "slmsuite==0.5.0"], check=True)
    subprocess.run([*pip, ROOT / "client" / "python"], check=True)
    return python


def build():
    say("building")
    command = ["cargo", "build", "--release", "--quiet", "-p", "lightpath-optics", "--example", "bench_job"]
    subprocess.run(command, cwd=ROOT, check=True)
    folder = ROOT / os.environ.get("CARGO_TARGET_DIR", "target")
    return folder / "release" / "examples" / "bench_job"


def make_target(given, source, python, bench_job, scratch):
    if source is None:
        source = scratch / "card.npy"
        size = ["--height", str(given.height), "--width", str(given.width), "--seed", str(given.seed)]
        subprocess.run([bench_job, "--card", given.card, *size, "--out", source], check=True)
    target = scratch / "target.npy"
    size = [str(given.width), str(given.height)]
    subprocess.run([python, HERE / "prepare.py", source, target, *size, given.encoding], check=True)
    return target


def measure(given, python, bench_job, target, scratch):
    """The runs of each job, in turns, each judged by the exact model."""
    optics = [
        "--wavelength", str(given.wavelength), "--distance", str(given.distance), "--pitch", str(given.pitch),
    ]  # fmt: skip
    job = [
        *optics, "--target", str(target), "--iterations", str(given.iterations), "--seed", str(given.seed),
        "--learning-rate", str(given.learning_rate), "--phase-range", str(given.phase_range),
        "--threads", str(given.threads),
    ]  # fmt: skip
    found = ["--method", "lbfgs", "--start", "recommended"]
    commands = {
        SAME: [bench_job, *job, "--detector", "point", "--region", "full", "--propagation", "band-limited"],
        DEFAULT: [bench_job, *job, *found, "--detector", "point", "--region", "full"],
        CAMERA: [bench_job, *job, *found, "--detector", "pixel", "--region", "middle"],
    }
    for peer in given.peers:
        commands[peer] = [python, HERE / "torch_job.py", peer, *job]
    runs = {name: [] for name in commands}
    for turn in range(given.rounds):
        for name, command in commands.items():
            say(f"round {turn + 1} of {given.rounds}: {name}")
            phase = scratch / "phase.npy"
            run = output(given, [*command, "--out", phase], scratch)
            judged = [python, HERE / "judge.py", phase, target, *optics]
            runs[name].append({**run, "exact": output(given, judged, scratch)})
    return runs


def output(given, command, scratch):
    """The JSON that a command prints last; whatever else it writes stays in `scratch`."""
    threads = {name: str(given.threads) for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    done = subprocess.run(
        [str(part) for part in command], cwd=scratch, env={**os.environ, **threads}, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))}\nended with {done.returncode}:\n{done.stderr}")
    return json.loads(done.stdout.strip().splitlines()[-1])


def summarize(given, source, python, runs):
    reported_db = None
    if "odak" in runs:
        # odak compares without a gain; with the best one its own figure is a little higher, and the harder one to reach.
        reported_db = median(max(run["reported_db"], run["reported_at_best_gain_db"]) for run in runs["odak"])
    jobs = {}
    for name, turns in runs.items():
        memory = [run["memory_peak_bytes"] for run in turns if run["memory_peak_bytes"]]
        to_reported = [time_to(run, reported_db) for run in turns]
        if name == "odak":
            to_reported = [run["total_s"] for run in turns]
        elif name == CAMERA:
            # Its loss is another one.
            to_reported = [None]
        jobs[name] = {
            "iteration_ms": median(1e3 * statistics.median(steps(run)) for run in turns),
            "total_s": median(run["total_s"] for run in turns),
            "to_reported_s": median(to_reported),
            "to_wanted_pixel_s": median(time_to(run, given.wanted_db) for run in turns)
            if name == CAMERA
            else None,
            "memory_peak_mib": max(memory) / 2**20 if memory else None,
            "own_model_db": median(-10 * math.log10(run["loss"][-1]) for run in turns),
            "exact_db": {
                detector: median(run["exact"][f"{detector}_db"] for run in turns)
                for detector in ("point", "pixel", "supersampled")
            },
        }
    return {
        "date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%d"),
        "machine": machine(given),
        "versions": versions(python, given.peers),
        "target": pathlib.Path(source).name if source else f"test card {given.card}",
        "encoding": given.encoding if source else "linear",
        "size_px": [given.width, given.height],
        "pixel_pitch_m": given.pitch,
        "wavelength_m": given.wavelength,
        "distance_m": given.distance,
        "iterations": given.iterations,
        "learning_rate_rad": given.learning_rate,
        "initial_phase_range_rad": given.phase_range,
        "rounds": given.rounds,
        "wanted_pixel_db": given.wanted_db,
        "odak_reported_db": reported_db,
        "jobs": jobs,
    }


def steps(run):
    """Times of single iterations [s], without the first, which makes plans and memory."""
    times = run["time_s"]
    return [after - before for before, after in zip(times, times[1:])] or times


def time_to(run, wanted_db):
    """When the job's own loss first was this good [s]; None where it never was."""
    if wanted_db is None:
        return None
    reached = (time for time, loss in zip(run["time_s"], run["loss"]) if -10 * math.log10(loss) >= wanted_db)
    return next(reached, None)


def median(values):
    """None where any of them is."""
    values = list(values)
    return None if None in values else statistics.median(values)


def machine(given):
    model = platform.processor() or platform.machine()
    try:
        lines = pathlib.Path("/proc/cpuinfo").read_text(encoding="ascii").splitlines()
        model = next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    return f"{model}, {given.threads} threads of {os.cpu_count()}"


def versions(python, peers):
    script = "import importlib.metadata as m, sys; print(' '.join(m.version(p) for p in sys.argv[1:]))"
    names = [*peers, "torch", "numpy"]
    found = subprocess.run([python, "-c", script, *names], stdout=subprocess.PIPE, text=True, check=True)
    return dict(zip(names, found.stdout.split()))


def as_markdown(report):
    base = report["jobs"][SAME]
    reported = report["odak_reported_db"]
    width, height = report["size_px"]
    to_reported = f"s to {reported:.1f} dB" if reported is not None else "s to odak's dB"
    lines = [
        f"{report['date']}, {report['machine']}; " + ", ".join(f"{k} {v}" for k, v in report["versions"].items()) + ".",
        f"{report['target']}, {width}×{height} px of {1e6 * report['pixel_pitch_m']:g} µm, "
        f"{1e9 * report['wavelength_m']:g} nm, {1e3 * report['distance_m']:g} mm, Adam {report['learning_rate_rad']:g}, "
        f"{report['iterations']} iterations; medians of {report['rounds']} rounds in turns.",
        "",
        f"| | ms an iteration | {to_reported} | peak memory [MiB] | own model [dB] | exact: point | pixel | supersampled |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, job in report["jobs"].items():
        exact = job["exact_db"]
        cells = [
            with_ratio(job["iteration_ms"], base["iteration_ms"]),
            with_ratio(job["to_reported_s"], base["to_reported_s"], 2),
            with_ratio(job["memory_peak_mib"], base["memory_peak_mib"], 0),
            *(f"{value:.1f}" for value in (job["own_model_db"], *exact.values())),
        ]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    camera = report["jobs"][CAMERA]
    wanted, reached = report["wanted_pixel_db"], camera["to_wanted_pixel_s"]
    said = "not reached" if reached is None else f"{reached:.2f} s"
    peers = [(name, job["exact_db"]["pixel"]) for name, job in report["jobs"].items() if not name.startswith("Lightpath")]
    ends = "".join(f"; {name} ends at {pixel_db:.1f} dB" for name, pixel_db in peers)
    lines += ["", f"Time to {wanted:g} dB integrated over pixels: Lightpath {said}{ends}."]
    return "\n".join(lines)


def range_over_targets(reports):
    """How many times shorter the time to odak's own figure is, over all targets; empty without odak."""
    lines = []
    for name in (SAME, DEFAULT):
        times = [(report["jobs"].get("odak"), report["jobs"][name]) for report in reports]
        ratios = [odak["to_reported_s"] / own["to_reported_s"] for odak, own in times if odak and own["to_reported_s"]]
        if ratios:
            lines.append(
                f"Time to odak's own figure, {name}: {min(ratios):.0f} to {max(ratios):.0f} times shorter "
                f"(median {statistics.median(ratios):.0f}, {len(ratios)} targets)."
            )
    return lines


def with_ratio(value, base, digits=1):
    if value is None:
        return "–"
    text = f"{value:.{digits}f}"
    return text if base is None or value == base else f"{text} (×{value / base:.1f})"


def say(text):
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
