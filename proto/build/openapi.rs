//! Generates the OpenAPI document of the API over HTTP: the frame `openapi.json` of this folder, with every annotated
//! method, and with the schemas of what its requests and answers have.

use crate::annotations::{Binding, QueryField, Template, bindings};
use crate::schemas::{Schemas, Side, field_schema};
use protox::prost_reflect::{DescriptorPool, FileDescriptor};
use serde_json::{Value, json};
use std::error::Error;

/// Returns the document.
pub(crate) fn openapi_document(pool: &DescriptorPool, frame: &str) -> Result<String, Box<dyn Error>> {
    let mut document: Value = serde_json::from_str(frame)?;
    document["info"]["version"] = json!(std::env::var("CARGO_PKG_VERSION")?);
    let mut schemas = Schemas::default();
    for binding in bindings(pool)? {
        let (path, parameters) = open_path(&binding.template);
        document["paths"][&path][binding.verb] = operation(&mut schemas, &binding, parameters);
    }
    // Answers of the paths that have handlers of their own.
    schemas.reference_by_name(pool, "lightpath.v1.Artifact", Side::Answer);
    for (name, schema) in schemas.all() {
        document["components"]["schemas"][name] = schema;
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

fn operation(schemas: &mut Schemas, binding: &Binding, mut parameters: Vec<Value>) -> Value {
    let method = &binding.method;
    let comment = comment_of(&method.parent_file(), method.path());
    let summary = comment.split_once(". ").map_or(comment.as_str(), |(first, _)| first).trim_end_matches('.');
    parameters.extend(query(schemas, binding));
    parameters.extend(headers(binding));
    let mut operation = json!({
        "operationId": operation_id(binding),
        "tags": [method.parent_service().name()],
        "summary": format!("{summary}."),
        "description": comment,
        "parameters": parameters,
        "responses": answers(schemas, binding),
    });
    if let Some((schema, is_required)) = body(schemas, binding) {
        let content = json!({ "application/json": { "schema": schema } });
        operation["requestBody"] = json!({ "required": is_required, "content": content });
    }
    operation
}

/// The fields that the query may have.
fn query(schemas: &mut Schemas, binding: &Binding) -> Vec<Value> {
    let parameter = |QueryField { json_name, field, .. }: QueryField| {
        let (mut schema, is_required) = field_schema(schemas, &field, Side::Request);
        let description = schema.as_object_mut().and_then(|schema| schema.remove("description"));
        let mut parameter = json!({ "name": json_name, "in": "query", "required": is_required, "schema": schema });
        if let Some(description) = description {
            parameter["description"] = description;
        }
        parameter
    };
    binding.query().into_iter().map(parameter).collect()
}

/// The headers that mean something to a call.
fn headers(binding: &Binding) -> Vec<Value> {
    let reference = |name: &str| json!({ "$ref": format!("#/components/parameters/{name}") });
    let mut headers = Vec::new();
    if binding.verb == "get" {
        return headers;
    }
    if binding.request_id().is_some() {
        headers.push(reference("IdempotencyKey"));
    }
    if binding.expected().is_some() {
        headers.push(reference("IfMatch"));
    }
    headers
}

/// The schema of the body, and whether a request must have one.
fn body(schemas: &mut Schemas, binding: &Binding) -> Option<(Value, bool)> {
    let input = binding.method.input();
    match binding.body.as_str() {
        "" => None,
        "*" => Some(schemas.request(&input, binding.variable())),
        name => input.get_field_by_name(name).map(|field| (field_schema(schemas, &field, Side::Request).0, true)),
    }
}

/// A name that no other operation has: a method may have several paths.
fn operation_id(binding: &Binding) -> String {
    let id = format!("{}_{}", binding.method.parent_service().name(), binding.method.name());
    if binding.is_first { id } else { format!("{id}_{}", binding.variable().unwrap_or_default()) }
}

fn answers(schemas: &mut Schemas, binding: &Binding) -> Value {
    let method = &binding.method;
    let message = schemas.reference(&method.output(), Side::Answer);
    let mut answers = json!({ "default": { "$ref": "#/components/responses/Problem" } });
    if method.is_server_streaming() {
        let description = "Server-sent events, which OpenAPI 3.1 cannot describe: the data of each event is JSON, of an \
                           event `error` the schema Problem, of others what `x-event-data` names.";
        let content = json!({ "schema": { "type": "string" }, "x-event-data": message });
        answers["200"] = json!({ "description": description, "content": { "text/event-stream": content } });
        return answers;
    }
    answers["200"] = json!({ "description": "The answer.", "content": { "application/json": { "schema": message } } });
    if binding.verb == "get" {
        answers["200"]["headers"] = json!({ "etag": { "$ref": "#/components/headers/ETag" } });
        answers["304"] = json!({ "description": "The client has the answer that `if-none-match` names." });
    }
    if binding.expected().is_some() {
        answers["412"] = json!({ "$ref": "#/components/responses/Changed" });
    }
    answers
}

/// The comment above an element of a file, as one line.
pub(crate) fn comment_of(file: &FileDescriptor, path: &[i32]) -> String {
    let locations = file.file_descriptor_proto().source_code_info.iter().flat_map(|info| &info.location);
    let comment =
        locations.filter(|location| location.path == path).find_map(|location| location.leading_comments.clone());
    let comment = comment.unwrap_or_default();
    comment.lines().map(str::trim).collect::<Vec<_>>().join(" ").trim().to_owned()
}
