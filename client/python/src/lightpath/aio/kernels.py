"""Asynchronous kernels: versions, promotion, files and arrays."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from lightpath import html, v1, words
from lightpath.aio.connection import PREPARING_TIMEOUT_S, checked
from lightpath.aio.jobs import submit
from lightpath.aio.results import read_report
from lightpath.aio.rollouts import KernelRollouts
from lightpath.errors import ProtocolError, Unreachable
from lightpath.learned import LearnedKernel, from_npz, metrics_rows
from lightpath.options import SubmitOptions, check
from lightpath.presence import if_set
from lightpath.promotion import Verdict, read_verdict
from lightpath.retry import WAIT_TRIES_MAX, Backoff
from lightpath.server import KernelManifest, read_manifest
from lightpath.signature import with_options
from lightpath.units import show_length

if TYPE_CHECKING:
    import os
    from collections.abc import AsyncIterator

    from typing_extensions import Unpack

    from lightpath.aio.connection import Connection
    from lightpath.progress import Progress
    from lightpath.reports import Report


class Kernel(KernelRollouts):
    """What was learned about one display at one wavelength and distance: versions, of which one is active."""

    message: v1.Kernel

    def __repr__(self) -> str:
        active = f"version {self.active_version} active" if self.active_version else "no version active"
        return f"<Kernel {self.name}: {active}, latest {self.latest_version}>"

    @property
    def name(self) -> str:
        """Resource name, `displays/{id}/kernels/{wavelength}-{distance}`."""
        return self.message.name

    @property
    def active_version(self) -> int | None:
        """Number of the version that holograms use; None: no version is active."""
        version: int | None = if_set(self.message, "active_version")
        return version

    @property
    def latest_version(self) -> int:
        """Number of the newest version."""
        return self.message.latest_version

    async def refresh(self) -> Kernel:
        """Read the kernel again."""
        request = v1.GetKernelRequest(name=self.name)
        self.message = await self._connection.call(self._connection.kernels.GetKernel, request)
        return self

    async def version(self, number: int) -> KernelVersion:
        """Return a version."""
        return await read_version(self._connection, f"{self.name}/versions/{number}")

    async def versions(self) -> list[KernelVersion]:
        """Return all versions, the newest first."""
        request, versions = v1.ListKernelVersionsRequest(kernel=self.name, page_size=1000), []
        async for page in self._connection.pages(self._connection.kernels.ListKernelVersions, request):
            versions += [KernelVersion(self._connection, each) for each in page.versions]
        return versions

    async def promote(self, version: int, *, reason: str = "", force: bool = False) -> Kernel:
        """Make a version active: from now on holograms use it.

        Raises `PreconditionFailed` if it does not pass the display's promotion gate; `force` with a `reason` overrides
        that.
        """
        request = v1.PromoteKernelRequest(kernel=self.name, version=version, reason=reason, force=force)
        self.message = await self._connection.call(
            self._connection.kernels.PromoteKernel, request, repeatable=False, timeout_s=PREPARING_TIMEOUT_S
        )
        return self

    async def rollback(self, *, reason: str = "") -> Kernel:
        """Undo the last promotion. Raises `Aborted` if somebody has moved `active` since this object was read."""
        expected = self.active_version or 0
        request = v1.RollbackKernelRequest(kernel=self.name, reason=reason, expected_active_version=expected)
        self.message = await self._connection.call(self._connection.kernels.RollbackKernel, request, repeatable=False)
        return self

    async def set_alias(self, alias: str, version: int, *, reason: str = "") -> Kernel:
        """Let a name for people, such as `best`, stand for a version: `display.optimize(…, kernel="best")`."""
        return await self._set_alias(alias, version, reason)

    async def remove_alias(self, alias: str, *, reason: str = "") -> Kernel:
        """Let a name stand for no version any more."""
        return await self._set_alias(alias, None, reason)

    async def _set_alias(self, alias: str, version: int | None, reason: str) -> Kernel:
        request = v1.SetKernelAliasRequest(kernel=self.name, alias=alias, version=version, reason=reason)
        self.message = await self._connection.call(self._connection.kernels.SetKernelAlias, request)
        return self

    async def manifest(self, *, format: words.KernelFormat | None = None, device: str = "") -> KernelManifest:
        """Return the signed document that tells devices which file holds the active version.

        `device` is the id of the device that asks: during a rollout it decides about the version.
        """
        number = words.number("format", v1.KernelFormat, format)
        request = v1.GetKernelManifestRequest(kernel=self.name, format=number, device=device)
        call = self._connection.kernels.GetKernelManifest
        return read_manifest(await self._connection.call(call, request, timeout_s=PREPARING_TIMEOUT_S))

    async def fetch(self, version: int | None = None) -> LearnedKernel:
        """Return a version as arrays, by default the active one."""
        return await fetch_arrays(self._connection, self.name, version)

    async def save(
        self,
        path: str | os.PathLike[str],
        *,
        version: int | None = None,
        format: words.KernelFormat = "safetensors",
    ) -> v1.KernelVersion:
        """Write a version to a file, and return what is known about it. Default: the active one."""
        found, content = await fetch_file(self._connection, self.name, version, format)
        Path(path).write_bytes(content)
        return found

    async def moves(self) -> list[v1.KernelMove]:
        """Return the promotions and rollbacks, the newest first."""
        request = v1.ListKernelMovesRequest(kernel=self.name, page_size=1000)
        moves: list[v1.KernelMove] = []
        async for page in self._connection.pages(self._connection.kernels.ListKernelMoves, request):
            moves += page.moves
        return moves

    async def watch(self) -> AsyncIterator[v1.Kernel]:
        """Return the kernel, and again after every change, without end. Survives restarts of the server."""
        request = v1.WatchKernelRequest(name=self.name)
        call = self._connection.kernels.WatchKernel
        async for message in self._connection.follow(call, request, Backoff(WAIT_TRIES_MAX)):
            self.message = message
            yield message

    def _repr_html_(self) -> str:
        message = self.message
        rows: list[tuple[str, object]] = [
            ("display", message.display),
            (
                "wavelength, distance",
                f"{show_length(message.wavelength_m)}, {show_length(message.place.distance_m)}",
            ),
            ("active version", self.active_version or "none"),
            ("latest version", message.latest_version),
        ]
        rows += [(f"alias {alias}", f"version {version}") for alias, version in sorted(message.aliases.items())]
        return html.table(self.name, rows)


class KernelVersion:
    """A version of a kernel. It never changes."""

    def __init__(self, connection: Connection, message: v1.KernelVersion) -> None:
        self._connection = connection
        self.message = message

    def __repr__(self) -> str:
        loss = f"test loss {self.metrics.test_loss:.3g}" if self.is_measured else "not measured"
        return f"<KernelVersion {self.name}, model {self.model}: {loss}>"

    @property
    def name(self) -> str:
        """Resource name, `{kernel}/versions/{n}`."""
        return self.message.name

    @property
    def number(self) -> int:
        """Number of the version, from 1."""
        return self.message.version

    @property
    def model(self) -> str:
        """What was learned, such as `display`."""
        return words.name_of(v1.KernelModel, self.message.model)

    @property
    def is_measured(self) -> bool:
        """Whether the version has metrics. Versions that were imported or interpolated were not measured."""
        return self.message.HasField("metrics")

    @property
    def metrics(self) -> v1.KernelMetrics:
        """Losses on the photographs, also with the ideal kernel. They mean something only if `is_measured`."""
        return self.message.metrics

    async def kernel(self) -> Kernel:
        """Return the kernel of the version."""
        request = v1.GetKernelRequest(name=self._kernel_name)
        return Kernel(self._connection, await self._connection.call(self._connection.kernels.GetKernel, request))

    async def promote(self, *, reason: str = "", force: bool = False) -> Kernel:
        """Make this version active: from now on holograms use it. See `Kernel.promote`."""
        return await (await self.kernel()).promote(self.number, reason=reason, force=force)

    async def check_promotion(self) -> Verdict:
        """Return whether the version passes the display's promotion gate, with the numbers. Changes nothing."""
        request = v1.CheckPromotionRequest(name=self.name)
        return read_verdict(await self._connection.call(self._connection.kernels.CheckPromotion, request))

    async def deprecate(self, reason: str, *, undo: bool = False) -> KernelVersion:
        """Mark the version as one that should not be used any more, or take that back with `undo`."""
        request = v1.DeprecateKernelVersionRequest(name=self.name, reason=reason, undo=undo)
        self.message = await self._connection.call(self._connection.kernels.DeprecateKernelVersion, request)
        return self

    async def fetch(self) -> LearnedKernel:
        """Return the version as arrays."""
        return await fetch_arrays(self._connection, self._kernel_name, self.number)

    async def learning(self) -> v1.LearnKernelResult:
        """Return how the version was learned: the history of the loss, and the parts that the display needed."""
        lineage = self.message.lineage
        request = v1.GetJobRequest(name=lineage.learned.job or lineage.interpolated.job)
        return (await self._connection.call(self._connection.jobs.GetJob, request)).result.learn_kernel

    @with_options(SubmitOptions)
    async def report(self, *, progress: Progress = True, **options: Unpack[SubmitOptions]) -> Report:
        """Make a report of what was learned, with pictures and numbers."""
        check(options, SubmitOptions)
        spec = v1.JobSpec(report_kernel=v1.ReportKernel(kernel_version=self.name))
        job = await submit(self._connection, spec, options, read_report)
        return await job.result(progress=progress)

    async def compare(self, other: KernelVersion) -> v1.KernelComparison:
        """Compare with another version of the same display and wavelength: numbers, and a picture of the difference."""
        request = v1.CompareKernelVersionsRequest(first=self.name, second=other.name)
        return await self._connection.call(self._connection.kernels.CompareKernelVersions, request)

    @property
    def _kernel_name(self) -> str:
        return self.name.partition("/versions/")[0]

    def _repr_html_(self) -> str:
        rows: list[tuple[str, object]] = [("model", self.model), *metrics_rows(self.message)]
        metrics = self.metrics
        rows += [(f"without {part.name.replace('_', ' ')}", f"{part.cost_db.value:+.1f} dB") for part in metrics.parts]
        if self.message.HasField("deprecation"):
            rows.append(("deprecated", self.message.deprecation.reason))
        return html.table(self.name, rows)


