"""The receiver of webhooks in the documents understands what the server sends, and refuses what others send."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
import threading
import urllib.error
import urllib.request
from typing import TYPE_CHECKING, Any

import pytest
from conftest import REPOSITORY, Server, target

import lightpath

if TYPE_CHECKING:
    from pathlib import Path

# Time within which an event arrives, also on a machine with much other work.
ARRIVES_WITHIN_S = 60


def block(document: Path, containing: str) -> str:
    """Return the only block of Python in a document that contains a text."""
    blocks = re.findall(r"```python\n(.*?)```", document.read_text(encoding="utf-8"), re.DOTALL)
    (found,) = [each for each in blocks if containing in each]
    return str(found)


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return int(listener.getsockname()[1])


def post(url: str, body: dict[str, Any], **headers: str) -> dict[str, Any]:
    names = {name.replace("_", "-"): value for name, value in headers.items()}
    request = urllib.request.Request(  # noqa: S310
        url, json.dumps(body).encode(), {"content-type": "application/json", **names}
    )
    with urllib.request.urlopen(request, timeout=ARRIVES_WITHIN_S) as answer:  # noqa: S310
        text = answer.read()
    return dict(json.loads(text)) if text else {}


def test_the_receiver_of_the_documents_learns_of_a_job(tmp_path: Path) -> None:
    port = free_port()
    origin = f"http://localhost:{port}"
    (tmp_path / "data").mkdir()
    server = Server(tmp_path / "data", "--webhook-origins", origin)
    secret = post(f"{server.url}/v1/webhooks", {"id": "ci", "url": f"{origin}/lightpath"})["secret"]
    receiver = block(REPOSITORY / "docs/webhooks.md", "class Receiver").replace("9000", str(port))
    (tmp_path / "receiver.py").write_text(receiver, encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, "receiver.py"],
        cwd=tmp_path,
        env={**os.environ, "WEBHOOK_SECRET": secret},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    threading.Timer(ARRIVES_WITHIN_S, process.kill).start()
    try:
        with lightpath.connect(server.url) as lab:
            display = lab.create_display("lab", resolution="64x48", pixel_pitch="8um", wavelength="515nm")
            hologram = display.optimize(target(3)[:48, :64], distance="20mm", iterations=3)
        assert process.stdout is not None
        # The receiver may have started after the first attempt.
        line = process.stdout.readline()
        assert line.startswith("job.succeeded {"), line
        assert hologram.job.name in line
        with pytest.raises(urllib.error.HTTPError, match="403"):
            post(
                f"{origin}/", {"type": "job.succeeded"}, webhook_id="1", webhook_timestamp="1", webhook_signature="v1,"
            )
    finally:
        process.kill()
        process.wait()
        if process.stdout is not None:
            process.stdout.close()
        server.stop()
