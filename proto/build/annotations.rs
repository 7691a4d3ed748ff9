//! The annotations of the methods (`google.api.http`): their verbs, paths and bodies over HTTP.

use protox::prost_reflect::{DescriptorPool, DynamicMessage, FieldDescriptor, Kind, MethodDescriptor, Value};
use std::error::Error;

/// A method at one of its paths.
pub(crate) struct Binding {
    pub(crate) method: MethodDescriptor,
    /// Verb in lower case.
    pub(crate) verb: &'static str,
    /// Path as annotated, such as `/v1/{name=jobs/*}:cancel`.
    pub(crate) path: String,
    /// The parts of the path.
    pub(crate) template: Template,
    /// Field that the body has; `*`: all fields that the path lacks. Empty: no body.
    pub(crate) body: String,
    /// Whether this is the first path of the method.
    pub(crate) is_first: bool,
}

/// A field that the query may have.
pub(crate) struct QueryField {
    /// Name in the `.proto` file.
    pub(crate) name: String,
    pub(crate) json_name: String,
    pub(crate) field: FieldDescriptor,
}

/// Messages that a query has in one value.
const IN_ONE_VALUE: [&str; 2] = ["google.protobuf.Timestamp", "google.protobuf.FieldMask"];

impl QueryField {
    fn all_of(field: &FieldDescriptor) -> Vec<Self> {
        match field.kind() {
            Kind::Message(message) if !field.is_list() && !IN_ONE_VALUE.contains(&message.full_name()) => {
                let within = |inner: FieldDescriptor| Self {
                    name: format!("{}.{}", field.name(), inner.name()),
                    json_name: format!("{}.{}", field.json_name(), inner.json_name()),
                    field: inner,
                };
                message.fields().map(within).collect()
            }
            _ => vec![Self {
                name: field.name().to_owned(),
                json_name: field.json_name().to_owned(),
                field: field.clone(),
            }],
        }
    }
}

impl Binding {
    /// Name of the field that the path has, such as `name`, or `display.name` of a message within the request.
    pub(crate) fn variable(&self) -> Option<&str> {
        self.template.variable.as_ref().map(|(field, ..)| field.as_str())
    }

    /// The fields that the query may have: those that neither the path nor the body has. Of a message within the request
    /// these are its fields, such as `place.distance_m`.
    pub(crate) fn query(&self) -> Vec<QueryField> {
        if self.body == "*" {
            return Vec::new();
        }
        let in_path = self.variable();
        let input = self.method.input();
        let fields = input.fields().filter(|field| Some(field.name()) != in_path && field.name() != self.body);
        fields.flat_map(|field| QueryField::all_of(&field)).collect()
    }

    /// The field with an id of the request, by which the server knows a repeated request.
    pub(crate) fn request_id(&self) -> Option<FieldDescriptor> {
        self.method.input().get_field_by_name("request_id").filter(|_| !self.body.is_empty())
    }

    /// The field with what the request expects of the resource in its path, such as `expected_revision`.
    pub(crate) fn expected(&self) -> Option<FieldDescriptor> {
        let mut fields = self.method.input().fields().collect::<Vec<_>>().into_iter();
        fields.find(|field| field.name().starts_with("expected_")).filter(|_| !self.body.is_empty())
    }
}

/// The paths of all annotated methods of `lightpath.v1`.
pub(crate) fn bindings(pool: &DescriptorPool) -> Result<Vec<Binding>, Box<dyn Error>> {
    let extension = pool.get_extension_by_name("google.api.http").ok_or("google.api.http is missing")?;
    let mut bindings = Vec::new();
    let services = pool.services().filter(|service| service.package_name() == "lightpath.v1");
    for method in services.flat_map(|service| service.methods().collect::<Vec<_>>()) {
        let options = method.options();
        if !options.has_extension(&extension) {
            continue;
        }
        let annotation = options.get_extension(&extension);
        let rule = annotation.as_message().ok_or("google.api.http is no message")?;
        bindings.push(binding(&method, rule, true)?);
        let others = rule.get_field_by_name("additional_bindings");
        for other in others.iter().filter_map(|others| others.as_list()).flatten().filter_map(Value::as_message) {
            bindings.push(binding(&method, other, false)?);
        }
    }
    Ok(bindings)
}

fn binding(method: &MethodDescriptor, rule: &DynamicMessage, is_first: bool) -> Result<Binding, Box<dyn Error>> {
    let text = |field: &str| Some(rule.get_field_by_name(field)?.as_str()?.to_owned());
    let verbs = ["get", "put", "post", "patch", "delete"];
    let found = verbs.iter().find_map(|verb| Some((*verb, text(verb).filter(|path| !path.is_empty())?)));
    let (verb, path) = found.ok_or_else(|| format!("{} has no path", method.full_name()))?;
    let template = Template::parse(&path).ok_or_else(|| format!("the path {path} has another form"))?;
    Ok(Binding { method: method.clone(), verb, path, template, body: text("body").unwrap_or_default(), is_first })
}

/// The path of a rule.
pub(crate) struct Template {
    /// Texts of the segments; `None`: any text.
    pub(crate) segments: Vec<Option<String>>,
    /// What follows the last colon.
    pub(crate) action: String,
    /// Field that the path has, with the first segment of its value and the one after its last.
    pub(crate) variable: Option<(String, usize, usize)>,
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
}
