//! The schemas of messages as JSON, for the OpenAPI document.
//!
//! A message has two: one of answers and one of requests (`…Input`). Answers have all fields that are neither messages nor
//! optional, and later servers may add fields and values of enumerations, so their schemas are open. The server refuses
//! fields and values that it does not know, so the schemas of requests are closed; they have the ranges of numbers.

use crate::openapi::comment_of;
use crate::ranges::{Range, range_of};
use protox::prost_reflect::{
    DescriptorPool, EnumDescriptor, FieldDescriptor, Kind, MessageDescriptor, OneofDescriptor,
};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Who writes a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    /// The client.
    Request,
    /// The server.
    Answer,
}

/// All schemas that something refers to, by their names.
#[derive(Default)]
pub(crate) struct Schemas(BTreeMap<String, Value>);

impl Schemas {
    /// The schemas.
    pub(crate) fn all(self) -> BTreeMap<String, Value> {
        self.0
    }

    /// A reference to a message with this full name.
    pub(crate) fn reference_by_name(&mut self, pool: &DescriptorPool, full_name: &str, side: Side) {
        if let Some(message) = pool.get_message_by_name(full_name) {
            self.reference(&message, side);
        }
    }

    /// A reference to a message.
    pub(crate) fn reference(&mut self, message: &MessageDescriptor, side: Side) -> Value {
        self.named(name_of(message.full_name(), side), |schemas| schemas.message(message, side, None).0)
    }

    /// A reference to the request of a method without the field that the path has, and whether it has required fields.
    pub(crate) fn request(&mut self, message: &MessageDescriptor, in_path: Option<&str>) -> (Value, bool) {
        let (schema, is_required) = self.message(message, Side::Request, in_path);
        (self.named(short(message.full_name()).to_owned(), |_| schema), is_required)
    }

    fn enumeration(&mut self, values: &EnumDescriptor, side: Side) -> Value {
        self.named(name_of(values.full_name(), side), |_| enum_schema(values, side))
    }

    /// A reference to the schema with a name, which `make` makes once.
    fn named(&mut self, name: String, make: impl FnOnce(&mut Self) -> Value) -> Value {
        if !self.0.contains_key(&name) {
            // Before its content is made: a message may contain itself.
            self.0.insert(name.clone(), Value::Null);
            let schema = make(self);
            self.0.insert(name.clone(), schema);
        }
        json!({ "$ref": format!("#/components/schemas/{name}") })
    }

    /// The schema of a message without the field that the path has, and whether it has required fields.
    fn message(&mut self, message: &MessageDescriptor, side: Side, in_path: Option<&str>) -> (Value, bool) {
        let (mut properties, mut required) = (Map::new(), Vec::new());
        for field in message.fields().filter(|field| Some(field.name()) != in_path) {
            let (schema, is_required) = field_schema(self, &field, side);
            if is_required {
                required.push(field.json_name().to_owned());
            }
            properties.insert(field.json_name().to_owned(), schema);
        }
        let description = comment_of(&message.parent_file(), message.path());
        let mut schema = json!({ "type": "object", "description": description, "properties": properties });
        let has_required = !required.is_empty();
        if has_required {
            schema["required"] = json!(required);
        }
        if side == Side::Request {
            schema["additionalProperties"] = json!(false);
            let choices = message.oneofs().filter(|choice| !choice.is_synthetic());
            let pairs: Vec<Value> = choices.flat_map(|choice| exclusive(&choice)).collect();
            if !pairs.is_empty() {
                schema["not"] = json!({ "anyOf": pairs });
            }
        }
        (schema, has_required)
    }
}

/// Pairs of fields of a choice, which no request may have together.
///
/// A `oneOf` would say the same. Generators that know it lose the fields of the message.
fn exclusive(choice: &OneofDescriptor) -> Vec<Value> {
    let names: Vec<String> = choice.fields().map(|field| field.json_name().to_owned()).collect();
    let pairs = names.iter().enumerate().flat_map(|(i, name)| names[..i].iter().map(move |other| [other, name]));
    pairs.map(|pair| json!({ "required": pair })).collect()
}

