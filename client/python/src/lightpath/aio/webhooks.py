"""Asynchronous webhooks: addresses that the server tells what happened."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from google.protobuf.field_mask_pb2 import FieldMask

from lightpath import html, v1
from lightpath.aio.resource import Resource
from lightpath.errors import InvalidArgument
from lightpath.times import utc_if_set
from lightpath.webhooks import Delivery, read_delivery

if TYPE_CHECKING:
    import datetime as dt
    from collections.abc import Iterable

# Pause between two looks at the answer of a receiver [s].
_LOOK_EVERY_S = 0.1


class Webhook(Resource):
    """An address that learns of events. `Lab.create_webhook` creates one."""

    message: v1.Webhook

    def __repr__(self) -> str:
        return f"<Webhook {self.id} to {self.url}, {', '.join(self.events) or 'all events'}>"

    @property
    def url(self) -> str:
        """The address."""
        return self.message.url

    @property
    def events(self) -> list[str]:
        """The events that it learns of, such as `job.failed`. Empty: all."""
        return list(self.message.events)

    @property
    def display(self) -> str:
        """The display whose events it learns of, `displays/{id}`. Empty: all displays."""
        return self.message.display

    @property
    def secret(self) -> str:
        """The key of its signatures, for `lightpath.read_webhook`. Only `Lab.create_webhook` returns it."""
        return self.message.secret

    @property
    def create_time(self) -> dt.datetime | None:
        """Time of its creation."""
        return utc_if_set(self.message, "create_time")

    async def update(
        self,
        *,
        url: str | None = None,
        events: Iterable[str] | None = None,
        display: str | None = None,
        expected_revision: int | None = None,
    ) -> Webhook:
        """Change the address, the events or the display. What is not given stays.

        Empty `events` mean all events, an empty `display` (`displays/{id}`) all displays. With `expected_revision`,
        such as `webhook.message.revision`, raises `Aborted` if somebody changed the webhook since.
        """
        given = {"url": url, "events": events, "display": display}
        request = v1.UpdateWebhookRequest(
            webhook=v1.Webhook(name=self.name, url=url or "", events=events or (), display=display or ""),
            update_mask=FieldMask(paths=[name for name, value in given.items() if value is not None]),
            expected_revision=expected_revision,
        )
        if not request.update_mask.paths:
            raise InvalidArgument("url", "is missing, and events and display too", "give what changes")
        call = self._connection.webhooks.UpdateWebhook
        self.message = await self._connection.call(call, request, repeatable=False)
        return self

    async def test(self, *, timeout_s: float = 10.0) -> Delivery:
        """Send the event `webhook.test`, and return its delivery with the answer of the receiver.

        If there is no answer after `timeout_s` the delivery still waits; the server repeats it for three days.
        """
        request = v1.TestWebhookRequest(name=self.name)
        sent = await self._connection.call(self._connection.webhooks.TestWebhook, request, repeatable=False)
        delivery = read_delivery(sent)
        for _ in range(round(timeout_s / _LOOK_EVERY_S)):
            if delivery.attempts:
                break
            await asyncio.sleep(_LOOK_EVERY_S)
            delivery = next((each for each in await self.deliveries(limit=50) if each.id == sent.id), delivery)
        return delivery

    async def deliveries(self, *, limit: int = 1000) -> list[Delivery]:
        """Return what the webhook is to learn and what it has learned lately, the newest first.

        ```python
        lost = [each for each in webhook.deliveries() if not each.delivered and each.next_attempt_time is None]
        ```
        """
        request = v1.ListWebhookDeliveriesRequest(webhook=self.name, page_size=min(limit, 1000))
        found: list[Delivery] = []
        async for page in self._connection.pages(self._connection.webhooks.ListWebhookDeliveries, request):
            found += [read_delivery(each) for each in page.deliveries]
            if len(found) >= limit:
                break
        return found[:limit]

    async def delete(self) -> None:
        """Delete the webhook, with what it has not received yet."""
        request = v1.DeleteWebhookRequest(name=self.name)
        await self._connection.call(self._connection.webhooks.DeleteWebhook, request, repeatable=False)

    def _repr_html_(self) -> str:
        rows: list[tuple[str, object]] = [
            ("address", self.url),
            ("events", ", ".join(self.events) or "all"),
            ("display", self.display or "all"),
        ]
        return html.table(self.name, rows)
