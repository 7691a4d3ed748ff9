//! Generates the table of the methods over HTTP from their annotations (`google.api.http`).

use crate::annotations::{Binding, bindings};
use protox::prost_reflect::{DescriptorPool, FieldDescriptor, Kind, MessageDescriptor};
use std::error::Error;
use std::fmt::Write as _;

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
    let Binding { method, verb, path, body, .. } = binding;
    let template = Template::parse(path).ok_or_else(|| format!("the path {path} has another form"))?;
    let from_query = if body.is_empty() { query_code(&method.input(), &template)? } else { String::new() };
    let body = match body.as_str() {
        "" => "Body::Nothing".to_owned(),
        "*" => "Body::Request".to_owned(),
        field => format!("Body::Field({field:?})"),
    };
    writeln!(code, "    Route {{ verb: {:?}, path: {path:?},", verb.to_uppercase())?;
    writeln!(code, "        method: \"/{}/{}\",", method.parent_service().full_name(), method.name())?;
    writeln!(code, "        segments: &[{}], action: {:?},", template.segments_code(), template.action)?;
    writeln!(code, "        variable: {:?}, body: {body},", template.variable)?;
    writeln!(code, "        query: &[{from_query}], is_stream: {},", method.is_server_streaming())?;
    let (request, answer) = (rust_type(&method.input()), rust_type(&method.output()));
    writeln!(code, "        encode: encode::<{request}>, to_json: to_json::<{answer}> }},")?;
    Ok(())
}

fn rust_type(message: &MessageDescriptor) -> String {
    format!("v1::{}", message.name())
}

/// The path of a rule.
struct Template {
    /// Texts of the segments; `None`: any text.
    segments: Vec<Option<String>>,
    /// What follows the last colon.
    action: String,
    /// Field that the path has, with the first segment of its value and the one after its last.
    variable: Option<(String, usize, usize)>,
}

impl Template {
    fn parse(path: &str) -> Option<Self> {
        let (mut segments, mut variable) = (Vec::new(), None);
        let (path, action) = match path.rsplit_once(':') {
            Some((path, action)) => (path, action),
            None => (path, ""),
        };
        let mut rest = path.strip_prefix('/')?;
        while !rest.is_empty() {
            if let Some(inside) = rest.strip_prefix('{') {
                let (inside, after) = inside.split_once('}')?;
                let (field, form) = inside.split_once('=').unwrap_or((inside, "*"));
                let begin = segments.len();
                segments.extend(form.split('/').map(|part| (part != "*").then(|| part.to_owned())));
                if variable.replace((field.to_owned(), begin, segments.len())).is_some() {
                    return None;
                }
                rest = after.strip_prefix('/').unwrap_or(after);
            } else {
                let (segment, after) = rest.split_once('/').unwrap_or((rest, ""));
                segments.push(Some(segment.to_owned()));
                rest = after;
            }
        }
        Some(Self { segments, action: action.to_owned(), variable })
    }

    fn segments_code(&self) -> String {
        let codes = self.segments.iter().map(|segment| format!("{segment:?}"));
        codes.collect::<Vec<_>>().join(", ")
    }
}

/// Code of the fields of a request that its query may have.
fn query_code(request: &MessageDescriptor, template: &Template) -> Result<String, Box<dyn Error>> {
    let mut code = String::new();
    let in_path = template.variable.as_ref().map(|(field, ..)| field.as_str());
    for field in request.fields().filter(|field| Some(field.name()) != in_path) {
        let kind = parameter_kind(&field).ok_or_else(|| format!("a query cannot have {}", field.full_name()))?;
        write!(code, "Parameter {{ name: {:?}, json_name: {:?}, ", field.name(), field.json_name())?;
        write!(code, "kind: {kind}, is_list: {} }}, ", field.is_list())?;
    }
    Ok(code)
}

fn parameter_kind(field: &FieldDescriptor) -> Option<String> {
    match field.kind() {
        Kind::Message(_) => None,
        Kind::Bool => Some("ParameterKind::Flag".to_owned()),
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
