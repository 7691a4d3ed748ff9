"""Numbers that a message may lack."""

from __future__ import annotations

from typing import Any


def if_set(message: Any, field: str) -> Any:
    """Return the number in a field of a message; None if the field is not set, which reads as 0 otherwise."""
    return getattr(message, field) if message.HasField(field) else None
