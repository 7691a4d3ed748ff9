"""Make the pictures of the site in docs/pictures, with a running server that has an empty data folder.

Usage: LIGHTPATH_SERVER=http://127.0.0.1:7070 PYTHONPATH=docs/site python -m pictures [NAME]...

Without NAME it makes all. It takes some minutes. It needs the package in client/python with its extra `plot`.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import lightpath

from pictures import concepts, learn, recipes
from pictures.strip import Studio

REPOSITORY = Path(__file__).resolve().parents[3]


def main() -> None:
    """Make the pictures that are named, or all."""
    pictures = {**learn.PICTURES, **concepts.PICTURES, **recipes.PICTURES}
    with lightpath.connect() as lab, TemporaryDirectory() as folder:
        spec = importlib.util.spec_from_file_location("targets", REPOSITORY / "docs" / "learn" / "targets.py")
        assert spec is not None
        assert spec.loader is not None
        targets = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(targets)
        studio = Studio(lab, targets, Path(folder), REPOSITORY / "docs" / "pictures")
        for name in sys.argv[1:] or pictures:
            pictures[name](studio).save(studio.output / f"{name}.png", optimize=True)
            print(name)


main()
