"""The Python package, from its docstrings."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from typing import TYPE_CHECKING

import griffe

from references.text import prose, table, target

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

_PACKAGE = "lightpath"
# Chapters, with the names of `lightpath` that they have. Names that no chapter has are exceptions and types.
_CHAPTERS = {
    "Connecting": ["connect", "Lab", "Connection"],
    "Displays and holograms": ["Display", "Hologram", "HologramOptions", "SimulatedBench", "AllOrders", "OrderFilter"],
    "Photographs and datasets": ["Photograph", "PhotoScore", "Dataset", "Evaluation"],
    "Kernels": ["Kernel", "KernelVersion", "LearnedKernel", "LearnOptions", "Report"],
    "Jobs": ["Job", "SubmitOptions", "Batch", "Queue"],
    "Rollouts and devices": ["Rollout", "Device", "PromotionGate", "Verdict", "KernelManifest", "Keyring"],
    "The server": ["ServerInfo", "Event", "Artifact", "Webhook", "Delivery", "read_webhook", "WebhookEvent"],
}
_MODULES = {"aio", "v1"}

_INTRODUCTION = """# Python

Everything that `import lightpath` has, from the docstrings. [Lightpath for Python](../../client/python/README.md) shows
how to use it. `lightpath.aio` has the same classes, whose methods are coroutines. `lightpath.v1` has the messages of
the [gRPC API](grpc/README.md).

<!-- test: skip all: each example is of one method, on an object that its reader has -->

"""


def page(folder: Path) -> str:
    """Return the page, for the package whose project is in a folder."""
    package = _package(folder)
    named = {name for names in _CHAPTERS.values() for name in names}
    exports = [str(each) for each in package.exports or [] if str(each) not in _MODULES | named]
    exceptions = [each for each in exports if _bases(package[each])]
    chapters = {
        **_CHAPTERS,
        "Errors": exceptions,
        "Types of arguments": sorted(set(exports) - set(exceptions)),
    }
    parts = [_INTRODUCTION]
    for title, names in chapters.items():
        parts += [f"## {title}", ""]
        for name in names:
            parts += _element(name, _resolved(package[name]))
    parts += ["## Figures", "", _docstring(package["plot"])]
    for name, function in package["plot"].functions.items():
        if not name.startswith("_"):
            parts += _function(f"plot.{name}", _resolved_function(function), level=3)
    return "\n".join(parts) + "\n"


def _package(folder: Path) -> griffe.Object | griffe.Alias:
    """Read the package in a copy, so that its generated parts are those of the present sources."""
    with tempfile.TemporaryDirectory() as copy:
        shutil.copytree(folder / "src", copy, dirs_exist_ok=True)
        subprocess.run([sys.executable, folder / "generate", copy], check=True)
        return griffe.load(_PACKAGE, search_paths=[copy])


def _resolved(element: griffe.Object | griffe.Alias) -> griffe.Object:
    return element.final_target if isinstance(element, griffe.Alias) else element


def _resolved_function(element: griffe.Function | griffe.Alias) -> griffe.Function:
    found = _resolved(element)
    assert isinstance(found, griffe.Function)
    return found


def _bases(element: griffe.Object | griffe.Alias) -> bool:
    """Whether a class is an exception: all of the package are in one module."""
    return _resolved(element).path.startswith(f"{_PACKAGE}.errors.")


def _docstring(element: griffe.Object | griffe.Alias) -> str:
    """Return a docstring. It is Markdown already."""
    return element.docstring.value.strip() + "\n" if element.docstring else ""


def _element(name: str, element: griffe.Object) -> Iterable[str]:
    if isinstance(element, griffe.Function):
        return _function(f"{_PACKAGE}.{name}", element, level=3)
    if isinstance(element, griffe.Class):
        return _class(name, element)
    return [f"({target('python', name)})=", "", f"### {_PACKAGE}.{name}", "", _docstring(element), _value(element)]


def _value(element: griffe.Object) -> str:
    if element.path.startswith(f"{_PACKAGE}.v1."):
        return f"The message [{element.name}](#{target('message', element.name)}) of the API.\n"
    value = getattr(element, "value", None)
    return f"```text\n{value}\n```\n" if value else ""


def _class(name: str, element: griffe.Class) -> Iterator[str]:
    if element.path.startswith(f"{_PACKAGE}.v1."):
        yield from [f"### {_PACKAGE}.{name}", "", _value(element)]
        return
    yield from [f"({target('python', name)})=", "", f"### {_PACKAGE}.{name}", "", _docstring(element)]
    bases = [str(base) for base in element.bases if str(base) not in {"TypedDict", "Generic"}]
    # The members below are those of the bases, too. What divides the client into files says nothing to readers.
    if bases and not element.path.startswith(f"{_PACKAGE}.sync."):
        yield f"Bases: {', '.join(f'`{base}`' for base in bases)}\n"
    public = {key: _resolved(each) for key, each in element.all_members.items() if not key.startswith("_")}
    values = [
        (f"`{key}`", f"`{str(each.annotation).replace('|', 'or')}`", prose(_docstring(each)))
        for key, each in public.items()
        if isinstance(each, griffe.Attribute) and each.docstring
    ]
    yield table(("name", "type", "meaning"), values)
    for key, each in public.items():
        if isinstance(each, griffe.Function):
            yield from _function(f"{name}.{key}", each, level=4)


def _function(name: str, function: griffe.Function, *, level: int) -> Iterator[str]:
    before = "await " if "async" in function.labels else ""
    parameters = [_parameter(each) for each in function.parameters if each.name != "self"]
    if any(each.kind is griffe.ParameterKind.keyword_only for each in function.parameters):
        first = next(
            i
            for i, each in enumerate(each for each in function.parameters if each.name != "self")
            if each.kind is griffe.ParameterKind.keyword_only
        )
        parameters.insert(first, "*")
    signature = f"{before}{name}({', '.join(parameters)}) -> {function.returns}"
    if len(signature) > _LINE_MAX:
        signature = f"{before}{name}(\n" + "".join(f"    {each},\n" for each in parameters) + f") -> {function.returns}"
    yield from ["#" * level + f" {name}", "", "```text", signature, "```", "", _docstring(function)]


_LINE_MAX = 100


def _parameter(parameter: griffe.Parameter) -> str:
    stars = {griffe.ParameterKind.var_positional: "*", griffe.ParameterKind.var_keyword: "**"}
    text = f"{stars.get(parameter.kind, '') if parameter.kind else ''}{parameter.name}: {parameter.annotation}"
    return text if parameter.default is None or parameter.kind in stars else f"{text} = {parameter.default}"
