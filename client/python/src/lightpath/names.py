"""Resource names of the API."""

from __future__ import annotations


def with_collection(collection: str, id_or_name: str) -> str:
    """Return `{collection}/{id}`. A name that already begins so is returned unchanged."""
    return id_or_name if id_or_name.startswith(f"{collection}/") else f"{collection}/{id_or_name}"


def last_part(name: str) -> str:
    """Return the last part of a name: the id."""
    return name.rpartition("/")[2]
