"""The API over HTTP, from the OpenAPI document that the server serves: one page for each service."""

from __future__ import annotations

from typing import Any

from references.text import hidden_contents, prose, table, target

_INTRODUCTION = """# The API over HTTP

Every path, from the document that the server serves at `/openapi.json`. [How to use it](../../http.md) explains JSON,
tokens, polling and errors. Messages have the fields of the [gRPC API](../grpc/README.md), with names in camel case such
as `wavelengthM` for `wavelength_m`.

"""

Operation = dict[str, Any]


def pages(openapi: dict[str, Any]) -> dict[str, str]:
    """Return the pages by their names."""
    components = openapi["components"]
    services: dict[str, list[tuple[str, str, Operation]]] = {}
    for path, verbs in openapi["paths"].items():
        for verb, operation in verbs.items():
            services.setdefault(operation["tags"][0], []).append((verb.upper(), path, operation))
    rows = [
        (f"[`{verb} {path}`](#{_target(operation)})", prose(operation["summary"]))
        for service in sorted(services)
        for verb, path, operation in services[service]
    ]
    index = _INTRODUCTION + table(("path", "what it does"), rows) + "\n" + hidden_contents(sorted(services))
    written = {
        f"http/{service}.md": _service(service, operations, components) for service, operations in services.items()
    }
    return {"http/README.md": index, **written}


def _target(operation: Operation) -> str:
    return target("http", operation["operationId"])


def _service(service: str, operations: list[tuple[str, str, Operation]], components: dict[str, Any]) -> str:
    parts = [f"# {service} over HTTP", ""]
    for verb, path, operation in operations:
        parts += [f"({_target(operation)})=", "", f"## {verb} {prose(path)}", ""]
        parts += [prose(operation.get("description") or operation["summary"]), ""]
        parameters = [
            (f"`{each['name']}`", each["in"], _type(each.get("schema", {})), prose(each.get("description", "")))
            for each in (_resolved(parameter, components) for parameter in operation.get("parameters", []))
        ]
        body, answers = _body(operation, components), _answers(operation)
        parts += [table(("parameter", "in", "type", "meaning"), parameters), body, answers, ""]
    return "\n".join(parts)


def _resolved(part: dict[str, Any], components: dict[str, Any]) -> dict[str, Any]:
    """Return what a reference such as `#/components/schemas/Job` stands for."""
    if "$ref" not in part:
        return part
    kind, name = part["$ref"].split("/")[-2:]
    found: dict[str, Any] = components[kind][name]
    return found


def _body(operation: Operation, components: dict[str, Any]) -> str:
    content = operation.get("requestBody", {}).get("content", {})
    parts = []
    for kind, media in content.items():
        named = media.get("schema", {})
        # The request of a call is a schema of its own; other messages have their own section.
        schema = _resolved(named, components) if named.get("$ref", "").endswith("Request") else named
        fields = [
            (f"`{name}`", _type(field), prose(field.get("description", "")))
            for name, field in schema.get("properties", {}).items()
        ]
        what = _type(schema) if "$ref" in schema else ("these fields" if fields else "no fields, or any bytes")
        parts += [f"Body, `{kind}`: {what}", "", table(("field", "type", "meaning"), fields)]
    return "\n".join(parts)


def _answers(operation: Operation) -> str:
    rows = []
    for status, answer in operation["responses"].items():
        if "$ref" in answer:
            changed = "the resource has changed since: [an error](../../http.md#errors)"
            rows.append((status, "", changed) if status == "412" else ("other", "", "[an error](../../http.md#errors)"))
            continue
        kinds = [
            f"`{kind}` " + _type(media["schema"]) if "schema" in media else f"`{kind}`"
            for kind, media in answer.get("content", {}).items()
        ]
        rows.append((status, ", ".join(kinds), prose(answer.get("description", ""))))
    return table(("status", "content", "meaning"), rows)


def _type(schema: Any) -> str:
    """Return the type of a schema, as a link if it is a message."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        message = name.removesuffix("Input")
        return f"[{message}](#{target('message', message)})" if name not in {"Problem", "WrongField"} else f"`{name}`"
    if schema.get("type") == "array":
        return f"list of {_type(schema['items'])}"
    kind = schema.get("type", "any")
    if schema.get("format") in {"int64", "uint64", "date-time", "duration"}:
        return f"text ({schema['format']})"
    if isinstance(kind, list):
        return " or ".join(kind)
    return {"object": "message"}.get(kind, str(kind))
