"""Makes the generated parts of the package when it is built or installed; `generate` says what they are.

A wheel gets them from a temporary folder. An editable installation gets them in `src`, where git ignores them. A source
distribution gets the `.proto` files instead, which lie outside of this folder in a checkout.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class GeneratedParts(BuildHookInterface[Any]):
    """What hatchling calls before and after each build."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the generated parts to what is built."""
        generate = Path(self.root, "generate")
        if self.target_name == "sdist":
            if not Path(self.root, "proto").exists():
                for folder in ("google", "lightpath"):
                    build_data["force_include"][f"../../proto/{folder}"] = f"proto/{folder}"
        elif version == "editable":
            subprocess.run([sys.executable, generate], check=True)
        else:
            self._folder = tempfile.TemporaryDirectory()
            subprocess.run([sys.executable, generate, self._folder.name], check=True)
            build_data["force_include"][f"{self._folder.name}/lightpath"] = "lightpath"
