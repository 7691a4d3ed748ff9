"""Asynchronous jobs: submitting, and waiting through restarts for what they make."""

from __future__ import annotations

import uuid
from functools import partial
from typing import TYPE_CHECKING, Generic, TypeVar, cast

from lightpath import html, names, v1, words
from lightpath.aio.connection import PREPARING_TIMEOUT_S
from lightpath.errors import JobUnsuccessful, Unreachable, WaitInterrupted
from lightpath.options import SubmitOptions, submit_request
from lightpath.progress import Progress, details, waits, watcher
from lightpath.retry import WAIT_TRIES_MAX, Backoff

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Awaitable, Callable, Sequence

    from lightpath.aio.connection import Connection

Result = TypeVar("Result")

JOBS_AT_ONCE = 200
"""Jobs that `submit_all` submits with one call: the limit of the server."""

_ENDED = {v1.Job.STATE_SUCCEEDED, v1.Job.STATE_FAILED, v1.Job.STATE_CANCELLED}


class Job(Generic[Result]):
    """A job in the server's queue. It goes on when the program ends."""

    def __init__(
        self, connection: Connection, message: v1.Job, read: Callable[[Connection, v1.Job], Awaitable[Result]]
    ) -> None:
        self._connection = connection
        self._read = read
        self.message = message

    def __repr__(self) -> str:
        waits = self.waits
        return f"<Job {self.name}, {self.kind}: {self.state}{f', {waits}' if waits else ''}>"

    @property
    def name(self) -> str:
        """Resource name, `jobs/{id}`."""
        return self.message.name

    @property
    def kind(self) -> str:
        """What the job does, such as `optimize_hologram`."""
        return self.message.spec.WhichOneof("kind") or "unknown"

    @property
    def state(self) -> words.State:
        """State when this object last heard of the job."""
        return cast("words.State", words.name_of(v1.Job.State, self.message.state))

    @property
    def waits(self) -> str:
        """What a queued job waits for and when it starts, such as `behind learn kernel bench-1, about 3 min`.

        Empty: nothing is known. `message.waiting` says the same to programs.
        """
        return waits(self.message)

    @property
    def ended(self) -> bool:
        """Whether the job has succeeded, failed or been cancelled."""
        return self.message.state in _ENDED

    async def refresh(self) -> Job[Result]:
        """Read the job again."""
        request = v1.GetJobRequest(name=self.name)
        self.message = await self._connection.call(self._connection.jobs.GetJob, request)
        return self

    async def watch(self, *, on_lost: Callable[[Unreachable], None] | None = None) -> AsyncIterator[v1.Job]:
        """Return every state of the job until it has ended. Survives restarts of the server.

        `on_lost` is called when the connection was lost, before each try to connect again.
        """
        backoff, reached = Backoff(WAIT_TRIES_MAX), False
        request = v1.WatchJobRequest(name=self.name)
        while True:
            # A server that stops ends the stream without an error.
            failure = Unreachable(self._connection.url, "the server ended the watch")
            try:
                async for message in self._connection.stream(self._connection.jobs.WatchJob, request):
                    reached = True
                    backoff.reset()
                    self.message = message
                    yield message
                    if self.ended:
                        return
            except Unreachable as error:
                failure = error
            if not reached:
                raise failure
            if on_lost is not None:
                on_lost(failure)
            await self._connection.pause(backoff, failure)

    async def wait(self, *, progress: Progress = True, picture: bytes | None = None) -> Job[Result]:
        """Wait until the job has ended, however it ends, and show its progress.

        `picture` is a PNG that a notebook shows beside the progress. On Ctrl-C it raises `WaitInterrupted`; the job
        goes on.
        """
        label = self.kind.replace("_", " ")
        # Only holograms have pictures while they run.
        live = partial(self._connection.address.picture, f"/v1/{self.name}/picture")
        shown = watcher(progress, label, picture, live if self.kind == "optimize_hologram" else None)
        try:
            async for message in self.watch(on_lost=shown.lost):
                shown.update(message)
        except KeyboardInterrupt:
            raise WaitInterrupted(self.name) from None
        finally:
            shown.close()
        return self

    async def result(self, *, progress: Progress = True) -> Result:
        """Wait until the job has ended, and return what it made.

        Raises `JobUnsuccessful` if it failed or was cancelled.
        """
        if not self.ended:
            await self.wait(progress=progress)
        check_success(self.message)
        return await self._read(self._connection, self.message)

    async def cancel(self) -> Job[Result]:
        """Cancel the job. A queued job ends at once, a running one within some seconds."""
        request = v1.CancelJobRequest(name=self.name)
        self.message = await self._connection.call(self._connection.jobs.CancelJob, request, repeatable=False)
        return self

    async def retry(self) -> Job[Result]:
        """Put a failed or cancelled job back into the queue."""
        request = v1.RetryJobRequest(name=self.name)
        self.message = await self._connection.call(self._connection.jobs.RetryJob, request, repeatable=False)
        return self

    async def events(self) -> list[v1.JobEvent]:
        """Return the history of the job, the oldest event first."""
        request = v1.ListJobEventsRequest(name=self.name, page_size=1000)
        events: list[v1.JobEvent] = []
        async for page in self._connection.pages(self._connection.jobs.ListJobEvents, request):
            events += page.events
        return events

    def _repr_html_(self) -> str:
        job = self.message
        rows: list[tuple[str, object]] = [("kind", self.kind.replace("_", " ")), ("state", self.state)]
        if job.progress.steps_total and not self.ended:
            progress = f"{job.progress.stage} {job.progress.step}/{job.progress.steps_total} {details(job)}"
            rows.append(("progress", progress))
        if self.waits:
            rows.append(("waits", self.waits))
        if job.error.message:
            rows.append(("error", f"{job.error.message} ({job.error.reason})"))
        rows.append(("submitted", f"{job.create_time.ToDatetime():%Y-%m-%d %H:%M:%S} UTC"))
        return html.table(self.name, rows)


