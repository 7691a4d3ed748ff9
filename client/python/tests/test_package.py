"""Wheel and source distribution build without a network, and the wheel works."""

from __future__ import annotations

import re
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]


def test_the_version_is_that_of_the_server() -> None:
    def version(path: Path) -> str:
        found = re.search(r'^version = "(.*)"$', path.read_text(encoding="utf-8"), re.MULTILINE)
        assert found
        return found[1]

    own = version(PACKAGE / "pyproject.toml")
    assert own == version(PACKAGE.parents[1] / "Cargo.toml")
    # The engine takes its version from Cargo.toml, and the extra asks for the same.
    assert f'engine = ["lightpath-engine=={own}"]' in (PACKAGE / "pyproject.toml").read_text(encoding="utf-8")


def test_the_source_distribution_of_the_engine_has_what_a_build_needs(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "maturin", "sdist", "--manifest-path", str(PACKAGE / "engine" / "Cargo.toml")]
    subprocess.run([*command, "--out", str(tmp_path)], check=True, capture_output=True)
    (sdist,) = tmp_path.glob("lightpath_engine-*.tar.gz")
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    for name in ("optics/src/lib.rs", "server/media/Cargo.toml", "Cargo.lock", "PKG-INFO"):
        assert name in names, name
    for name in ("__init__.py", "_engine.pyi", "py.typed"):
        assert any(each.endswith(f"lightpath_engine/{name}") for each in names), name


def test_wheel_and_sdist_build_offline_and_the_wheel_can_be_imported(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "build", "--no-isolation", "--sdist", "--wheel", "--outdir", str(tmp_path)]
    subprocess.run([*build, str(PACKAGE)], check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    (sdist,) = tmp_path.glob("*.tar.gz")
    names = zipfile.ZipFile(wheel).namelist()
    for name in ("lightpath/py.typed", "lightpath/v1/job_pb2.pyi", "lightpath/sync/lab.py"):
        assert name in names
    # The source distribution makes the same wheel.
    again = tmp_path / "again"
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--no-index", "--quiet"]
    subprocess.run([*command, "--wheel-dir", str(again), str(sdist)], check=True)
    (from_sdist,) = again.glob("*.whl")
    assert zipfile.ZipFile(from_sdist).namelist() == names
    venv = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--system-site-packages", str(venv)], check=True)
    install = [str(venv / "bin" / "pip"), "install", "--no-deps", "--no-index", "--quiet", str(wheel)]
    subprocess.run(install, check=True)
    done = subprocess.run(
        [str(venv / "bin" / "pip"), "show", "--files", "lightpath"], check=True, capture_output=True, text=True
    )
    assert "lightpath/aio/lab.py" in done.stdout
