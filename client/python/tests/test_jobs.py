"""Jobs that wait, are cancelled, fail, survive restarts, and are interrupted."""

from __future__ import annotations

import functools
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import DISTANCE, Server, create_bench, target
from PIL import Image

import lightpath
from lightpath import v1
from lightpath.options import label_of

# At 640x384 px a job of this length takes minutes. Each test ends it.
LONG = 10_000


def long_job(lab: lightpath.Lab) -> lightpath.Job[lightpath.Hologram]:
    wide = lab.create_display("wide", resolution="640x384", pixel_pitch="8um", wavelength="515nm")
    return wide.submit_optimize(target(1), distance=DISTANCE, iterations=LONG)


def test_watching_survives_that_the_server_is_killed(own_server: Server) -> None:
    with lightpath.connect(own_server.url) as lab:
        bench = create_bench(lab)
        job = bench.submit_optimize(target(1), distance=DISTANCE, iterations=800)
        losses: list[lightpath.Unreachable] = []
        for state in job.watch(on_lost=losses.append):
            if state.progress.step > 50 and own_server.starts == 1:
                own_server.kill()
                own_server.start()
        hologram = job.result()
        assert own_server.starts == 2
        assert losses
        assert job.message.attempt == 2
        assert job.state == "succeeded"
        # The crash changed nothing: the same request gives the same bytes.
        again = bench.optimize(target(1), distance=DISTANCE, iterations=800)
        assert np.array_equal(hologram.phase, again.phase)


def test_a_server_that_was_never_there_is_an_error_at_once(own_server: Server) -> None:
    own_server.stop()
    began_s = time.monotonic()
    with (
        lightpath.connect(own_server.url) as lab,
        pytest.raises(lightpath.Unreachable, match="lightpathd serve") as caught,
    ):
        lab.displays()
    assert time.monotonic() - began_s < 5
    assert isinstance(caught.value, ConnectionError)
    assert caught.value.reason == "UNREACHABLE"


def test_calls_are_made_again_while_the_server_restarts(own_server: Server) -> None:
    with lightpath.connect(own_server.url) as lab:
        create_bench(lab)
        own_server.kill()
        restart = threading.Timer(0.5, own_server.start)
        restart.start()
        assert [each.id for each in lab.displays()] == ["bench"]
        restart.join()


def test_cancelled_jobs_have_no_result_and_can_be_retried(lab: lightpath.Lab) -> None:
    job = long_job(lab)
    assert job.kind == "optimize_hologram"
    assert job.name in {each.name for each in lab.jobs(display="wide", limit=10)}
    for state in job.watch():
        if state.state == v1.Job.STATE_RUNNING:
            break
    job.cancel()
    with pytest.raises(lightpath.JobUnsuccessful, match="was cancelled") as caught:
        job.result()
    assert (caught.value.job, caught.value.reason) == (job.name, "CANCELLED")
    assert job.retry().state == "queued"
    job.cancel()
    job.wait()
    assert lab.job(job.name).refresh().state == "cancelled"
    assert job.events()[0].message
    with pytest.raises(lightpath.PreconditionFailed):
        job.cancel()


def test_the_same_request_id_makes_one_job(lab: lightpath.Lab, bench: lightpath.Display) -> None:
    jobs = [bench.submit_optimize(target(1), distance=DISTANCE, iterations=2, request_id="one") for _ in range(2)]
    assert jobs[0].name == jobs[1].name
    with pytest.raises(lightpath.AlreadyExists):
        bench.submit_optimize(target(2), distance=DISTANCE, iterations=2, request_id="one")
    assert lab.job(jobs[0].name).result().phase.shape == (96, 160)


def test_failed_jobs_say_why(lab: lightpath.Lab, bench: lightpath.Display) -> None:
    dataset = bench.create_dataset("one-pair", distance=DISTANCE)
    hologram = bench.optimize(target(1), distance=DISTANCE, iterations=2)
    dataset.add(hologram, bench.photograph(hologram))
    with pytest.raises(lightpath.JobUnsuccessful, match=r"jobs/.* failed: .*retry\(\)") as caught:
        dataset.finalize()
    assert caught.value.reason
    assert lab.job(caught.value.job).state == "failed"
    with pytest.raises(lightpath.PreconditionFailed, match="final"):
        dataset.learn()


SCRIPT = """
import signal
import sys
import numpy as np
import lightpath

# A shell starts programs in the background without Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)

def show(job):
    if job.progress.step > 0:
        print(job.name, flush=True)

with lightpath.connect(sys.argv[1]) as lab:
    display = lab.create_display("wide", resolution="640x384", pixel_pitch="8um", wavelength="515nm")
    display.optimize(np.eye(200), distance="20mm", iterations=10000, progress=show)
"""


def test_ctrl_c_ends_the_waiting_and_not_the_job(lab: lightpath.Lab, server: Server, tmp_path: Path) -> None:
    (tmp_path / "wait.py").write_text(SCRIPT)
    command = [sys.executable, str(tmp_path / "wait.py"), server.url]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        job = lab.job(program.stdout.readline().strip())
        program.send_signal(signal.SIGINT)
        _, errors = program.communicate()
    assert program.returncode != 0
    assert f'{job.name} goes on on the server. Fetch its result later: lab.job("{job.name}").result()' in errors
    assert f'lab.job("{job.name}").cancel()' in errors
    assert job.refresh().state == "running"
    job.cancel().wait()


def test_lists_of_jobs_say_what_each_is_about(bench: lightpath.Display, tmp_path: Path) -> None:
    path = tmp_path / "eye.png"
    Image.fromarray(target(1)).save(path)
    submit = functools.partial(bench.submit_optimize, distance=DISTANCE, iterations=1)
    assert submit(path).message.label == submit(str(path)).message.label == "eye.png"
    assert submit(path, label="mine").message.label == "mine"
    assert not submit(target(1)).message.label
    needy = submit(path, needs=["gpu"]).message
    assert (list(needy.needs), needy.waits_for) == (["gpu"], "no living process that runs jobs has the label gpu")
    assert label_of([Path("targets/a.png"), "b\n.png", 3]) == "a.png, b\ufffd.png"
    long = label_of(["é" * 100])
    assert long == "é" * 62 + "…"
