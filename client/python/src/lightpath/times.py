"""Times of the API as times of Python, in UTC."""

from __future__ import annotations

import datetime as dt
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from google.protobuf.timestamp_pb2 import Timestamp


def utc(time: Timestamp) -> dt.datetime:
    """Return a time."""
    return time.ToDatetime(tzinfo=dt.timezone.utc)


def utc_if_set(message: Any, field: str) -> dt.datetime | None:
    """Return the time in a field of a message; None if the field is not set."""
    return utc(getattr(message, field)) if message.HasField(field) else None
