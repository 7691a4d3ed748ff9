"""Comments and tables as Markdown."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

# Characters that Markdown would take for markup. Code between backticks stays as it is.
_MARKUP = re.compile(r"([\\*_<>\[\]{}$|])")


def prose(comment: str) -> str:
    """Return a comment as one paragraph of Markdown: only its backticks are markup."""
    parts = " ".join(comment.split()).split("`")
    return "`".join(part if i % 2 else _MARKUP.sub(r"\\\1", part) for i, part in enumerate(parts))


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table, or nothing if it has no rows."""
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    if not lines:
        return ""
    return "\n".join(["| " + " | ".join(head) + " |", "|" + "---|" * len(head), *lines]) + "\n"


def target(kind: str, name: str) -> str:
    """Return the name under which pages link to an element."""
    return f"{kind}-{name.lower().replace('.', '-')}"


def hidden_contents(pages: Iterable[str]) -> str:
    """Return a table of contents that only the navigation shows."""
    return "\n".join(["```{toctree}", ":hidden:", "", *pages, "```", ""])
