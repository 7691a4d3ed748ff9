#!/usr/bin/env python3
"""Compile the engine of `lightpath.local`, and print the path of the library.

Every build and every installation of the package runs this (hatch_build.py). Options are variables:

- LIGHTPATH_ENGINE=none: there is no engine, and nothing is printed. The package is then the client of a server alone.
- LIGHTPATH_ENGINE=PATH: a library that is compiled already, such as target/debug/liblightpath_python_engine.so.
- CARGO_TARGET_DIR: where cargo keeps what it compiled. By default `target` of the checkout, so that it compiles once.

With the path of a folder it writes there what a source distribution needs: the engine's crates with a workspace of
their own.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ENGINE = "lightpath-python-engine"


def main() -> None:
    """Print the path of the library, or write the sources into the folder that the first argument names."""
    if len(sys.argv) > 1:
        write_sources(Path(sys.argv[1]))
        return
    given = os.environ.get("LIGHTPATH_ENGINE", "")
    if given == "none":
        return
    library = Path(given).resolve() if given else compiled()
    if not library.is_file():
        sys.exit(f"LIGHTPATH_ENGINE is {given}, which is no file: give the path of the engine's library, or none")
    print(library)


def compiled() -> Path:
    """Compile the engine, and return the path of its library."""
    if shutil.which("cargo") is None:
        sys.exit(
            "cargo was not found. The engine of lightpath.local is compiled by Rust 1.94 or newer: install it from"
            " https://rustup.rs, or install the client of a server alone with LIGHTPATH_ENGINE=none."
        )
    announce("Compiling Lightpath's engine, which takes some minutes. LIGHTPATH_ENGINE=none would leave it out.")
    begin = time.monotonic()
    command = ["cargo", "build", "--release", "--package", ENGINE, "--message-format", "json-render-diagnostics"]
    # A source distribution has the lock file of the whole workspace, from which cargo removes what is not here.
    command += [] if workspace() == HERE / "rust" else ["--locked"]
    # With the stable interface of Python (abi3) a build asks no Python for anything.
    done = subprocess.run(command, cwd=workspace(), stdout=subprocess.PIPE, check=False)
    if done.returncode != 0:
        sys.exit("The engine was not compiled; pip install --verbose shows why.")
    announce(f"Compiled Lightpath's engine in {time.monotonic() - begin:.0f} s.")
    for line in reversed(done.stdout.splitlines()):
        message = json.loads(line)
        if message["reason"] == "compiler-artifact" and message["target"]["name"] == ENGINE.replace("-", "_"):
            return Path(message["filenames"][0])
    sys.exit("cargo compiled no library of the engine.")


def announce(text: str) -> None:
    """Tell the person at the terminal, if there is one: pip keeps the output of a build to itself."""
    with contextlib.suppress(OSError), Path("/dev/tty").open("w", encoding="utf-8") as terminal:
        terminal.write(f"\n  {text}\n")


def workspace() -> Path:
    """Return the folder of the workspace of Rust: a source distribution has its own."""
    own = HERE / "rust"
    return own if own.exists() else HERE.parent.parent


def write_sources(folder: Path) -> None:
    """Write the crates of the engine, and a workspace that has no others."""
    root = HERE.parent.parent
    crates = needed_crates(root)
    for crate in crates:
        tracked = subprocess.run(["git", "ls-files", "-z", "."], cwd=crate, stdout=subprocess.PIPE, check=True).stdout
        for name in filter(None, tracked.decode().split("\0")):
            # The crates of other folders in this one are in the list themselves.
            target = folder / crate.relative_to(root) / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(crate / name, target)
    members = "".join(f'    "{crate.relative_to(root).as_posix()}",\n' for crate in sorted(crates))
    text = (root / "Cargo.toml").read_text(encoding="utf-8")
    text = re.sub(r"^members = \[.*?^\]", lambda _: f"members = [\n{members}]", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"^(default-members|exclude) = .*\n", "", text, flags=re.MULTILINE)
    (folder / "Cargo.toml").write_text(text, encoding="utf-8")
    shutil.copyfile(root / "Cargo.lock", folder / "Cargo.lock")


def needed_crates(root: Path) -> set[Path]:
    """Return the folders of the engine's crate and of all crates of the workspace that it needs."""
    command = ["cargo", "metadata", "--no-deps", "--locked", "--format-version", "1"]
    found = subprocess.run(command, cwd=root, stdout=subprocess.PIPE, check=True).stdout
    packages: dict[str, Any] = {each["name"]: each for each in json.loads(found)["packages"]}
    needed, open_names = set(), [ENGINE]
    while open_names:
        name = open_names.pop()
        if name not in needed:
            needed.add(name)
            open_names += [each["name"] for each in packages[name]["dependencies"] if each.get("path")]
    return {Path(packages[name]["manifest_path"]).parent for name in needed}


if __name__ == "__main__":
    main()
