"""The notebooks run as they are written. `docs/site/run_pages.py` runs the examples of the documents."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import Server, target
from PIL import Image

PACKAGE = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((PACKAGE / "notebooks").glob("*.py"))


def run_script(server: Server, folder: Path, text: str) -> None:
    """Run a program in a folder with `photo.png`."""
    Image.fromarray(target(20)).save(folder / "photo.png")
    (folder / "script.py").write_text(text, encoding="utf-8")
    environment = {**os.environ, "LIGHTPATH_SERVER": server.url, "MPLBACKEND": "Agg"}
    command = [sys.executable, "-W", "error", "script.py"]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


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