/// The schema of a field with its description, and whether messages must have it.
pub(crate) fn field_schema(schemas: &mut Schemas, field: &FieldDescriptor, side: Side) -> (Value, bool) {
    let comment = comment_of(&field.parent_message().parent_file(), field.path());
    let is_single = !field.is_list() && !field.is_map();
    let range = if side == Side::Request && is_single { range_of(field, &comment) } else { Range::default() };
    let mut schema = if let (true, Kind::Message(entry)) = (field.is_map(), field.kind()) {
        let value = kind_schema(schemas, &entry.map_entry_value_field(), side);
        json!({ "type": "object", "additionalProperties": value })
    } else if field.is_list() {
        json!({ "type": "array", "items": kind_schema(schemas, field, side) })
    } else {
        kind_schema(schemas, field, side)
    };
    range.add_to(&mut schema);
    let mut description = comment;
    let choice = field.containing_oneof().filter(|choice| !choice.is_synthetic());
    if let Some(choice) = &choice {
        description += &format!(" At most one field of `{}` is set.", choice.name());
    }
    if !description.is_empty() {
        schema["description"] = json!(description.trim());
    }
    let is_required = match side {
        Side::Request => range.is_required(),
        // The server leaves out messages and optional fields that are not set, and writes all others.
        Side::Answer => !is_single || (!field.supports_presence() && choice.is_none()),
    };
    (schema, is_required)
}

fn kind_schema(schemas: &mut Schemas, field: &FieldDescriptor, side: Side) -> Value {
    match field.kind() {
        Kind::Bool => json!({ "type": "boolean" }),
        Kind::String => json!({ "type": "string" }),
        Kind::Bytes => json!({ "type": "string", "contentEncoding": "base64" }),
        Kind::Double | Kind::Float => json!({ "type": "number", "format": "double" }),
        Kind::Int64 | Kind::Sint64 | Kind::Sfixed64 => {
            json!({ "type": "string", "format": "int64", "pattern": "^-?[0-9]+$" })
        }
        Kind::Uint64 | Kind::Fixed64 => json!({ "type": "string", "format": "uint64", "pattern": "^[0-9]+$" }),
        Kind::Int32 | Kind::Sint32 | Kind::Sfixed32 => json!({ "type": "integer", "format": "int32" }),
        Kind::Uint32 | Kind::Fixed32 => json!({ "type": "integer", "minimum": 0, "maximum": u32::MAX }),
        Kind::Message(message) => match message.full_name() {
            "google.protobuf.Timestamp" => json!({ "type": "string", "format": "date-time" }),
            "google.protobuf.FieldMask" => json!({ "type": "string" }),
            "google.protobuf.Duration" => json!({ "type": "string", "pattern": "^-?[0-9]+(\\.[0-9]+)?s$" }),
            _ => schemas.reference(&message, side),
        },
        Kind::Enum(values) => schemas.enumeration(&values, side),
    }
}

/// The names of the values. Those of answers are examples: later servers may have others.
fn enum_schema(values: &EnumDescriptor, side: Side) -> Value {
    let file = values.parent_file();
    let names: Vec<String> = values.values().map(|value| value.name().to_owned()).collect();
    let mut description = comment_of(&file, values.path());
    for value in values.values() {
        description += &format!("\n- `{}`: {}", value.name(), comment_of(&file, value.path()));
    }
    let list = if side == Side::Request { "enum" } else { "examples" };
    json!({ "type": "string", list: names, "description": description })
}

fn name_of(full_name: &str, side: Side) -> String {
    let end = if side == Side::Request { "Input" } else { "" };
    format!("{}{end}", short(full_name))
}

fn short(full_name: &str) -> &str {
    full_name.strip_prefix("lightpath.v1.").unwrap_or(full_name)
}
