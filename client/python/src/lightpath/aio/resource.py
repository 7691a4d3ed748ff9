"""Asynchronous base of what has a name on the server."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from lightpath import names

if TYPE_CHECKING:
    from lightpath.aio.connection import Connection


class Resource:
    """Something with a name, as the server described it last."""

    message: Any
    """The message of the API, with all fields."""

    def __init__(self, connection: Connection, message: Any) -> None:
        self._connection = connection
        self.message = message

    @property
    def name(self) -> str:
        """Resource name."""
        return str(self.message.name)

    @property
    def id(self) -> str:
        """The last part of the name."""
        return names.last_part(self.name)
