"""A real server for the tests, and targets for its displays."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import threading
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pytest

import lightpath

if TYPE_CHECKING:
    from collections.abc import Iterator

REPOSITORY = Path(__file__).resolve().parents[3]
DISTANCE = "20mm"


def program(name: str) -> str:
    """Path of a program in the folder LIGHTPATH_BINARIES, or in the build folder."""
    found = Path(os.environ.get("LIGHTPATH_BINARIES") or REPOSITORY / "target" / "debug") / name
    if not found.exists():
        pytest.fail(f"{found} does not exist: run `cargo build --bins`, or name a folder with LIGHTPATH_BINARIES")
    return str(found)


class Server:
    """A server with its own folder. It can be killed and started again at the same address."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.folder, self._options = folder, options
        self.port = self.starts = 0
        self._process: subprocess.Popen[str] | None = None
        self.start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def start(self) -> None:
        self.starts += 1
        command = [program("lightpathd"), "serve", "--data-dir", str(self.folder), *self._options]
        command += ["--listen", f"127.0.0.1:{self.port}", "--checkpoint-interval-s", "0.05"]
        log = (self.folder.parent / f"{self.folder.name}.log").open("ab")
        environment = {k: v for k, v in os.environ.items() if not k.startswith("LIGHTPATH_")}
        self._process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=log, text=True, env=environment, start_new_session=True
        )
        log.close()
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.startswith("listening on http://"):
                self.port = int(line.rpartition(":")[2])
                return
        pytest.fail(f"the server did not start; its log is {log.name}")

    def kill(self) -> None:
        """End the server as a power cut does."""
        self._end(signal.SIGKILL)

    def stop(self) -> None:
        """End the server as an operator does."""
        self._end(signal.SIGTERM)

    def _end(self, number: signal.Signals) -> None:
        assert self._process is not None
        self._process.send_signal(number)
        self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()


class CuttingProxy:
    """Passes bytes on between clients and a server, and cuts one connection after `cut_after_bytes`.

    It counts the bytes to the server, or with `cut_answers` those from it.
    """

    def __init__(self, server: Server, cut_after_bytes: int, *, cut_answers: bool = False) -> None:
        self._port, self._cut_answers = server.port, cut_answers
        self._left_bytes: int | None = cut_after_bytes
        self.cuts = 0
        self.passed_bytes = 0
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._listener.getsockname()[1]}"
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        # Closing the listener ends the loop.
        with contextlib.suppress(OSError):
            while True:
                client, _ = self._listener.accept()
                server = socket.create_connection(("127.0.0.1", self._port))
                for ends in [(client, server, not self._cut_answers), (server, client, self._cut_answers)]:
                    threading.Thread(target=self._pass, args=ends, daemon=True).start()

    def _pass(self, one: socket.socket, other: socket.socket, counts: bool) -> None:  # noqa: FBT001
        with contextlib.suppress(OSError):
            while received := one.recv(1 << 14):
                if counts and self._cuts_after(len(received)):
                    break
                other.sendall(received)
        for end in (one, other):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
        one.close()

    def _cuts_after(self, size_bytes: int) -> bool:
        self.passed_bytes += size_bytes
        if self._left_bytes is not None:
            self._left_bytes -= size_bytes
            if self._left_bytes < 0:
                self._left_bytes = None
                self.cuts += 1
                return True
        return False

    def close(self) -> None:
        # Closing alone does not wake a thread that accepts.
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()


@pytest.fixture(scope="session")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    server = Server(tmp_path_factory.mktemp("server") / "data")
    yield server
    server.stop()


@pytest.fixture
def own_server(tmp_path: Path) -> Iterator[Server]:
    """A server that the test may kill."""
    server = Server(tmp_path / "data")
    yield server
    server.kill()


@pytest.fixture
def lab(server: Server) -> Iterator[lightpath.Lab]:
    with lightpath.connect(server.url) as lab:
        yield lab


@pytest.fixture
def bench(lab: lightpath.Lab) -> lightpath.Display:
    """A small simulated display."""
    return create_bench(lab)


def create_bench(lab: lightpath.Lab) -> lightpath.Display:
    return lab.create_display("bench", resolution="160x96", pixel_pitch="8um", wavelength="515nm", simulated=1)


def target(seed: int) -> npt.NDArray[np.uint8]:
    """A picture of 160x96 px with edges and greys everywhere."""
    random = np.random.default_rng(seed)
    pixels = np.full((96, 160), 40, np.uint8)
    for _ in range(60):
        y, x, height, width = random.integers((0, 0, 4, 4), (92, 156, 24, 32))
        pixels[y : y + height, x : x + width] = random.integers(0, 256)
    return pixels
