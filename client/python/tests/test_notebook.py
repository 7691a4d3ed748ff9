"""What notebooks and terminals show."""

from __future__ import annotations

import contextlib
import fcntl
import io
import os
import pty
import re
import struct
import subprocess
import sys
import termios
import threading
import time
from html.parser import HTMLParser
from typing import TYPE_CHECKING, Any

import pytest
from conftest import DISTANCE, Server, target
from IPython.core.interactiveshell import InteractiveShell
from PIL import Image

import lightpath
from lightpath import html, v1
from lightpath.progress import card, details, loss_curve

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

EMPTY = {"img", "br"}


class Balanced(HTMLParser):
    """Fails for HTML whose elements are not closed in their order, and collects tags."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: set[str] = set()
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag: str, attrs: object) -> None:  # noqa: ARG002 - the base class names it
        self.tags.add(tag)
        if tag not in EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def shown(thing: Any) -> str:
    text: str = thing._repr_html_()
    assert Balanced(text).tags
    assert "script" not in Balanced(text).tags
    return text


def test_everything_shows_itself(lab: lightpath.Lab, bench: lightpath.Display) -> None:
    hologram = bench.optimize(target(1), distance=DISTANCE, iterations=20)
    photo = bench.photograph(hologram)
    dataset = bench.create_dataset("shown", distance=DISTANCE)
    dataset.add(hologram, photo)
    score = lab.score(photo, target(1))
    for thing in (hologram, photo, score):
        image = Image.open(io.BytesIO(thing._repr_png_()))
        assert image.format == "PNG"
        assert max(image.size) <= html.PICTURE_SIDE_PX
    assert "light that the picture does not need" in shown(hologram)
    assert str(hologram.expected) in shown(hologram)
    assert shown(hologram).count("<img") == 2
    assert "160×96 px" in shown(bench)
    assert "datasets/shown" in shown(dataset)
    assert "succeeded" in shown(lab.job(hologram.job.name))
    assert "SSIM" in shown(score)


def test_names_and_notes_never_become_markup(lab: lightpath.Lab) -> None:
    display = lab.create_display(
        "evil", resolution="64x48", pixel_pitch="8um", wavelength="515nm", notes="<script>alert('&')</script>"
    )
    assert "&lt;script&gt;alert(&#x27;&amp;&#x27;)&lt;/script&gt;" in shown(display)
    job = v1.Job(state=v1.Job.STATE_RUNNING, progress=v1.Progress(stage="<script>"))
    page = card("<script>", job, [], "", "<script>")
    assert "script" not in Balanced(page).tags
    assert page.count("&lt;script&gt;") == 3
    report = lightpath.Report(b"<script>'\"</script>", {}, [])
    assert "&lt;script&gt;&#x27;&quot;" in shown(report)


def test_kernels_and_evaluations_show_themselves(bench: lightpath.Display) -> None:
    metrics = v1.KernelMetrics(test_loss=1e-4, ideal_test_loss=1e-2)
    metrics.parts.add(name="source").cost_db.value = 3.21
    version = v1.KernelVersion(name="displays/a/kernels/k/versions/1", version=1, metrics=metrics)
    page = shown(lightpath.KernelVersion(bench._connection, version))
    assert "without source" in page
    assert "+3.2 dB" in page
    kernel = v1.Kernel(name="displays/a/kernels/k", active_version=2, aliases={"candidate": 3})
    assert "alias candidate" in shown(lightpath.Kernel(bench._connection, kernel))
    pair = v1.EvaluateKernelResult.PairLoss(pair="p1", split=v1.SPLIT_TEST, loss=0.5)
    evaluation = lightpath.Evaluation("datasets/d", "active", v1.EvaluateKernelResult(pairs=[pair]))
    assert "p1" in shown(evaluation)
    assert evaluation.loss() == 0.5


@pytest.fixture
def notebook(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """A shell that looks like that of a notebook, and the pages that it displays."""
    shell = InteractiveShell.instance()
    monkeypatch.setattr(shell, "kernel", "a kernel", raising=False)
    pages: list[str] = []

    def publish(data: dict[str, Any], **_: Any) -> None:
        pages.append(data.get("text/html", ""))

    monkeypatch.setattr(shell.display_pub, "publish", publish)
    yield pages
    InteractiveShell.clear_instance()


def test_notebooks_show_target_loss_and_time_left(bench: lightpath.Display, notebook: list[str]) -> None:
    bench.optimize(target(1), distance=DISTANCE, iterations=400)
    assert all(Balanced(page).tags for page in notebook)
    assert all("data:image/png;base64," in page for page in notebook)
    assert any("<svg" in page and "loss " in page for page in notebook)
    assert "succeeded" in notebook[-1]
    assert "value='1.0000'" in notebook[-1]


def test_notebooks_show_what_a_running_hologram_has_reached(bench: lightpath.Display, notebook: list[str]) -> None:
    job = bench.submit_optimize(target(1), distance=DISTANCE, iterations=10_000, subframes=8)
    ending = threading.Thread(target=lambda: cancel_after(job, lambda: any("so far" in page for page in notebook)))
    ending.start()
    job.wait()
    ending.join()
    assert any('alt="so far" src="data:image/png;base64,' in page for page in notebook)
    assert all(Balanced(page).tags for page in notebook)


def cancel_after(job: lightpath.Job[Any], is_done: Callable[[], bool]) -> None:
    """Cancel a job as soon as something has happened, or after a time that suffices also on busy machines."""
    end = time.monotonic() + 60
    while not is_done() and time.monotonic() < end:
        time.sleep(0.1)
    job.cancel()


def test_loss_and_time_left_are_written_for_people() -> None:
    progress = v1.Progress(stage="optimize", step=3, steps_total=10, loss=0.01234, eta_s=130)
    assert details(v1.Job(progress=progress)) == "loss 0.0123, 2 min left"
    assert loss_curve([(1, 0.1)]) == ""
    assert loss_curve([(1, 0.1), (2, 0.01), (3, 0.001)]).count(",") >= 3


SCRIPT = """
import sys
import numpy as np
import lightpath

