"""Run the code blocks of documents as a reader would: those of a page in order, in one folder, against a real server.

Usage: python docs/site/run_pages.py [--verbose] [PAGE.md]...

Without PAGE it runs all documents of the site, some at a time. With --verbose it prints what the blocks print, and
how long each took. Blocks of `sh`, `bash` and `python` run; other blocks do not. All shell blocks of a page run in
one shell and all Python blocks in one interpreter, so that variables stay. The programs come from the folder
LIGHTPATH_BINARIES, by default target/debug. A page whose blocks start no server gets one.

A page says with comments what a reader does not need to see. Each counts for the block after it, or from there on:

    <!-- test: skip: needs a real camera -->      do not run the next block; the reason is printed
    <!-- test: skip all: takes hours -->          do not run any block from here on
    <!-- test: write receiver.py -->              write the next block into this file instead
    <!-- test: fails -->                          the next block must end with an error
    <!-- test: replace 1920x1080 by 256x160 -->   in all blocks from here on; `by nothing` removes a text
    <!-- test: run                                run this in the shell, such as what makes files that a reader has
    touch photo.png
    -->
    <!-- test: python                             run this in Python
    assert after_db > before_db
    -->

Two things are changed without a comment: 127.0.0.1:7070 becomes the address of the page's own server, and the runner
waits until a server that a block starts answers.
"""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from page_blocks import Block, read_blocks

REPOSITORY = Path(__file__).resolve().parents[2]
DOCUMENTS = ["*.md", "client/python/README.md", "firmware/c/README.md", "bench/README.md", "docs/*.md", "docs/*/*.md"]
NOT_DOCUMENTS = {"docs/site"}
# Folders of a checkout in which readers find files.
CHECKOUT = ["client", "docs", "firmware"]
BLOCK_LIMIT_S = 300
SERVER_LIMIT_S = 30
# Pages wait for their servers and programs much of the time.
PAGES_AT_ONCE = 3
STARTS_SERVER = re.compile(r"^lightpathd serve(?:[^\n]*\\\n)*[^\n]*&[ ]*(?:#[^\n]*)?$", re.MULTILINE)

INTERPRETER = """
import ast, asyncio, atexit, pathlib, sys
names, loop = {"__name__": "__main__"}, asyncio.new_event_loop()
atexit.register(loop.close)
for line in sys.stdin:
    source, page, status = line.rstrip("\\n").split("\\t")
    code = compile(pathlib.Path(source).read_text(), page, "exec", flags=ast.PyCF_ALLOW_TOP_LEVEL_AWAIT)
    started = eval(code, names)
    if started is not None:
        loop.run_until_complete(started)
    pathlib.Path(status).touch()
"""


class PageFailed(Exception):
    """A block did not do what its page says."""


