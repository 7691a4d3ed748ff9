#!/usr/bin/env python3
"""Propagation of one field in Lightpath (in Python), odak and torchoptics: agreement, time and memory side by side.

    bench/propagators.py --out bench-propagators

Each package runs in a process of its own, in turns. The errors are relative L2 errors of the field against the same formula in NumPy and
float64, and, on some rows, against the integral over the pixels' band without transforms and padding (judge.py). Prints a table and
writes PREFIX.md and PREFIX.json. Needs what bench/peers.py needs.
"""

import argparse
import datetime
import json
import os
import pathlib
import statistics
import subprocess
import tempfile

import peers

JOBS = {
    "Lightpath": ["lightpath"],
    "Lightpath, its default method": ["lightpath", "--method", "auto"],
    "odak": ["odak"],
    "torchoptics": ["torchoptics"],
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", default="1920x1080", metavar="WIDTHxHEIGHT", help="of the field [px]")
    parser.add_argument("--wavelength", type=float, default=515e-9, help="[m]")
    parser.add_argument("--distance", type=float, default=0.15, help="[m]")
    parser.add_argument("--pitch", type=float, default=8e-6, help="[m]")
    parser.add_argument("--calls", type=int, default=7, help="of each kind in a process")
    parser.add_argument("--rounds", type=int, default=3, help="turns of all packages")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--exact-rows", type=int, default=8, help="rows compared with the integral")
    parser.add_argument("--environment", type=pathlib.Path, default=peers.ROOT / "target" / "bench-environment")
    parser.add_argument("--python", type=pathlib.Path, help="a Python that has all packages, instead of --environment")
    parser.add_argument("--out", default="bench-propagators", metavar="PREFIX")
    given = parser.parse_args()
    python = given.python or peers.engine_environment(given.environment.resolve())
    width, height = (int(side) for side in given.size.split("x"))
    optics = ["--wavelength", given.wavelength, "--distance", given.distance, "--pitch", given.pitch]
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        make = [python, peers.HERE / "propagate_errors.py", scratch, "--size", width, height, *optics]
        run([*make, "--make"], scratch, given)
        runs = {name: [] for name in JOBS}
        for turn in range(given.rounds):
            for name, job in JOBS.items():
                peers.say(f"round {turn + 1} of {given.rounds}: {name}")
                files = [scratch / "field.npy", scratch / f"{name}.npy"]
                command = [python, peers.HERE / "propagate_job.py", job[0], *files, *job[1:], *optics]
                runs[name].append(json.loads(run([*command, "--calls", given.calls, "--threads", given.threads], scratch, given)))
        peers.say("comparing")
        errors = json.loads(run([*make, "--exact-rows", given.exact_rows, "--images", *JOBS], scratch, given))
    report = {name: summarized(turns, errors[name]) for name, turns in runs.items()}
    text = as_markdown(report, given)
    print(text)
    pathlib.Path(f"{given.out}.md").write_text(text + "\n", encoding="utf-8")
    pathlib.Path(f"{given.out}.json").write_text(json.dumps({"runs": runs, "errors": errors}, indent=1) + "\n", encoding="utf-8")


def run(command, folder, given):
    names = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS")
    threads = {name: str(given.threads) for name in names}
    command = [str(part) for part in command]
    done = subprocess.run(command, cwd=folder, env={**os.environ, **threads}, stdout=subprocess.PIPE, text=True, check=True)
    return (done.stdout.strip().splitlines() or [""])[-1]


def summarized(turns, errors):
    def middle(name):
        return 1e3 * statistics.median(each for turn in turns for each in turn[name])

    peak = max(turn["memory_peak_bytes"] or 0 for turn in turns) / 2**20
    before = statistics.median(turn["memory_before_bytes"] or 0 for turn in turns) / 2**20
    return {"whole_ms": middle("whole_s"), "prepared_ms": middle("prepared_s"), "peak": peak, "grown": peak - before, **errors}


def as_markdown(report, given):
    base = report["Lightpath"]
    load = " ".join(f"{each:.1f}" for each in os.getloadavg())
    lines = [
        f"{datetime.date.today()}, {peers.machine(given)}, load at the end {load}; {given.size} px of {1e6 * given.pitch:g} µm, "
        f"{1e9 * given.wavelength:g} nm, {1e3 * given.distance:g} mm; medians of {given.rounds} rounds with {given.calls} calls.",
        "",
        "| | whole call [ms] | prepared [ms] | peak memory [MiB] | more than before the first call [MiB] | error: same formula in float64 "
        "| error: integral over the band |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, row in report.items():
        cells = [peers.with_ratio(row[key], base[key], 0) for key in ("whole_ms", "prepared_ms", "peak", "grown")]
        same = "–" if row["same"] is None else f"{row['same']:.1e}"
        lines.append(f"| {name} | " + " | ".join(cells) + f" | {same} | {row['exact']:.1e} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
