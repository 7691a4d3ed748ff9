"""Asynchronous operation of a server: facts, events, the queue, stored files, keys and webhooks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lightpath import names, v1
from lightpath.aio.webhooks import Webhook
from lightpath.events import Event, read_event
from lightpath.retry import WAIT_TRIES_MAX, Backoff
from lightpath.server import Artifact, Batch, Keyring, Queue, ServerInfo, read_batch, read_queue, read_server
from lightpath.times import utc

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Sequence

    from lightpath.aio.connection import Connection
    from lightpath.aio.resource import Resource


class Operations:
    """What a server tells and does besides displays, datasets, kernels and jobs."""

    def __init__(self, connection: Connection) -> None:
        self.connection = connection

    async def server(self) -> ServerInfo:
        """Return facts about the server and about your token: `lab.server().role`. Every token may ask."""
        found = await self.connection.call(self.connection.servers.GetServer, v1.GetServerRequest())
        return read_server(found)

    async def events(self, *, after: Event | str = "") -> AsyncIterator[Event]:
        """Return every change on the server, without end. Survives restarts of the server, and misses nothing.

        `after` is the last event that you know, or its id. Without it, or if the server does not have the events since
        then, the first event is of the kind `reset`: read again what you show. It also comes after a restart.

        ```python
        for event in lab.events():
            if event.state == "failed":
                print(event.name, event.message.job.error.message)
        ```
        """
        last = after if isinstance(after, str) else after.id
        async for event in follow_events(self.connection, last):
            yield event

    async def queue(self) -> Queue:
        """Return the numbers of waiting and running jobs, the pauses, and the processes that run jobs."""
        return read_queue(await self.connection.call(self.connection.jobs.GetQueue, v1.GetQueueRequest()))

    async def pause_queue(self, *, display: Resource | str = "", reason: str = "") -> Queue:
        """Let no more jobs start, or none of one display. Running jobs continue, and new jobs are accepted."""
        request = v1.PauseQueueRequest(display=_display_name(display), reason=reason)
        return read_queue(await self.connection.call(self.connection.jobs.PauseQueue, request))

    async def resume_queue(self, *, display: Resource | str = "") -> Queue:
        """End a pause. Without `display` the pause of all displays ends, and those of single displays remain.

        Raises `PreconditionFailed` if there is no such pause.
        """
        request = v1.ResumeQueueRequest(display=_display_name(display))
        return read_queue(await self.connection.call(self.connection.jobs.ResumeQueue, request, repeatable=False))

    async def batch(self, name: str) -> Batch:
        """Return the numbers of the jobs that were submitted with `batch=name`, and their overall progress."""
        request = v1.GetBatchRequest(batch=name)
        return read_batch(await self.connection.call(self.connection.jobs.GetBatch, request))

    async def artifact(self, digest: str) -> Artifact:
        """Return the size of a stored file and since when it is stored; `lab.connection.download` has its bytes.

        Raises `NotFound` if it is not stored.
        """
        request = v1.GetArtifactRequest(digest=digest)
        found = await self.connection.call(self.connection.artifacts.GetArtifact, request)
        return Artifact(found.digest, found.size_bytes, utc(found.create_time))

    async def keyring(self) -> Keyring:
        """Return the keys that may sign manifests of kernels, signed by a root key."""
        found = await self.connection.call(self.connection.kernels.GetKeyring, v1.GetKeyringRequest())
        return Keyring(found.document, found.version)

    async def create_webhook(
        self, webhook_id: str, url: str, *, events: Sequence[str] = (), display: Resource | str = ""
    ) -> Webhook:
        """Let the server tell an address what happens. Keep the `secret` of the answer: it is not shown again.

        - `url`: its origin must be one of the server's setting `webhook_origins`
        - `events`: such as `["job.failed", "rollout.halted"]`; docs/webhooks.md lists them. Default: all
        - `display`: only events of this display

        ```python
        webhook = lab.create_webhook("ci", "https://ci.example/lightpath", events=["job.failed"])
        print(webhook.secret, webhook.test().answer)
        ```
        """
        request = v1.CreateWebhookRequest(id=webhook_id, url=url, events=events, display=_display_name(display))
        call = self.connection.webhooks.CreateWebhook
        return Webhook(self.connection, await self.connection.call(call, request, repeatable=False))

    async def webhook(self, webhook_id: str) -> Webhook:
        """Return a webhook, without its secret."""
        request = v1.GetWebhookRequest(name=names.with_collection("webhooks", webhook_id))
        return Webhook(self.connection, await self.connection.call(self.connection.webhooks.GetWebhook, request))

    async def webhooks(self) -> list[Webhook]:
        """Return all webhooks, in the order of their ids."""
        found = await self.connection.call(self.connection.webhooks.ListWebhooks, v1.ListWebhooksRequest())
        return [Webhook(self.connection, each) for each in found.webhooks]


async def follow_events(connection: Connection, last_id: str) -> AsyncIterator[Event]:
    """Return every change after the event of an id."""
    request = v1.WatchEventsRequest(last_event_id=last_id)
    async for message in connection.follow(connection.events.WatchEvents, request, Backoff(WAIT_TRIES_MAX)):
        # After a lost connection the call is made again with this request.
        request.last_event_id = message.id
        yield read_event(message)


def _display_name(display: Resource | str) -> str:
    if isinstance(display, str):
        return display and names.with_collection("displays", display)
    return display.name
