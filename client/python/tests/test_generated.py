"""The generated files are those of the present sources."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]


def files(folder: Path) -> dict[str, str]:
    found = [path for path in folder.rglob("*.py*") if path.suffix in {".py", ".pyi"}]
    return {str(path.relative_to(folder)): path.read_text(encoding="utf-8") for path in found}


def test_messages_stubs_and_the_blocking_client_are_up_to_date(tmp_path: Path) -> None:
    subprocess.run([sys.executable, str(PACKAGE / "generate"), str(tmp_path)], check=True)
    for part in ("v1", "sync"):
        fresh, kept = files(tmp_path / "lightpath" / part), files(PACKAGE / "src" / "lightpath" / part)
        assert fresh.keys() == kept.keys()
        stale = [name for name in fresh if fresh[name] != kept[name]]
        assert not stale, f"run client/python/generate: {', '.join(stale)} of {part} differ"


def test_a_blocking_method_exists_for_each_asynchronous_one() -> None:
    import lightpath  # noqa: PLC0415

    for name in lightpath.aio.__all__:
        blocking, asynchronous = getattr(lightpath, name), getattr(lightpath.aio, name)
        assert {m for m in dir(blocking) if not m.startswith("_")} == {m for m in dir(asynchronous) if m[0] != "_"}
