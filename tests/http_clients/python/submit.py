"""Submit a hologram with the client that was generated from the OpenAPI document, and download its pattern.

Usage: submit.py URL TARGET
"""

from __future__ import annotations

import hashlib
import sys
import time
from io import BytesIO
from pathlib import Path
from typing import TypeVar

from lightpath_http import Client
from lightpath_http.api.artifact_service import artifact_content, upload_unnamed_artifact
from lightpath_http.api.display_service import display_service_create_display
from lightpath_http.api.job_service import job_service_get_job, job_service_submit_job
from lightpath_http.models.display_input import DisplayInput
from lightpath_http.models.job import Job
from lightpath_http.models.job_result import JobResult
from lightpath_http.models.job_spec_input import JobSpecInput
from lightpath_http.models.modulator_input import ModulatorInput
from lightpath_http.models.optimize_hologram_image_plane_input import OptimizeHologramImagePlaneInput
from lightpath_http.models.optimize_hologram_input import OptimizeHologramInput
from lightpath_http.models.optimize_hologram_result import OptimizeHologramResult
from lightpath_http.models.place_input import PlaceInput
from lightpath_http.models.problem import Problem
from lightpath_http.models.submit_job_request import SubmitJobRequest
from lightpath_http.types import File

WAIT_S = 60
T = TypeVar("T")


def accepted(answer: T | Problem | None) -> T:
    """Return an answer that is no refusal."""
    if answer is None or isinstance(answer, Problem):
        raise SystemExit(f"refused: {answer}")
    return answer


def request(target: str, iterations: int) -> SubmitJobRequest:
    """Return the request for a hologram."""
    plane = OptimizeHologramImagePlaneInput(place=PlaceInput(distance_m=0.02), target=target)
    hologram = OptimizeHologramInput(display="displays/python", planes=[plane], iterations=iterations)
    return SubmitJobRequest(spec=JobSpecInput(optimize_hologram=hologram))


def ended(client: Client, job: Job) -> Job:
    """Return the job when it has ended."""
    limit = time.monotonic() + WAIT_S
    while job.state in {"STATE_QUEUED", "STATE_RUNNING"} and time.monotonic() < limit:
        time.sleep(0.1)
        job = accepted(job_service_get_job.sync(client=client, job=job.name.removeprefix("jobs/")))
    return job


def main() -> None:
    """Submit, wait, download, and compare the digest."""
    url, picture = sys.argv[1:]
    client = Client(base_url=url)
    display = DisplayInput(
        name="displays/python",
        modulator=ModulatorInput(width_px=96, height_px=64, pixel_pitch_xm=8e-6),
        wavelengths_m=[515e-9],
    )
    accepted(display_service_create_display.sync(client=client, body=display))
    file = File(payload=BytesIO(Path(picture).read_bytes()))
    target = accepted(upload_unnamed_artifact.sync(client=client, body=file))

    refused = job_service_submit_job.sync(client=client, body=request(target.digest, 20_000))
    assert isinstance(refused, Problem), refused
    assert (refused.status, refused.reason) == (400, "INVALID_FIELD"), refused
    assert [(wrong.problem, wrong.fix) for wrong in refused.fields] == [("is 20000", "must be 1 to 10000")], refused

    body = request(target.digest, 5)
    job = accepted(job_service_submit_job.sync(client=client, body=body, idempotency_key="python-1"))
    again = accepted(job_service_submit_job.sync(client=client, body=body, idempotency_key="python-1"))
    assert job.name == again.name, (job, again)
    job = ended(client, job)
    assert job.state == "STATE_SUCCEEDED", job
    assert isinstance(job.result, JobResult), job
    assert isinstance(job.result.optimize_hologram, OptimizeHologramResult), job
    digest = job.result.optimize_hologram.wavelengths[0].subframes[0].pattern
    pattern = accepted(artifact_content.sync(client=client, digest=digest))
    found = "sha256-" + hashlib.sha256(pattern.payload.read()).hexdigest()
    assert found == digest, (found, digest)
    print(f"Python: {job.name} made {digest}")


if __name__ == "__main__":
    main()