with lightpath.connect(sys.argv[1]) as lab:
    lab.display("bench").optimize(np.eye(96), distance="20mm", **eval(sys.argv[2]))
"""


def output(server: Server, path: Path, options: str, *, terminal: bool) -> str:
    """Run a script, and return what it writes to stderr, which is a terminal or a pipe."""
    path.write_text(SCRIPT)
    command = [sys.executable, str(path), server.url, options]
    if not terminal:
        return subprocess.run(command, check=True, capture_output=True, text=True).stderr
    reader, writer = pty.openpty()
    # Rows and columns. A terminal without a size has no room for a bar.
    fcntl.ioctl(writer, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 100, 0, 0))
    with subprocess.Popen(command, stderr=writer):
        os.close(writer)
        written = b""
        # A terminal whose last program has ended gives an error instead of an end.
        with contextlib.suppress(OSError):
            while piece := os.read(reader, 1 << 16):
                written += piece
    os.close(reader)
    return written.decode()


def test_terminals_show_a_bar_and_pipes_show_nothing(bench: lightpath.Display, server: Server, tmp_path: Path) -> None:
    assert bench.width_px == 160
    shows = output(server, tmp_path / "script.py", "{'iterations': 400}", terminal=True)
    assert re.search(r"optimize hologram: \w+.*\d+/\d+, loss [0-9.e-]+, \d+ s left", shows), shows
    assert "succeeded" in shows
    assert output(server, tmp_path / "script.py", "{'iterations': 20, 'progress': False}", terminal=True) == ""
    assert output(server, tmp_path / "script.py", "{'iterations': 20}", terminal=False) == ""
