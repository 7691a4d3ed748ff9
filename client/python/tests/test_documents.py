"""The examples of the documents and the notebooks run as they are written."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import REPOSITORY, Server, target
from PIL import Image

PACKAGE = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((PACKAGE / "notebooks").glob("*.py"))


def run_script(server: Server, folder: Path, text: str) -> str:
    """Run a program in a folder with `photo.png`, and return what it prints."""
    Image.fromarray(target(20)).save(folder / "photo.png")
    (folder / "script.py").write_text(text, encoding="utf-8")
    environment = {**os.environ, "LIGHTPATH_SERVER": server.url, "MPLBACKEND": "Agg"}
    command = [sys.executable, "-W", "error", "script.py"]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def block(document: Path, containing: str) -> str:
    """Return the only block of Python in a document that contains a text."""
    blocks = re.findall(r"```python\n(.*?)```", document.read_text(encoding="utf-8"), re.DOTALL)
    (found,) = [each for each in blocks if containing in each]
    return str(found)


def test_the_quick_start_of_the_readme_runs_as_written(own_server: Server, tmp_path: Path) -> None:
    start = block(REPOSITORY / "README.md", "import lightpath")
    assert len(start.strip().splitlines()) <= 10
    run_script(own_server, tmp_path, start)
    with Image.open(tmp_path / "hologram.png") as image:
        assert image.size == (960, 540)


def test_the_whole_loop_of_the_package_runs_as_written(own_server: Server, tmp_path: Path) -> None:
    loop = block(PACKAGE / "README.md", "dataset.finalize()")
    assert len(loop.strip().splitlines()) <= 15
    for i in range(8):
        Image.fromarray(target(i)).save(tmp_path / f"target-{i}.png")
    printed = run_script(own_server, tmp_path, 'pictures = [f"target-{i}.png" for i in range(8)]\n' + loop)
    before_db, after_db = (float(each) for each in re.findall(r"PSNR ([0-9.]+) dB", printed))
    assert after_db > before_db + 3


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=[path.stem for path in NOTEBOOKS])
def test_notebooks_run_and_draw_their_pictures(own_server: Server, tmp_path: Path, notebook: Path) -> None:
    text = notebook.read_text(encoding="utf-8")
    assert text.startswith("# %% [markdown]")
    run_script(own_server, tmp_path, text)
    pictures = list(tmp_path.glob("*figure*.png"))
    assert pictures
    for picture in pictures:
        with Image.open(picture) as image:
            # An empty figure has one colour.
            assert len(image.convert("L").getcolors() or range(257)) > 20, picture
