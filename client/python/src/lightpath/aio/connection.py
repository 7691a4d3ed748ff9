"""Asynchronous connection: calls that are made again where that helps, uploads and downloads that resume."""

from __future__ import annotations

import asyncio
import hashlib
from typing import TYPE_CHECKING, Any, TypeVar

import grpc
import grpc.aio

from lightpath import v1
from lightpath.errors import Damaged, ProtocolError, Unreachable, from_rpc_error
from lightpath.retry import Backoff
from lightpath.v1.artifact_pb2_grpc import ArtifactServiceStub
from lightpath.v1.dataset_pb2_grpc import DatasetServiceStub
from lightpath.v1.device_pb2_grpc import DeviceServiceStub
from lightpath.v1.display_pb2_grpc import DisplayServiceStub
from lightpath.v1.event_pb2_grpc import EventServiceStub
from lightpath.v1.job_pb2_grpc import JobServiceStub
from lightpath.v1.kernel_pb2_grpc import KernelServiceStub
from lightpath.v1.photo_pb2_grpc import PhotoServiceStub
from lightpath.v1.rig_pb2_grpc import RigServiceStub
from lightpath.v1.rollout_pb2_grpc import RolloutServiceStub
from lightpath.v1.server_pb2_grpc import ServerServiceStub
from lightpath.v1.webhook_pb2_grpc import WebhookServiceStub

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Iterator

    from lightpath.address import Address
    from lightpath.errors import LightpathError

Request = TypeVar("Request")
Response = TypeVar("Response")

CALL_TIMEOUT_S = 60.0
"""Time limit for the answer to a call that does not stream."""

PREPARING_TIMEOUT_S = 600.0
"""Time limit for the answer to a call that first makes all files that devices will need."""

CHUNK_BYTES = 1 << 20
"""Size of a chunk. The server accepts up to 2 MiB. Smaller chunks lose less when the connection is lost."""


