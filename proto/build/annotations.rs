//! The annotations of the methods (`google.api.http`): their verbs, paths and bodies over HTTP.

use protox::prost_reflect::{DescriptorPool, DynamicMessage, MethodDescriptor, Value};
use std::error::Error;

/// A method at one of its paths.
pub(crate) struct Binding {
    pub(crate) method: MethodDescriptor,
    /// Verb in lower case.
    pub(crate) verb: &'static str,
    /// Path as annotated, such as `/v1/{name=jobs/*}:cancel`.
    pub(crate) path: String,
    /// Field that the body has; `*`: all fields that the path lacks. Empty: no body.
    pub(crate) body: String,
    /// Whether this is the first path of the method.
    pub(crate) is_first: bool,
}

impl Binding {
    /// Name of the field that the path has.
    pub(crate) fn variable(&self) -> Option<String> {
        let (_, rest) = self.path.split_once('{')?;
        let end = rest.find(['=', '}'])?;
        Some(rest[..end].to_owned())
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
    let verbs = ["get", "put", "post", "delete"];
    let found = verbs.iter().find_map(|verb| Some((*verb, text(verb).filter(|path| !path.is_empty())?)));
    let (verb, path) = found.ok_or_else(|| format!("{} has no path", method.full_name()))?;
    Ok(Binding { method: method.clone(), verb, path, body: text("body").unwrap_or_default(), is_first })
}