async def read_version(connection: Connection, name: str) -> KernelVersion:
    """Return the version of a name."""
    request = v1.GetKernelVersionRequest(name=name)
    return KernelVersion(connection, await connection.call(connection.kernels.GetKernelVersion, request))


async def read_learned(connection: Connection, job: v1.Job) -> list[KernelVersion]:
    """Return the versions that a job learned, one for each of its datasets."""
    return [await read_version(connection, learned.kernel_version) for learned in job.result.learn_kernel.kernels]


async def list_kernels(connection: Connection, display: str) -> list[Kernel]:
    """Return the kernels of a display, or of all displays if the name is empty."""
    request, kernels = v1.ListKernelsRequest(display=display, page_size=1000), []
    async for page in connection.pages(connection.kernels.ListKernels, request):
        kernels += [Kernel(connection, each) for each in page.kernels]
    return kernels


async def fetch_arrays(connection: Connection, kernel: str, version: int | None) -> LearnedKernel:
    """Return a version as arrays."""
    found, content = await fetch_file(connection, kernel, version, "npz")
    return from_npz(found, content)


async def fetch_file(
    connection: Connection, kernel: str, version: int | None, format: words.KernelFormat
) -> tuple[v1.KernelVersion, bytes]:
    """Return a version and its file, checked against its digest. A download that was cut continues."""
    backoff, content = Backoff(), bytearray()
    request = v1.FetchKernelRequest(
        kernel=kernel, version=version, format=words.number("format", v1.KernelFormat, format)
    )
    found, digest = v1.KernelVersion(), ""
    while True:
        before_bytes = request.offset_bytes = len(content)
        try:
            async for message in connection.stream(connection.kernels.FetchKernel, request):
                part = message.WhichOneof("part")
                if part == "version":
                    found, digest = message.version, message.version.artifact
                    # If another version becomes active meanwhile, the rest must still be of this one.
                    request.version = found.version
                elif part == "file":
                    digest = message.file.digest
                else:
                    content += message.chunk
        except Unreachable as error:
            failure = error
        else:
            if not found.name:
                raise ProtocolError("a fetched kernel has no version")
            return found, checked(bytes(content), digest)
        if len(content) > before_bytes:
            backoff.reset()
        await connection.pause(backoff, failure)
