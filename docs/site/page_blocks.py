"""Read the blocks of a Markdown page that its test runs, and the comments that say how.

`run_pages.py` explains the comments.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

LANGUAGES = {"sh": "sh", "bash": "sh", "python": "python"}
_COMMENT = re.compile(r"<!-- test: (.*?)-->", re.DOTALL)
_REPLACE = re.compile(r"replace (.*) by (.*)")


@dataclass(frozen=True)
class Block:
    """What a page's test does: it runs a text in a shell or in Python, or replaces a text in the blocks that follow."""

    line: int
    """Line of the page on which the text begins."""
    kind: str
    """`sh`, `python` or `replace`."""
    text: str
    """What to run, or what to replace."""
    by: str = ""
    """What it is replaced by."""
    file: str = ""
    """File into which the text is written instead; empty: it is run."""
    skip: str = ""
    """Why it is not run; empty: it is run."""
    fails: bool = False
    """Whether it must end with an error."""


class PageError(Exception):
    """A comment of a page is wrong."""


def read_blocks(page: str) -> list[Block]:
    """Return the blocks of a page, in order."""
    reader, lines, i = _Reader(), page.splitlines(), 0
    while i < len(lines):
        if lines[i].strip().startswith("```"):
            i = reader.fence(lines, i)
        elif lines[i].strip().startswith("<!-- test:"):
            i = reader.comment(lines, i)
        i += 1
    if reader.next != _Next():
        raise PageError(f"no block follows the last comment, {reader.next}")
    return reader.blocks


@dataclass
class _Next:
    """What comments said about the next block."""

    skip: str = ""
    file: str = ""
    fails: bool = False


class _Reader:
    """What was read of a page so far. Each method returns the last line that it read."""

    def __init__(self) -> None:
        self.blocks: list[Block] = []
        self.next = _Next()
        self._skip_all = ""

    def fence(self, lines: list[str], begin: int) -> int:
        opening = lines[begin].strip()
        ticks = opening[: len(opening) - len(opening.lstrip("`"))]
        language = opening.strip("`").split(" ")[0]
        indent = lines[begin].index("`")
        end = next(n for n in range(begin + 1, len(lines)) if lines[n].strip() == ticks)
        if language in LANGUAGES:
            text = "\n".join(line[indent:] for line in lines[begin + 1 : end]) + "\n"
            said, self.next = self.next, _Next()
            skip = said.skip or self._skip_all
            block = Block(begin + 2, LANGUAGES[language], text, file=said.file, skip=skip, fails=said.fails)
            self.blocks.append(block)
        return end

    def comment(self, lines: list[str], begin: int) -> int:
        end = next(n for n in range(begin, len(lines)) if lines[n].rstrip().endswith("-->"))
        comment = _COMMENT.fullmatch("\n".join(lines[begin : end + 1]).strip())
        if comment is None:
            raise PageError(f"line {begin + 1}: this comment has another form")
        word = comment[1].strip()
        kind, _, value = word.partition(": ")
        if found := _REPLACE.fullmatch(word):
            by = "" if found[2] == "nothing" else found[2]
            self.blocks.append(Block(begin + 1, "replace", found[1], by=by))
        elif word.startswith(("run\n", "python\n")):
            kind, _, text = comment[1].partition("\n")
            self.blocks.append(Block(begin + 2, "sh" if kind == "run" else "python", text))
        elif kind == "skip":
            self.next.skip = value
        elif kind == "skip all":
            self._skip_all = value
        elif word.startswith("write "):
            self.next.file = word.removeprefix("write ")
        elif word == "fails":
            self.next.fails = True
        else:
            raise PageError(f"line {begin + 1}: `{word}` is not skip, write, fails, replace, run or python")
        return end
