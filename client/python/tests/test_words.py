"""The table of words in docs/stability.md is true of the API, the command line and the package."""

from __future__ import annotations

import importlib
import re
from pathlib import Path
from typing import Any

import pytest

import lightpath

PACKAGE = Path(lightpath.__file__).parent
DOCUMENTS = Path(__file__).parents[3] / "docs"
COLUMNS = ("api", "command line", "python", "never")


def table() -> list[dict[str, list[str]]]:
    """The words of each row: those in code type, by column."""
    lines = (DOCUMENTS / "stability.md").read_text(encoding="utf-8").split("## Words")[1].splitlines()
    rows = [line.strip("|").split("|")[1:] for line in lines if line.startswith("|")][2:]
    return [{name: re.findall("`([^`]+)`", cell) for name, cell in zip(COLUMNS, row, strict=True)} for row in rows]


def words(column: str) -> list[str]:
    return [word for row in table() for word in row[column]]


def api_words() -> set[str]:
    """The names of all messages and fields of the API."""
    found = set[str]()

    def add(message: Any) -> None:
        found.add(message.name)
        found.update(field.name for field in message.fields)
        for nested in message.nested_types:
            add(nested)

    for path in (PACKAGE / "v1").glob("*_pb2.py"):
        for message in importlib.import_module(f"lightpath.v1.{path.stem}").DESCRIPTOR.message_types_by_name.values():
            add(message)
    return found


def flags() -> set[str]:
    """The options of all commands."""
    reference = (DOCUMENTS / "reference" / "command-line.md").read_text(encoding="utf-8")
    return set(re.findall(r"`(--[a-z-]+)", reference))


def python_words() -> set[str]:
    """The names that the package's sources define: parameters, attributes, functions and classes."""
    sources = [path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py") if "v1" not in path.parts]
    pattern = r"(?:def|class) (\w+)|(?<!\.)\b(\w+): |v1\.(\w+)"
    return {word for source in sources for words in re.findall(pattern, source) for word in words if word}


@pytest.mark.parametrize("unit", ["ms", "percent", "deg", "degrees", "mrad", "mm", "um", "nm", "kib", "mib"])
def test_units_are_those_of_the_si(unit: str) -> None:
    assert [word for word in api_words() if word.endswith(f"_{unit}")] == []


def test_table_has_rows() -> None:
    assert len(table()) >= 10
    assert all(row["api"] for row in table())


@pytest.mark.parametrize("word", words("api"))
def test_word_is_one_of_the_api(word: str) -> None:
    assert word in api_words()


@pytest.mark.parametrize("word", words("command line"))
def test_word_is_one_of_the_command_line(word: str) -> None:
    if word.startswith("--"):
        assert word in flags()
    else:
        # A line of a result.
        sources = (PACKAGE.parents[3] / "cli" / "src").rglob("*.rs")
        assert any(f'"{word}"' in source.read_text(encoding="utf-8") for source in sources)


@pytest.mark.parametrize("word", words("python"))
def test_word_is_one_of_the_package(word: str) -> None:
    assert word in python_words()


@pytest.mark.parametrize("word", words("never"))
def test_other_word_is_nowhere(word: str) -> None:
    assert word not in api_words()
    assert f"--{word.replace('_', '-')}" not in flags()
    assert word not in python_words()