class Connection:
    """One connection to a server. It opens with the first call, and again after it was lost.

    The attributes `artifacts`, `datasets`, … are the stubs of gRPC, for fields that no method of this package gives:
    `lab.connection.call(lab.connection.jobs.ListJobs, lightpath.v1.ListJobsRequest(text="eye"))`.
    """

    def __init__(self, address: Address) -> None:
        self.address = address
        self.url = address.url
        if address.credentials is None:
            self.channel = grpc.aio.insecure_channel(address.target, options=address.options)
        else:
            self.channel = grpc.aio.secure_channel(address.target, address.credentials, options=address.options)
        self.artifacts = ArtifactServiceStub(self.channel)
        self.datasets = DatasetServiceStub(self.channel)
        self.devices = DeviceServiceStub(self.channel)
        self.displays = DisplayServiceStub(self.channel)
        self.events = EventServiceStub(self.channel)
        self.jobs = JobServiceStub(self.channel)
        self.kernels = KernelServiceStub(self.channel)
        self.photos = PhotoServiceStub(self.channel)
        self.rigs = RigServiceStub(self.channel)
        self.rollouts = RolloutServiceStub(self.channel)
        self.servers = ServerServiceStub(self.channel)
        self.webhooks = WebhookServiceStub(self.channel)
        # A server that never answered is probably not there. Then an error at once is better than 15 s of tries.
        self._reached = False

    def failure(self, error: grpc.RpcError) -> LightpathError:
        """Return the exception for a failed call."""
        failure = from_rpc_error(self.url, error)
        self._reached |= not isinstance(failure, Unreachable)
        return failure

    async def pause(self, backoff: Backoff, failure: LightpathError) -> None:
        """Wait before the next try. Raises `failure` if another try cannot help."""
        if isinstance(failure, Unreachable) and not self._reached:
            raise failure
        await asyncio.sleep(backoff.pause_s(failure))

    async def call(
        self,
        method: grpc.aio.UnaryUnaryMultiCallable[Request, Response],
        request: Request,
        *,
        repeatable: bool = True,
        timeout_s: float = CALL_TIMEOUT_S,
    ) -> Response:
        """Make a call, and make it again after a lost connection if it is `repeatable`."""
        backoff = Backoff(1) if not repeatable else Backoff()
        while True:
            try:
                response = await method(request, timeout=timeout_s, metadata=self.address.metadata)
            except grpc.RpcError as error:
                failure = self.failure(error)
            else:
                self._reached = True
                return response
            await self.pause(backoff, failure)

    async def pages(
        self, method: grpc.aio.UnaryUnaryMultiCallable[Request, Response], request: Request
    ) -> AsyncIterator[Response]:
        """Return all pages of a list, from that of the `request` on."""
        listing: Any = request
        while True:
            page: Any = await self.call(method, request)
            yield page
            if not page.next_page_token:
                return
            listing.page_token = page.next_page_token

    async def stream(
        self, method: grpc.aio.UnaryStreamMultiCallable[Request, Response], request: Request
    ) -> AsyncIterator[Response]:
        """Make a call whose answer is a stream, once."""
        stream: Any = method(request, metadata=self.address.metadata)
        try:
            async for message in stream:
                self._reached = True
                yield message
        except grpc.RpcError as error:
            failure = self.failure(error)
        else:
            return
        finally:
            stream.cancel()
        raise failure

    async def follow(
        self, method: grpc.aio.UnaryStreamMultiCallable[Request, Response], request: Request, backoff: Backoff
    ) -> AsyncIterator[Response]:
        """Return the messages of a stream without end. After a lost connection the same `request` is made again."""
        while True:
            # A server that stops ends the stream without an error.
            failure = Unreachable(self.url, "the server ended the stream")
            try:
                async for message in self.stream(method, request):
                    backoff.reset()
                    yield message
            except Unreachable as error:
                failure = error
            await self.pause(backoff, failure)

    async def upload(self, content: bytes) -> str:
        """Store bytes on the server, and return their digest. Sends only what the server does not have."""
        digest = f"sha256-{hashlib.sha256(content).hexdigest()}"
        backoff, received_before = Backoff(), 0
        while True:
            upload = await self.call(self.artifacts.GetUpload, v1.GetUploadRequest(digest=digest))
            if upload.complete:
                return digest
            if upload.received_bytes > received_before:
                received_before = upload.received_bytes
                backoff.reset()
            # A stored part longer than the content cannot be its beginning: send everything.
            offset_bytes = upload.received_bytes if upload.received_bytes <= len(content) else 0
            messages = _upload_messages(digest, content, offset_bytes)
            try:
                stored = await self.artifacts.WriteArtifact(messages, metadata=self.address.metadata)
            except grpc.RpcError as error:
                failure = self.failure(error)
            else:
                if stored.digest != digest:
                    raise ProtocolError("it stored an upload under another digest")
                return digest
            await self.pause(backoff, failure)

    async def download(self, digest: str) -> bytes:
        """Return the bytes of an artifact, checked against their digest. Continues after a lost connection."""
        content, backoff = bytearray(), Backoff()
        while True:
            before_bytes = len(content)
            request = v1.ReadArtifactRequest(digest=digest, offset_bytes=before_bytes)
            try:
                async for message in self.stream(self.artifacts.ReadArtifact, request):
                    content += message.chunk
            except Unreachable as error:
                failure = error
            else:
                return checked(bytes(content), digest)
            if len(content) > before_bytes:
                backoff.reset()
            await self.pause(backoff, failure)

    async def close(self) -> None:
        """Close the connection. Jobs go on."""
        await self.channel.close()


def checked(content: bytes, digest: str) -> bytes:
    """Return the content. Raises `Damaged` if it does not match its digest."""
    found = f"sha256-{hashlib.sha256(content).hexdigest()}"
    if found != digest:
        raise Damaged(f"the bytes of {digest} arrived damaged: their digest is {found}; {Damaged.fix}")
    return content


def _upload_messages(digest: str, content: bytes, offset_bytes: int) -> Iterator[v1.WriteArtifactRequest]:
    start = v1.WriteArtifactStart(digest=digest, size_bytes=len(content), offset_bytes=offset_bytes)
    yield v1.WriteArtifactRequest(start=start)
    for begin in range(offset_bytes, len(content), CHUNK_BYTES):
        yield v1.WriteArtifactRequest(chunk=content[begin : begin + CHUNK_BYTES])
