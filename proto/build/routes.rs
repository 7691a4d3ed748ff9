//! Generates the table of the methods over HTTP from their annotations (`google.api.http`).

use crate::annotations::{Binding, QueryField, bindings};
use protox::prost_reflect::{DescriptorPool, FieldDescriptor, Kind, MessageDescriptor};
use std::error::Error;
use std::fmt::Write as _;

/// Methods that ignore fields which they do not know. A device in the field may be newer than its server, and its report
/// must count all the same. For all other callers an unknown field is a typing error, which must not pass.
const IGNORES_UNKNOWN: [&str; 1] = ["ReportDevice"];

/// Returns Rust code with the routes of all annotated methods of `lightpath.v1`.
pub(crate) fn routes_code(pool: &DescriptorPool) -> Result<String, Box<dyn Error>> {
    let mut code = String::from("/// The methods over HTTP.\npub const ROUTES: &[Route] = &[\n");
    for binding in bindings(pool)? {
        write_route(&mut code, &binding)?;
    }
    code.push_str("];\n");
    Ok(code)
}

fn write_route(code: &mut String, binding: &Binding) -> Result<(), Box<dyn Error>> {
    let Binding { method, verb, path, template, body, .. } = binding;
    let from_query = query_code(binding)?;
    let body = match body.as_str() {
        "" => "Body::Nothing".to_owned(),
        "*" => "Body::Request".to_owned(),
        field => format!("Body::Field({field:?})"),
    };
    writeln!(code, "    Route {{ verb: {:?}, path: {path:?},", verb.to_uppercase())?;
    writeln!(code, "        method: \"/{}/{}\",", method.parent_service().full_name(), method.name())?;
    writeln!(code, "        segments: &{:?}, action: {:?},", template.segments, template.action)?;
    writeln!(code, "        variable: {:?}, body: {body},", template.variable)?;
    let names = |field: FieldDescriptor| [field.name().to_owned(), field.json_name().to_owned()];
    writeln!(
        code,
        "        request_id: {:?}, expected: {:?},",
        binding.request_id().map(names),
        binding.expected().map(names)
    )?;
    writeln!(code, "        query: &[{from_query}], is_stream: {},", method.is_server_streaming())?;
    let fields: Vec<[String; 2]> =
        method.input().fields().map(|field| [field.name().to_owned(), field.json_name().to_owned()]).collect();
    let counts = IGNORES_UNKNOWN.contains(&method.name()).then_some(fields);
    writeln!(code, "        counts: {},", counts.map_or("None".to_owned(), |fields| format!("Some(&{fields:?})")))?;
    let (request, answer) = (rust_type(&method.input()), rust_type(&method.output()));
    writeln!(code, "        encode: encode::<{request}>, to_json: to_json::<{answer}> }},")?;
    Ok(())
}

fn rust_type(message: &MessageDescriptor) -> String {
    format!("v1::{}", message.name())
}

/// Code of the fields of a request that its query may have.
fn query_code(binding: &Binding) -> Result<String, Box<dyn Error>> {
    let mut code = String::new();
    for QueryField { name, json_name, field } in binding.query() {
        let kind = parameter_kind(&field).ok_or_else(|| format!("a query cannot have {}", field.full_name()))?;
        write!(code, "Parameter {{ name: {name:?}, json_name: {json_name:?}, ")?;
        write!(code, "kind: {kind}, is_list: {} }}, ", field.is_list())?;
    }
    Ok(code)
}

fn parameter_kind(field: &FieldDescriptor) -> Option<String> {
    match field.kind() {
        Kind::Bool => Some("ParameterKind::Flag".to_owned()),
        Kind::Message(message) if message.full_name() == "google.protobuf.Timestamp" => {
            Some("ParameterKind::Time".to_owned())
        }
        Kind::Message(message) if message.full_name() == "google.protobuf.FieldMask" => {
            Some("ParameterKind::Mask".to_owned())
        }
        Kind::Enum(values) => {
            // The name of the first value is that of the enumeration and `UNSPECIFIED`.
            let first = values.values().next()?;
            let prefix = first.name().strip_suffix("UNSPECIFIED")?;
            Some(format!("ParameterKind::Word({prefix:?})"))
        }
        Kind::Uint32 | Kind::Uint64 => Some("ParameterKind::Count".to_owned()),
        Kind::Double => Some("ParameterKind::Number".to_owned()),
        Kind::String => Some("ParameterKind::Text".to_owned()),
        _ => None,
    }
}
