"""Makes the generated and the compiled parts of the package when it is built or installed.

`generate` and `compile_engine` say what they are. A wheel gets them from where they were made. An editable installation
gets them in `src`, where git ignores them. A source distribution gets what they are made of: the `.proto` files and the
crates of the engine, which lie outside of this folder in a checkout.
"""

from __future__ import annotations

import platform
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

ENGINE = "lightpath/_engine.abi3.so"


class MadeParts(BuildHookInterface[Any]):
    """What hatchling calls before and after each build."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the made parts to what is built."""
        if self.target_name == "sdist":
            self._add_sources(build_data)
        elif version == "editable":
            subprocess.run([sys.executable, Path(self.root, "generate")], check=True)
            self._add_engine(build_data, Path(self.root, "src"))
        else:
            self._folder = tempfile.TemporaryDirectory()
            subprocess.run([sys.executable, Path(self.root, "generate"), self._folder.name], check=True)
            build_data["force_include"][f"{self._folder.name}/lightpath"] = "lightpath"
            self._add_engine(build_data, None)

    def _add_engine(self, build_data: dict[str, Any], source: Path | None) -> None:
        """Add the library of the engine, to the source of an editable installation or to a wheel."""
        compiling = Path(self.root, "compile_engine.py")
        library = subprocess.run(
            [sys.executable, compiling], check=True, stdout=subprocess.PIPE, text=True
        ).stdout.strip()
        if source is not None:
            # A library that a process has loaded is replaced, and not written over.
            (source / ENGINE).unlink(missing_ok=True)
        if not library:
            return
        build_data["pure_python"] = False
        # One wheel serves Python 3.10 and all later versions.
        build_data["tag"] = f"cp310-abi3-{_system()}"
        if source is None:
            build_data["force_include"][library] = ENGINE
        else:
            shutil.copyfile(library, source / ENGINE)

    def _add_sources(self, build_data: dict[str, Any]) -> None:
        if Path(self.root, "rust").exists():
            return
        for folder in ("google", "lightpath"):
            build_data["force_include"][f"../../proto/{folder}"] = f"proto/{folder}"
        self._folder = tempfile.TemporaryDirectory()
        subprocess.run([sys.executable, Path(self.root, "compile_engine.py"), self._folder.name], check=True)
        build_data["force_include"][self._folder.name] = "rust"


def _system() -> str:
    """Return the name of this system in the names of wheels."""
    if sys.platform == "darwin":
        # A Python for two processors runs here on one of them, for which the engine is compiled.
        return f"macosx_11_0_{platform.machine()}"
    return sysconfig.get_platform().replace("-", "_").replace(".", "_")
