"""Every call of the API can be made with the methods of the package, blocking and asynchronous."""

from __future__ import annotations

import ast
import importlib
from pathlib import Path

import pytest

import lightpath
from lightpath import v1
from lightpath.aio import lab as entry

PACKAGE = Path(lightpath.__file__).parent

# Calls that only the stubs of gRPC have, each with the reason.
RAW: dict[str, str] = {
    "RigService.ServeRig": "both sides speak for as long as a rig runs; docs/rig.md has the program for that",
}


def services() -> dict[str, list[str]]:
    """The names of the services with their methods, from the descriptors of the messages."""
    modules = [importlib.import_module(f"lightpath.v1.{path.stem}") for path in (PACKAGE / "v1").glob("*_pb2.py")]
    found = [service for module in modules for service in module.DESCRIPTOR.services_by_name.values()]
    return {service.name: [method.name for method in service.methods] for service in found}


def stubs(source: str) -> dict[str, str]:
    """The attributes of the connection with the services that they are stubs of: `jobs` is one of `JobService`."""
    found = {}
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Call) and isinstance(node.value.func, ast.Name):
            (target,), name = node.targets, node.value.func.id
            if isinstance(target, ast.Attribute) and name.endswith("ServiceStub"):
                found[target.attr] = name.removesuffix("Stub")
    return found


def made(sources: list[str], attributes: dict[str, str]) -> set[str]:
    """The calls in the sources, such as `JobService.GetJob` for `connection.jobs.GetJob`."""
    nodes = [node for source in sources for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Attribute)]
    return {
        f"{attributes[node.value.attr]}.{node.attr}"
        for node in nodes
        if isinstance(node.value, ast.Attribute) and node.value.attr in attributes
    }


@pytest.mark.parametrize("client", ["aio", "sync"])
def test_every_method_of_every_service_is_called_by_the_package(client: str) -> None:
    sources = [path.read_text(encoding="utf-8") for path in sorted((PACKAGE / client).glob("*.py"))]
    attributes = stubs((PACKAGE / client / "connection.py").read_text(encoding="utf-8"))
    exist = {f"{service}.{method}" for service, methods in services().items() for method in methods}
    assert len(exist) > 60
    missing = exist - made(sources, attributes) - RAW.keys()
    assert not missing, f"add a method to src/lightpath/aio for {', '.join(sorted(missing))}"
    assert exist >= RAW.keys(), "RAW names calls that the API does not have"


def test_a_method_that_nothing_calls_is_noticed() -> None:
    attributes = stubs("class Connection:\n    def __init__(self, c):\n        self.jobs = JobServiceStub(c)\n")
    assert made(["connection.call(connection.jobs.GetJob, 1)"], attributes) == {"JobService.GetJob"}


def test_results_of_every_kind_of_job_can_be_read() -> None:
    kinds = {field.name for field in v1.JobResult.DESCRIPTOR.oneofs_by_name["kind"].fields}
    assert kinds == entry._READERS.keys() | entry._READ_AS_MESSAGES
