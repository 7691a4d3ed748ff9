"""The gRPC API, from the comments of the `.proto` files: one page for each file."""

from __future__ import annotations

import importlib.resources
import tempfile
from pathlib import Path
from typing import Any

from google.protobuf.descriptor_pb2 import (
    DescriptorProto,
    EnumDescriptorProto,
    FieldDescriptorProto,
    FileDescriptorProto,
    FileDescriptorSet,
    ServiceDescriptorProto,
)
from grpc_tools import protoc

from references.text import hidden_contents, prose, table, target

_PACKAGE = ".lightpath.v1."
# Numbers of the parts of a file in the paths of its comments.
_MESSAGES, _ENUMS, _SERVICES = 4, 5, 6
_FIELDS, _NESTED, _NESTED_ENUMS = 2, 3, 4
_VALUES = _METHODS = 2

_INTRODUCTION = """# The gRPC API

All services and messages of `lightpath.v1`, from the comments of the `.proto` files. Lengths are metres and times are
seconds, unless a field says otherwise. A server describes itself, too: `grpcurl -plaintext 127.0.0.1:7070 list` asks
it. Over HTTP the same messages are JSON ([how](../../http.md)).

"""


def pages(folder: Path) -> dict[str, str]:
    """Return the pages by their names, for the `.proto` files in a folder."""
    files = [each for each in _descriptors(folder).file if each.package == _PACKAGE.strip(".")]
    written = {f"grpc/{_stem(file)}.md": _FilePage(file).text() for file in files}
    rows = [(f"[{_stem(file)}.proto]({_stem(file)}.md)", ", ".join(_contents(file))) for file in files]
    index = _INTRODUCTION + table(("file", "services and messages"), rows) + "\n"
    return {"grpc/README.md": index + hidden_contents(_stem(file) for file in files), **written}


def _descriptors(folder: Path) -> FileDescriptorSet:
    files = [str(path.relative_to(folder)) for path in sorted(folder.glob("lightpath/v1/*.proto"))]
    with importlib.resources.as_file(importlib.resources.files("grpc_tools") / "_proto") as known:
        output = Path(tempfile.mkdtemp()) / "descriptors"
        arguments = ["protoc", f"-I{folder}", f"-I{known}", f"--descriptor_set_out={output}", "--include_source_info"]
        if protoc.main([*arguments, *files]) != 0:
            message = "protoc refuses the .proto files"
            raise SystemExit(message)
    return FileDescriptorSet.FromString(output.read_bytes())


def _stem(file: FileDescriptorProto) -> str:
    return Path(file.name).stem


def _contents(file: FileDescriptorProto) -> list[str]:
    services = [f"[{each.name}](#{target('service', each.name)})" for each in file.service]
    return services + [f"[{each.name}](#{target('message', each.name)})" for each in file.message_type]


class _FilePage:
    """The page of one file."""

    def __init__(self, file: FileDescriptorProto) -> None:
        self._file = file
        locations = file.source_code_info.location
        self._comments = {tuple(each.path): each.leading_comments for each in locations}

    def text(self) -> str:
        parts = [f"# {_stem(self._file)}.proto", ""]
        for i, service in enumerate(self._file.service):
            parts += self._service(service, (_SERVICES, i))
        for i, message in enumerate(self._file.message_type):
            parts += self._message(message, message.name, (_MESSAGES, i))
        for i, values in enumerate(self._file.enum_type):
            parts += self._enum(values, values.name, (_ENUMS, i))
        return "\n".join(parts)

    def _comment(self, path: tuple[int, ...]) -> str:
        return prose(self._comments.get(path, ""))

    def _heading(self, kind: str, name: str, path: tuple[int, ...]) -> list[str]:
        return [f"({target(kind, name)})=", "", f"## {name}", "", self._comment(path), ""]

    def _service(self, service: ServiceDescriptorProto, path: tuple[int, ...]) -> list[str]:
        parts = self._heading("service", service.name, path)
        for i, method in enumerate(service.method):
            sent = ("stream of " if method.client_streaming else "") + _link(method.input_type)
            received = ("stream of " if method.server_streaming else "") + _link(method.output_type)
            parts += [f"({target('method', f'{service.name}.{method.name}')})=", "", f"### {method.name}", ""]
            parts += [f"{sent} → {received}", "", self._comment((*path, _METHODS, i)), ""]
        return parts

    def _message(self, message: DescriptorProto, name: str, path: tuple[int, ...]) -> list[str]:
        if message.options.map_entry:
            return []
        entries = {f"{_PACKAGE}{name}.{each.name}": each for each in message.nested_type if each.options.map_entry}
        rows = [
            (f"`{field.name}`", _field_type(field, entries), self._field_comment(message, field, (*path, _FIELDS, i)))
            for i, field in enumerate(message.field)
        ]
        parts = [*self._heading("message", name, path), table(("field", "type", "meaning"), rows) or "No fields.", ""]
        for i, nested in enumerate(message.nested_type):
            parts += self._message(nested, f"{name}.{nested.name}", (*path, _NESTED, i))
        for i, values in enumerate(message.enum_type):
            parts += self._enum(values, f"{name}.{values.name}", (*path, _NESTED_ENUMS, i))
        return parts

    def _field_comment(self, message: DescriptorProto, field: FieldDescriptorProto, path: tuple[int, ...]) -> str:
        comment = self._comment(path)
        if field.HasField("oneof_index") and not field.proto3_optional:
            comment += f" At most one field of `{message.oneof_decl[field.oneof_index].name}` is set."
        return comment.strip()

    def _enum(self, values: EnumDescriptorProto, name: str, path: tuple[int, ...]) -> list[str]:
        rows = [(f"`{each.name}`", self._comment((*path, _VALUES, i))) for i, each in enumerate(values.value)]
        return [*self._heading("message", name, path), table(("value", "meaning"), rows), ""]


def _field_type(field: FieldDescriptorProto, entries: dict[str, Any]) -> str:
    if field.type_name in entries:
        key, value = entries[field.type_name].field
        return f"map from {_single_type(key)} to {_single_type(value)}"
    single = _single_type(field)
    if field.label == FieldDescriptorProto.LABEL_REPEATED:
        return f"list of {single}"
    return f"optional {single}" if field.proto3_optional else single


def _single_type(field: FieldDescriptorProto) -> str:
    if field.type_name:
        return _link(field.type_name)
    return FieldDescriptorProto.Type.Name(field.type).removeprefix("TYPE_").lower()


def _link(type_name: str) -> str:
    if not type_name.startswith(_PACKAGE):
        return f"`{type_name.strip('.')}`"
    name = type_name.removeprefix(_PACKAGE)
    return f"[{name}](#{target('message', name)})"
