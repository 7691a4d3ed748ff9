//! Generates the OpenAPI document of the API over HTTP: the frame `openapi.json` of this folder, with every annotated
//! method and every message of `lightpath.v1`.

use crate::annotations::{Binding, Template, bindings};
use protox::prost_reflect::{
    Cardinality, DescriptorPool, EnumDescriptor, FieldDescriptor, FileDescriptor, Kind, MessageDescriptor,
    MethodDescriptor,
};
use serde_json::{Map, Value, json};
use std::error::Error;

/// Returns the document.
pub(crate) fn openapi_document(pool: &DescriptorPool, frame: &str) -> Result<String, Box<dyn Error>> {
    let mut document: Value = serde_json::from_str(frame)?;
    document["info"]["version"] = json!(std::env::var("CARGO_PKG_VERSION")?);
    for binding in bindings(pool)? {
        let (path, parameters) = open_path(&binding.template);
        document["paths"][&path][binding.verb] = operation(&binding, parameters);
    }
    for message in pool.all_messages().filter(|message| message.package_name() == "lightpath.v1") {
        document["components"]["schemas"][name_of(message.full_name())] = schema(&message, None);
    }
    for values in pool.all_enums().filter(|values| values.package_name() == "lightpath.v1") {
        document["components"]["schemas"][name_of(values.full_name())] = enum_schema(&values);
    }
    Ok(serde_json::to_string(&document)?)
}

/// A path such as `/v1/{name=displays/*/kernels/*}:promote` as OpenAPI writes it,
/// `/v1/displays/{display}/kernels/{kernel}:promote`, and its parameters. A part has the name of its collection, or that
/// of the field if it is the whole field.
fn open_path(template: &Template) -> (String, Vec<Value>) {
    let (mut open, mut parameters, mut collection) = (String::new(), Vec::new(), "");
    for segment in &template.segments {
        if let Some(text) = segment {
            open += &format!("/{text}");
            collection = text;
            continue;
        }
        let name = match &template.variable {
            Some((field, begin, end)) if end - begin == 1 => field,
            _ => collection.strip_suffix('s').unwrap_or(collection),
        };
        open += &format!("/{{{name}}}");
        parameters.push(json!({ "name": name, "in": "path", "required": true, "schema": { "type": "string" } }));
    }
    if !template.action.is_empty() {
        open += &format!(":{}", template.action);
    }
    (open, parameters)
}

fn operation(binding: &Binding, mut parameters: Vec<Value>) -> Value {
    let method = &binding.method;
    let comment = comment_of(&method.parent_file(), method.path());
    let summary = comment.split_once(". ").map_or(comment.as_str(), |(first, _)| first).trim_end_matches('.');
    let in_path = binding.variable();
    let input = method.input();
    let free = || input.fields().filter(|field| Some(field.name()) != in_path);
    if binding.body.is_empty() {
        parameters.extend(free().map(|field| {
            let description = comment_of(&field.parent_message().parent_file(), field.path());
            json!({ "name": field.json_name(), "in": "query", "description": description, "schema": field_type(&field) })
        }));
    }
    let body = match binding.body.as_str() {
        "" => Value::Null,
        "*" => schema(&input, in_path),
        name => input.get_field_by_name(name).map_or(Value::Null, |field| field_type(&field)),
    };
    let mut operation = json!({
        "operationId": operation_id(binding),
        "tags": [method.parent_service().name()],
        "summary": format!("{summary}."),
        "description": comment,
        "parameters": parameters,
        "responses": { "200": answer(method), "default": { "$ref": "#/components/responses/Error" } },
    });
    if !body.is_null() {
        operation["requestBody"] = json!({ "content": { "application/json": { "schema": body } } });
    }
    if binding.verb == "get" && !method.is_server_streaming() {
        operation["responses"]["304"] =
            json!({ "description": "The client has the answer that `if-none-match` names." });
    }
    operation
}