async def submit(
    connection: Connection,
    spec: v1.JobSpec,
    options: SubmitOptions,
    read: Callable[[Connection, v1.Job], Awaitable[Result]],
) -> Job[Result]:
    """Submit a job, whose result `read` reads.

    The call is made again after a lost connection, and never makes a second job.
    """
    request = submit_request(spec, options)
    request.request_id = request.request_id or str(uuid.uuid4())
    return Job(connection, await connection.call(connection.jobs.SubmitJob, request), read)


async def submit_all(
    connection: Connection,
    jobs: Sequence[tuple[v1.JobSpec, SubmitOptions]],
    read: Callable[[Connection, v1.Job], Awaitable[Result]],
) -> list[Job[Result]]:
    """Submit jobs, `JOBS_AT_ONCE` at a time. Of those of one call all are accepted or none.

    A call is made again after a lost connection, and never makes a second job.
    """
    requests = [submit_request(spec, options) for spec, options in jobs]
    for request in requests:
        request.request_id = request.request_id or str(uuid.uuid4())
    submitted: list[Job[Result]] = []
    for start in range(0, len(requests), JOBS_AT_ONCE):
        message = v1.SubmitJobsRequest(requests=requests[start : start + JOBS_AT_ONCE])
        call = connection.jobs.SubmitJobs
        answer = await connection.call(call, message, timeout_s=PREPARING_TIMEOUT_S)
        submitted += [Job(connection, each, read) for each in answer.jobs]
    return submitted


def check_success(job: v1.Job) -> None:
    """Raise `JobUnsuccessful` unless the job has succeeded."""
    retry = f'try it again with lab.job("{job.name}").retry()'
    if job.state == v1.Job.STATE_FAILED:
        ending = f"failed: {job.error.message} ({job.error.reason})"
        raise JobUnsuccessful(job.name, ending, job.error.reason, f"remove the cause, then {retry}")
    if job.state == v1.Job.STATE_CANCELLED:
        raise JobUnsuccessful(job.name, "was cancelled", "CANCELLED", retry)
    if job.state != v1.Job.STATE_SUCCEEDED:
        raise JobUnsuccessful(job.name, "has not ended", "NOT_ENDED", "wait for it with wait()")


def job_name(id_or_name: str) -> str:
    """Return `jobs/{id}`."""
    return names.with_collection("jobs", id_or_name)
