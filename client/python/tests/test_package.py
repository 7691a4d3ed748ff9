"""Wheel and source distribution build without a network, and the wheel makes a hologram."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

from lightpath.local.engine import engine

PACKAGE = Path(__file__).resolve().parents[1]
# The engine of this environment, so that nothing is compiled again.
WITH_ENGINE = {**os.environ, "LIGHTPATH_ENGINE": str(engine.__file__)}

FIRST_HOLOGRAM = """
import numpy
from lightpath import local
optics = {"wavelength": "515nm", "pixel_pitch": "8um", "distance": "20mm"}
print(local.optimize(numpy.eye(64), iterations=2, **optics).quality.pixel.psnr_db > 5)
"""


def test_the_version_is_that_of_the_server() -> None:
    def version(path: Path) -> str:
        found = re.search(r'^version = "(.*)"$', path.read_text(encoding="utf-8"), re.MULTILINE)
        assert found
        return found[1]

    assert version(PACKAGE / "pyproject.toml") == version(PACKAGE.parents[1] / "Cargo.toml") == engine.__version__


def test_the_engine_can_be_left_out_or_compiled_before() -> None:
    def library(**variables: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, str(PACKAGE / "compile_engine.py")]
        return subprocess.run(command, check=False, capture_output=True, text=True, env=variables)

    assert library(LIGHTPATH_ENGINE="none").stdout == ""
    assert library(LIGHTPATH_ENGINE=str(engine.__file__)).stdout.strip() == str(Path(engine.__file__).resolve())
    assert "which is no file" in library(LIGHTPATH_ENGINE="/missing.so").stderr
    assert "install it from https://rustup.rs" in library(PATH="/missing").stderr


def test_wheel_and_sdist_build_offline_and_the_wheel_makes_a_hologram(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "build", "--no-isolation", "--sdist", "--wheel", "--outdir", str(tmp_path)]
    subprocess.run([*build, str(PACKAGE)], check=True, capture_output=True, env=WITH_ENGINE)
    (wheel,) = tmp_path.glob("*.whl")
    (sdist,) = tmp_path.glob("*.tar.gz")
    assert "-cp310-abi3-" in wheel.name
    names = zipfile.ZipFile(wheel).namelist()
    for name in (
        "lightpath/py.typed",
        "lightpath/v1/job_pb2.pyi",
        "lightpath/sync/lab.py",
        "lightpath/_engine.abi3.so",
    ):
        assert names.count(name) == 1, name
    check_sources(sdist, tmp_path / "sources")
    # The source distribution makes the same wheel.
    again = tmp_path / "again"
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--no-index", "--quiet"]
    subprocess.run([*command, "--wheel-dir", str(again), str(sdist)], check=True, env=WITH_ENGINE)
    (from_sdist,) = again.glob("*.whl")
    assert zipfile.ZipFile(from_sdist).namelist() == names
    venv = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--system-site-packages", str(venv)], check=True)
    python = str(venv / "bin" / "python")
    # What the wheel needs is in this environment, and the package itself in the new one.
    packages = os.pathsep.join(path for path in sys.path if path.endswith("site-packages"))
    install = [python, "-m", "pip", "install", "--no-deps", "--no-index", "--force-reinstall", "--quiet", str(wheel)]
    subprocess.run(install, check=True)
    installed = next((venv / "lib").glob("python*/site-packages"))
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(installed), packages])}
    done = subprocess.run(
        [python, "-c", FIRST_HOLOGRAM], check=True, capture_output=True, text=True, cwd=tmp_path, env=environment
    )
    assert done.stdout == "True\n"


def check_sources(sdist: Path, folder: Path) -> None:
    """Check that a source distribution has the crates of the engine alone, and that cargo understands them."""
    with tarfile.open(sdist) as archive:
        archive.extractall(folder, filter="data")
    workspace = folder / sdist.name.removesuffix(".tar.gz") / "rust"
    assert (workspace / "client/python/engine/src/lib.rs").exists()
    assert not (workspace / "server/api").exists()
    # Offline, cargo has what it needs from building this workspace.
    command = ["cargo", "metadata", "--offline", "--format-version", "1", "--manifest-path"]
    done = subprocess.run([*command, str(workspace / "Cargo.toml")], check=True, capture_output=True, text=True)
    assert "lightpath-python-engine" in done.stdout
    assert "object_store" not in done.stdout
