"""The server itself: who asks, the queue with its processes, batches, stored files, and the keys for devices."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from lightpath import v1, words
from lightpath.presence import if_set
from lightpath.times import utc

if TYPE_CHECKING:
    import datetime as dt


@dataclass(frozen=True)
class ServerInfo:
    """Facts about the server and about the caller's token."""

    version: str
    """Version of the program, such as `0.1.0`."""
    time: dt.datetime
    """The server's clock."""
    token: str
    """Name of the caller's token. Empty: the server requires no tokens."""
    role: str
    """Role of the caller: `viewer`, `submitter`, `curator`, `firmware` or `admin`."""
    displays: tuple[str, ...]
    """Displays that the token is valid for, `displays/{id}`. Empty: all displays."""
    disk_free_bytes: int
    """Free space on the disk of the server's data."""
    disk_reserve_bytes: int
    """With less free space the server accepts no new work."""


@dataclass(frozen=True)
class Turn:
    """Numbers of an owner's jobs in the queue."""

    owner: str
    queued: int
    running: int


@dataclass(frozen=True)
class Pause:
    """A pause: no job starts, or none of one display."""

    display: str
    """The paused display, `displays/{id}`. Empty: all displays."""
    since: dt.datetime
    reason: str


@dataclass(frozen=True)
class Process:
    """A living process that serves or runs jobs."""

    name: str
    """Name of its workers in the events of jobs."""
    kind: str
    """`server`, `worker` or `both`."""
    version: str
    labels: tuple[str, ...]
    """It runs jobs whose `needs` are among these."""
    memory_bytes: int | None
    """Largest estimated memory of a job that it starts; None: it runs no jobs."""
    workers: int
    """Number of jobs that it runs at the same time."""
    start_time: dt.datetime
    seen_time: dt.datetime
    """Last sign of life."""


@dataclass(frozen=True)
class Queue:
    """The numbers of waiting and running jobs, the pauses, and the processes."""

    queued: int
    running: int
    turns: tuple[Turn, ...]
    pauses: tuple[Pause, ...]
    processes: tuple[Process, ...] = field(repr=False)


@dataclass(frozen=True)
class Batch:
    """The numbers of a batch's jobs, and their overall progress."""

    name: str
    queued: int
    running: int
    succeeded: int
    failed: int
    cancelled: int
    done: float
    """Mean progress of the jobs, 0 to 1. Jobs that have ended count as 1."""

    @property
    def ended(self) -> bool:
        """Whether no job waits or runs."""
        return self.queued + self.running == 0


@dataclass(frozen=True)
class Artifact:
    """A file that the server stores."""

    digest: str
    """`sha256-…`"""
    size_bytes: int
    create_time: dt.datetime


@dataclass(frozen=True)
class Keyring:
    """The keys that may sign manifests, in a document that a root key signed. docs/firmware.md describes it."""

    document: str = field(repr=False)
    version: int
    """It rises with every change."""


@dataclass(frozen=True)
class KernelManifest:
    """Which file holds a kernel's active version, in a signed document. docs/firmware.md describes it."""

    document: str = field(repr=False)
    generation: int
    """Number of changes of what devices of the display get."""
    version: int
    """Number of the version."""
    digest: str
    """Digest of the file, `sha256-…`."""
    size_bytes: int
    expire_time: dt.datetime
    """The manifest counts no more from this time on."""
    poll_after_s: int
    """Seconds after which a device should ask again."""


def read_server(message: v1.Server) -> ServerInfo:
    """Return what a message says about the server."""
    return ServerInfo(
        version=message.version,
        time=utc(message.time),
        token=message.token,
        role=message.role,
        displays=tuple(message.displays),
        disk_free_bytes=message.disk_free_bytes,
        disk_reserve_bytes=message.disk_reserve_bytes,
    )


def read_queue(message: v1.Queue) -> Queue:
    """Return what a message says about the queue."""
    return Queue(
        queued=message.queued,
        running=message.running,
        turns=tuple(Turn(each.owner, each.queued, each.running) for each in message.turns),
        pauses=tuple(Pause(each.display, utc(each.since), each.reason) for each in message.pauses),
        processes=tuple(
            Process(
                name=each.name,
                kind=words.name_of(v1.Queue.Process.Kind, each.kind),
                version=each.version,
                labels=tuple(each.labels),
                memory_bytes=if_set(each, "memory_bytes"),
                workers=each.workers,
                start_time=utc(each.start_time),
                seen_time=utc(each.seen_time),
            )
            for each in message.processes
        ),
    )


def read_batch(message: v1.Batch) -> Batch:
    """Return what a message says about a batch."""
    return Batch(
        name=message.batch,
        queued=message.queued,
        running=message.running,
        succeeded=message.succeeded,
        failed=message.failed,
        cancelled=message.cancelled,
        done=message.done,
    )


def read_manifest(message: v1.KernelManifest) -> KernelManifest:
    """Return what a message says about a manifest."""
    return KernelManifest(
        document=message.document,
        generation=message.generation,
        version=message.version,
        digest=message.digest,
        size_bytes=message.size_bytes,
        expire_time=utc(message.expire_time),
        poll_after_s=message.poll_after_s,
    )
