"""What a webhook sends, for its receivers and for those who watch over it."""

from __future__ import annotations

import base64
import binascii
import datetime as dt
import hashlib
import hmac
import json
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from lightpath.errors import InvalidArgument, InvalidSignature
from lightpath.times import utc, utc_if_set

if TYPE_CHECKING:
    from collections.abc import Mapping

    from lightpath import v1

MAX_AGE_S = 300.0
"""An older message is refused, so that nobody can send it again later."""


@dataclass(frozen=True)
class WebhookEvent:
    """An event that a receiver got."""

    id: str
    """The same at every attempt: remember the ids that you have handled."""
    type: str
    """What happened, such as `job.failed`."""
    time: dt.datetime
    data: dict[str, Any]
    """What it is about."""


@dataclass(frozen=True)
class Delivery:
    """Something that a webhook is to learn."""

    id: str
    """The receiver gets it as the header `webhook-id`."""
    type: str
    """What happened, such as `job.failed`."""
    data: dict[str, Any]
    """What it is about."""
    time: dt.datetime
    """Time of the event."""
    attempts: int
    delivered: bool
    """Whether the receiver has accepted it."""
    next_attempt_time: dt.datetime | None
    """None: the delivery has ended."""
    answer: str
    """Answer of the receiver or of the network to the latest attempt."""


def read_webhook(body: bytes, headers: Mapping[str, str], *, secret: str, max_age_s: float = MAX_AGE_S) -> WebhookEvent:
    """Return the event in a message to your receiver. Raises `InvalidSignature` if the server did not send it.

    - `body`: the bytes as they arrived
    - `headers`: those of the message, in capital or small letters
    - `secret`: the one that `lab.create_webhook` returned, `whsec_…`
    - `max_age_s`: the message may have been sent this long ago, or in the future [s]

    ```python
    event = lightpath.read_webhook(request.body, request.headers, secret=os.environ["WEBHOOK_SECRET"])
    if event.type == "job.failed":
        print(event.data["job"], event.data["error"])
    ```
    """
    found = {name.lower(): value for name, value in headers.items()}
    number, sent = found.get("webhook-id", ""), found.get("webhook-timestamp", "")
    signed = hmac.digest(_key(secret), f"{number}.{sent}.".encode() + body, hashlib.sha256)
    expected = b"v1," + base64.b64encode(signed)
    # While a secret is replaced, a message has several signatures.
    signatures = found.get("webhook-signature", "").encode().split()
    if not any(hmac.compare_digest(expected, each) for each in signatures):
        raise InvalidSignature("it is not signed with this secret", "compare it with the secret of the webhook")
    # The sender signed the number, so it is one.
    age_s = time.time() - int(sent)
    if abs(age_s) > max_age_s:
        raise InvalidSignature(f"it was sent {age_s:.0f} s ago", "set the clock of this machine, or drop the message")
    event = json.loads(body)
    at = dt.datetime.fromisoformat(event["timestamp"].replace("Z", "+00:00"))
    return WebhookEvent(number, event["type"], at, event["data"])


def read_delivery(message: v1.WebhookDelivery) -> Delivery:
    """Return the delivery that a message describes."""
    return Delivery(
        id=message.id,
        type=message.event,
        data=json.loads(message.data_json or "{}"),
        time=utc(message.event_time),
        attempts=message.attempts,
        delivered=message.delivered,
        next_attempt_time=utc_if_set(message, "next_attempt_time"),
        answer=message.answer,
    )


def _key(secret: str) -> bytes:
    try:
        key = base64.b64decode(secret.removeprefix("whsec_"), validate=True)
    except binascii.Error:
        key = b""
    # With an empty key everybody could sign.
    if not key or not secret.startswith("whsec_"):
        raise InvalidArgument("secret", "is no secret of a webhook", "give the text whsec_… of lab.create_webhook")
    return key
