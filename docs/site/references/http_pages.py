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
    written = {f"http/{service}.md": _service(service, operations) for service, operations in services.items()}
    return {"http/README.md": index, **written}


def _target(operation: Operation) -> str:
    return target("http", operation["operationId"])


def _service(service: str, operations: list[tuple[str, str, Operation]]) -> str:
    parts = [f"# {service} over HTTP", ""]
    for verb, path, operation in operations:
        parts += [f"({_target(operation)})=", "", f"## {verb} {prose(path)}", ""]
        parts += [prose(operation.get("description") or operation["summary"]), ""]
        parameters = [
            (f"`{each['name']}`", each["in"], _type(each.get("schema", {})), prose(each.get("description", "")))
            for each in operation.get("parameters", [])
        ]
        parts += [table(("parameter", "in", "type", "meaning"), parameters), _body(operation), _answers(operation), ""]
    return "\n".join(parts)


def _body(operation: Operation) -> str:
    content = operation.get("requestBody", {}).get("content", {})
    parts = []
    for kind, media in content.items():
        schema = media.get("schema", {})
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
            rows.append(("other", "", "[an error](../../http.md#errors)"))
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
        known = not name.startswith("google.") and name != "Error"
        return f"[{name}](#{target('message', name)})" if known else f"`{name}`"
    if schema.get("type") == "array":
        return f"list of {_type(schema['items'])}"
    kind = schema.get("type", "any")
    if schema.get("format") in {"int64", "uint64", "date-time", "duration"}:
        return f"text ({schema['format']})"
    if isinstance(kind, list):
        return " or ".join(kind)
    return {"object": "message"}.get(kind, str(kind))