/// A name that no other operation has: a method may have several paths.
fn operation_id(binding: &Binding) -> String {
    let id = format!("{}_{}", binding.method.parent_service().name(), binding.method.name());
    if binding.is_first { id } else { format!("{id}_{}", binding.variable().unwrap_or_default()) }
}

fn answer(method: &MethodDescriptor) -> Value {
    let reference = reference(method.output().full_name());
    if method.is_server_streaming() {
        let description = "Server-sent events: each event `message` has the message below as JSON, an event `error` has \
                           an error.";
        return json!({ "description": description, "content": { "text/event-stream": { "schema": reference } } });
    }
    json!({ "description": "The answer.", "content": { "application/json": { "schema": reference } } })
}

/// The schema of a message, without the field that the path has.
fn schema(message: &MessageDescriptor, in_path: Option<&str>) -> Value {
    let mut properties = Map::new();
    for field in message.fields().filter(|field| Some(field.name()) != in_path) {
        let mut kind = field_type(&field);
        let mut description = comment_of(&message.parent_file(), field.path());
        if let Some(choice) = field.containing_oneof().filter(|choice| !choice.is_synthetic()) {
            description += &format!(" At most one field of `{}` is set.", choice.name());
        }
        kind["description"] = json!(description.trim());
        properties.insert(field.json_name().to_owned(), kind);
    }
    let description = comment_of(&message.parent_file(), message.path());
    json!({ "type": "object", "description": description, "properties": properties, "additionalProperties": false })
}

fn field_type(field: &FieldDescriptor) -> Value {
    let kind = match field.kind() {
        Kind::Bool => json!({ "type": "boolean" }),
        Kind::String => json!({ "type": "string" }),
        Kind::Bytes => json!({ "type": "string", "contentEncoding": "base64" }),
        // JSON has no such numbers, so they are the texts `NaN`, `Infinity` and `-Infinity`.
        Kind::Double | Kind::Float => json!({ "type": ["number", "string"] }),
        Kind::Int64 | Kind::Sint64 | Kind::Sfixed64 => json!({ "type": "string", "format": "int64" }),
        Kind::Uint64 | Kind::Fixed64 => json!({ "type": "string", "format": "uint64" }),
        Kind::Int32 | Kind::Sint32 | Kind::Sfixed32 => json!({ "type": "integer", "format": "int32" }),
        Kind::Uint32 | Kind::Fixed32 => json!({ "type": "integer", "format": "uint32" }),
        Kind::Message(message) => match message.full_name() {
            "google.protobuf.Timestamp" => json!({ "type": "string", "format": "date-time" }),
            "google.protobuf.Duration" => json!({ "type": "string", "format": "duration" }),
            name => reference(name),
        },
        Kind::Enum(values) => reference(values.full_name()),
    };
    if field.cardinality() == Cardinality::Repeated { json!({ "type": "array", "items": kind }) } else { kind }
}

fn enum_schema(values: &EnumDescriptor) -> Value {
    let file = values.parent_file();
    let names: Vec<String> = values.values().map(|value| value.name().to_owned()).collect();
    let mut description = comment_of(&file, values.path());
    for value in values.values() {
        description += &format!("\n- `{}`: {}", value.name(), comment_of(&file, value.path()));
    }
    json!({ "type": "string", "enum": names, "description": description })
}

fn reference(full_name: &str) -> Value {
    json!({ "$ref": format!("#/components/schemas/{}", name_of(full_name)) })
}

fn name_of(full_name: &str) -> &str {
    full_name.strip_prefix("lightpath.v1.").unwrap_or(full_name)
}

/// The comment above an element of a file, as one line.
fn comment_of(file: &FileDescriptor, path: &[i32]) -> String {
    let locations = file.file_descriptor_proto().source_code_info.iter().flat_map(|info| &info.location);
    let comment =
        locations.filter(|location| location.path == path).find_map(|location| location.leading_comments.clone());
    let comment = comment.unwrap_or_default();
    comment.lines().map(str::trim).collect::<Vec<_>>().join(" ").trim().to_owned()
}
