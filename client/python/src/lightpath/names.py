"""Resource names of the API."""

from __future__ import annotations


def with_collection(collection: str, id_or_name: str) -> str:
    """Return `{collection}/{id}`. A name that already begins so is returned unchanged."""
    return id_or_name if id_or_name.startswith(f"{collection}/") else f"{collection}/{id_or_name}"


def last_part(name: str) -> str:
    """Return the last part of a name: the id."""
    return name.rpartition("/")[2]


def kernel_text(version: str) -> str:
    """Return what people read of a version of a kernel, or of the ideal one."""
    if "/" in version:
        return f"kernel version {last_part(version)}"
    return "ideal kernel" if version == "ideal" else f"learned kernel ({version})"