@dataclass
class Run:
    """The run of one page."""

    page: str
    folder: Path
    port: int
    verbose: bool
    processes: dict[str, subprocess.Popen[str]] = field(default_factory=dict)
    replaced: list[tuple[str, str]] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)
    blocks: int = 0

    def __post_init__(self) -> None:
        """Prepare the environment of the blocks."""
        binaries = Path(os.environ.get("LIGHTPATH_BINARIES") or REPOSITORY / "target" / "debug").resolve()
        kept = {key: value for key, value in os.environ.items() if not key.startswith("LIGHTPATH_")}
        self.environment = {
            **kept,
            "PATH": os.pathsep.join([str(binaries), str(Path(sys.executable).parent), kept["PATH"]]),
            "LIGHTPATH_LISTEN": f"127.0.0.1:{self.port}",
            "LIGHTPATH_SERVER": f"http://127.0.0.1:{self.port}",
            "MPLBACKEND": "Agg",
        }
        self.output = self.folder.parent / "output"
        for name in CHECKOUT:
            (self.folder / name).symlink_to(REPOSITORY / name)

    def run(self, blocks: list[Block]) -> None:
        """Run all blocks."""
        texts = [block.text for block in blocks if block.kind != "replace" and not block.skip]
        if not any(STARTS_SERVER.search(text) for text in texts):
            self._start("server", ["lightpathd", "serve"])
            self._wait_for_server()
        for block in blocks:
            if block.kind == "replace":
                self.replaced.append((block.text, block.by))
            elif block.skip:
                self.skipped.append(f"{self.page}:{block.line}: {block.skip}")
            else:
                begin = time.monotonic()
                printed = self._block(block)
                self.blocks += 1
                if self.verbose:
                    print(f"{time.monotonic() - begin:6.1f} s  {self.page}:{block.line}\n{printed}", flush=True)

    def _block(self, block: Block) -> str:
        """Run a block, and return what was printed."""
        text = block.text
        for old, new in [*self.replaced, ("127.0.0.1:7070", f"127.0.0.1:{self.port}")]:
            text = text.replace(old, new)
        if block.file:
            (self.folder / block.file).write_text(text, encoding="utf-8")
            return ""
        source, status = self.folder.parent / "block", self.folder.parent / "status"
        status.unlink(missing_ok=True)
        begin = self.output.stat().st_size if self.output.exists() else 0
        if block.kind == "python":
            # Empty lines before the text make the lines of a traceback those of the page.
            source.write_text("\n" * (block.line - 1) + text, encoding="utf-8")
            process = self._started("python", [sys.executable, "-u", "-W", "error", "-c", INTERPRETER])
            line = f"{source}\t{self.page}\t{status}\n"
        else:
            wait = f"until curl -sf http://127.0.0.1:{self.port}/healthz; do sleep 0.1; done"
            source.write_text(STARTS_SERVER.sub(lambda found: f"{found[0]}\n{wait}", text), encoding="utf-8")
            process = self._started("shell", ["bash", "--norc"])
            run = f"source '{source}' < /dev/null"
            if block.fails:
                run = f"set +e; ( set -e; {run} ); [ $? -ne 0 ] || exit 1; set -e"
            line = f"set -euo pipefail; {run}; touch '{status}'\n"
        assert process.stdin is not None
        process.stdin.write(line)
        process.stdin.flush()
        limit = time.monotonic() + BLOCK_LIMIT_S
        while not status.exists():
            if process.poll() is not None or time.monotonic() > limit:
                printed = self.output.read_bytes()[begin:].decode(errors="replace")
                reason = "took too long" if process.poll() is None else "failed"
                if block.fails and process.poll() is not None:
                    reason = "should have failed"
                raise PageFailed(f"{self.page}:{block.line}: this block {reason}:\n\n{text}\nIt printed:\n\n{printed}")
            time.sleep(0.01)
        return self.output.read_bytes()[begin:].decode(errors="replace")

    def _started(self, name: str, command: list[str]) -> subprocess.Popen[str]:
        return self.processes.get(name) or self._start(name, command)

    def _start(self, name: str, command: list[str]) -> subprocess.Popen[str]:
        with self.output.open("ab") as output:
            process = subprocess.Popen(
                command,
                cwd=self.folder,
                env=self.environment,
                stdin=subprocess.PIPE,
                stdout=output,
                stderr=subprocess.STDOUT,
                text=True,
                start_new_session=True,
            )
        self.processes[name] = process
        return process

    def _wait_for_server(self) -> None:
        limit = time.monotonic() + SERVER_LIMIT_S
        while True:
            try:
                urllib.request.urlopen(f"{self.environment['LIGHTPATH_SERVER']}/healthz").close()
            except urllib.error.URLError:
                if time.monotonic() > limit:
                    raise PageFailed(f"the server did not start:\n{self.output.read_text()}") from None
                time.sleep(0.05)
            else:
                return

    def end(self) -> None:
        """End all processes of the page, also those that its shell left in the background."""
        for process in self.processes.values():
            # The group may have ended already.
            try:
                os.killpg(process.pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
            process.wait()


given_ports: set[int] = set()


def free_port() -> int:
    """Return a port that nobody listens on, and that no other page was given."""
    while True:
        with socket.create_server(("127.0.0.1", 0)) as listener:
            port = int(listener.getsockname()[1])
        if port not in given_ports:
            given_ports.add(port)
            return port


def run_page(page: str, *, verbose: bool) -> list[str]:
    """Run a page, and return which blocks were skipped and why."""
    blocks = read_blocks((REPOSITORY / page).read_text(encoding="utf-8"))
    if not any(block.kind != "replace" and not block.skip for block in blocks):
        return [f"{page}:{block.line}: {block.skip}" for block in blocks if block.skip]
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "page"
        folder.mkdir()
        run = Run(page, folder, free_port(), verbose)
        try:
            run.run(blocks)
        finally:
            run.end()
    print(f"{time.monotonic() - begin:6.1f} s  {page}: {run.blocks} blocks", flush=True)
    return run.skipped


def main() -> None:
    """Run the pages that the user names, or all."""
    verbose = "--verbose" in sys.argv
    pages = [each for each in sys.argv[1:] if each != "--verbose"] or sorted(
        str(path.relative_to(REPOSITORY))
        for pattern in DOCUMENTS
        for path in REPOSITORY.glob(pattern)
        if str(path.parent.relative_to(REPOSITORY)) not in NOT_DOCUMENTS
    )
    skipped = []
    with ThreadPoolExecutor(PAGES_AT_ONCE) as pool:
        runs = [pool.submit(run_page, page, verbose=verbose) for page in pages]
        try:
            for run in runs:
                skipped += run.result()
        except PageFailed as failure:
            pool.shutdown(wait=False, cancel_futures=True)
            print(failure, file=sys.stderr)
            sys.exit(1)
    print("\nBlocks that were not run:")
    print("\n".join(f"  {each}" for each in skipped) or "  none")


if __name__ == "__main__":
    main()
