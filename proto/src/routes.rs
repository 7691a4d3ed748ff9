//! The methods over HTTP: which verb and path call which method, and how its messages become JSON. The annotations of
//! the methods in the `.proto` files define them.

use crate::v1;
use pbjson_types::Timestamp;
use percent_encoding::percent_decode_str;
use prost::Message;
use prost::bytes::Bytes;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// A method at one of its paths.
#[derive(Debug)]
pub struct Route {
    /// HTTP verb, such as `GET`.
    pub verb: &'static str,
    /// Path as annotated, such as `/v1/{name=jobs/*}:cancel`.
    pub path: &'static str,
    /// Path of the gRPC method, such as `/lightpath.v1.JobService/CancelJob`.
    pub method: &'static str,
    /// Whether the method answers with a stream of messages.
    pub is_stream: bool,
    /// What the body of a request has.
    pub body: Body,
    /// Field with an id of the request, by which the server knows a repeated request: its name in the `.proto` file and
    /// in JSON.
    pub request_id: Option<[&'static str; 2]>,
    /// Field with what the request expects of the resource in its path, such as `expected_revision`.
    pub expected: Option<[&'static str; 2]>,
    /// Fields that the query may have.
    pub query: &'static [Parameter],
    /// Names of all fields in the `.proto` file and in JSON, if the method ignores others.
    counts: Option<&'static [[&'static str; 2]]>,
    segments: &'static [Option<&'static str>],
    action: &'static str,
    variable: Option<(&'static str, usize, usize)>,
    encode: fn(Value) -> Result<Vec<u8>, RequestError>,
    to_json: fn(Bytes) -> Result<Vec<u8>, JsonError>,
}

/// What the body of a request has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Body {
    /// Nothing: the fields that the path lacks are in the query.
    Nothing,
    /// All fields that the path lacks.
    Request,
    /// The value of this field.
    Field(&'static str),
}

/// A field that the query of a request may have.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// Name in the `.proto` file, such as `page_size`; in a message within the request, such as `place.distance_m`.
    pub name: &'static str,
    /// Name in JSON.
    pub json_name: &'static str,
    /// Form of the value.
    pub kind: ParameterKind,
    /// Whether the parameter may stand several times.
    pub is_list: bool,
}

/// Form of a query parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterKind {
    /// A text.
    Text,
    /// A whole number, 0 or more.
    Count,
    /// A number.
    Number,
    /// `true` or `false`.
    Flag,
    /// A time in the form of RFC 3339.
    Time,
    /// Names of fields with commas between them, such as `url,events`.
    Mask,
    /// A value of an enumeration with this prefix. `STATE_RUNNING` and `running` are the same value.
    Word(&'static str),
}

/// Why the answer of a method did not become JSON.
#[derive(Debug, thiserror::Error)]
pub enum JsonError {
    /// The answer is not of the method's type.
    #[error("the answer of the method is damaged")]
    Decode(#[from] prost::DecodeError),
    /// The answer has a value that JSON cannot hold.
    #[error("the answer of the method has no JSON form")]
    Encode(#[from] serde_json::Error),
}

/// What is wrong with a request: `{field} {problem}; {fix}`.
#[derive(Debug, thiserror::Error)]
#[error("{field} {problem}; {fix}")]
pub struct RequestError {
    /// The field in the body or the query, or what else is wrong, such as `the body`.
    pub field: String,
    /// What is wrong with it.
    pub problem: String,
    /// What to do about it.
    pub fix: String,
}

impl RequestError {
    fn new(field: &str, problem: impl Into<String>, fix: impl Into<String>) -> Self {
        Self { field: field.to_owned(), problem: problem.into(), fix: fix.into() }
    }
}

/// A request of a method.
#[derive(Clone, Debug, PartialEq)]
pub struct EncodedRequest {
    /// The encoded message.
    pub message: Vec<u8>,
    /// Names of fields in the body that the method does not know and ignores.
    pub ignored: Vec<String>,
}

/// A field of a request that a header gives.
#[derive(Clone, Debug)]
pub struct FromHeader {
    /// The header, as messages call it.
    pub header: &'static str,
    /// Name of the field in the `.proto` file and in JSON.
    pub field: [&'static str; 2],
    /// Its value.
    pub value: Value,
}

/// A route that a path matches.
#[derive(Clone, Debug)]
pub struct Match {
    /// The route.
    pub route: &'static Route,
    /// Value of the field that the path has.
    value: Option<String>,
}

/// Finds the route of a request.
///
/// # Errors
///
/// The verbs that the path has routes for; empty if there is no such path.
pub fn find(verb: &str, path: &str) -> Result<Match, Vec<&'static str>> {
    let mut verbs = Vec::new();
    for route in ROUTES {
        let Some(value) = route.value_in(path) else { continue };
        if route.verb == verb {
            return Ok(Match { route, value });
        }
        verbs.push(route.verb);
    }
    Err(verbs)
}

impl Route {
    /// The value of the path's variable, if the path has the form of this route.
    fn value_in(&'static self, path: &str) -> Option<Option<String>> {
        let mut path = path.strip_prefix('/')?;
        if !self.action.is_empty() {
            path = path.strip_suffix(self.action)?.strip_suffix(':')?;
        }
        let last = self.segments.len() - 1;
        let is_part = |(i, (segment, part)): (usize, (&Option<&str>, &str))| match segment {
            Some(text) => *text == part,
            // A colon in the last part begins an action. Clients that mean a colon send %3A.
            None => !part.is_empty() && (i < last || !part.contains(':')),
        };
        let is_match = path.split('/').count() == self.segments.len()
            && self.segments.iter().zip(path.split('/')).enumerate().all(is_part);
        if !is_match {
            return None;
        }
        let Some((_, begin, end)) = self.variable else { return Some(None) };
        let parts = path.split('/').take(end).skip(begin);
        let decoded: Result<Vec<_>, _> = parts.map(|part| percent_decode_str(part).decode_utf8()).collect();
        Some(Some(decoded.ok()?.join("/")))
    }

    /// The JSON form of an answer of the method.
    ///
    /// # Errors
    ///
    /// [`JsonError`] if the bytes are no such message.
    pub fn json(&self, answer: Bytes) -> Result<Vec<u8>, JsonError> {
        (self.to_json)(answer)
    }
}

impl Match {
    /// Name of the resource that the path has.
    #[must_use]
    pub fn resource(&self) -> Option<&str> {
        self.value.as_deref()
    }

    /// The encoded request of the method, from the query, the JSON body (empty: none) and headers.
    ///
    /// # Errors
    ///
    /// [`RequestError`] if a field is unknown, stands twice or has a wrong value. Device reports may have unknown fields.
    pub fn request(
        &self,
        query: Vec<(String, String)>,
        body: &[u8],
        headers: &[FromHeader],
    ) -> Result<EncodedRequest, RequestError> {
        let mut request = self.body(body)?;
        for given in headers {
            add_header(&mut request, given)?;
        }
        let ignored = self.remove_unknown(&mut request);
        for (name, text) in query {
            self.add_parameter(&mut request, &name, text)?;
        }
        if let (Some((field, ..)), Some(value)) = (self.route.variable, &self.value) {
            let value = Value::from(value.clone());
            let differs = || RequestError::new(field, "differs from the path", "leave it out of the body");
            let no_object = || RequestError::new("the body", "is no JSON object", "send an object with fields");
            let (fields, name) = inner_fields(&mut request, field).ok_or_else(no_object)?;
            if fields.get(name).is_some_and(|other| *other != value) {
                return Err(differs());
            }
            fields.insert(name.to_owned(), value);
        }
        Ok(EncodedRequest { message: (self.route.encode)(Value::Object(request))?, ignored })
    }

    /// Removes fields that the method ignores, and returns their names.
    fn remove_unknown(&self, request: &mut Map<String, Value>) -> Vec<String> {
        let Some(known) = self.route.counts else { return Vec::new() };
        let is_unknown = |name: &&String| !known.as_flattened().contains(&name.as_str());
        let unknown: Vec<String> = request.keys().filter(is_unknown).cloned().collect();
        unknown.iter().for_each(|name| drop(request.remove(name)));
        unknown
    }

    /// The fields in the body.
    fn body(&self, body: &[u8]) -> Result<Map<String, Value>, RequestError> {
        if body.is_empty() {
            return Ok(Map::new());
        }
        let parsed = |()| {
            serde_json::from_slice(body)
                .map_err(|error| RequestError::new("the body", format!("is no valid JSON: {error}"), "send JSON"))
        };
        match self.route.body {
            Body::Nothing => Err(RequestError::new("the body", "is not empty", "send the fields in the query")),
            Body::Field(field) => Ok(Map::from_iter([(field.to_owned(), parsed(())?)])),
            Body::Request => match parsed(())? {
                Value::Object(fields) => Ok(fields),
                _ => Err(RequestError::new(
                    "the body",
                    "is no JSON object",
                    "send an object with the fields of the request",
                )),
            },
        }
    }

    fn add_parameter(&self, request: &mut Map<String, Value>, name: &str, text: String) -> Result<(), RequestError> {
        let found = self.route.query.iter().find(|known| name == known.name || name == known.json_name);
        let Some(parameter) = found else {
            let known: Vec<&str> = self.route.query.iter().map(|known| known.json_name).collect();
            let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
            return Err(RequestError::new(name, "is unknown in the query", format!("known are: {known}")));
        };
        let must_be = |what: &str| RequestError::new(name, format!("is {text:?}"), format!("it must be {what}"));
        let value = match parameter.kind {
            ParameterKind::Count if text.parse::<u64>().is_err() => return Err(must_be("a whole number, 0 or more")),
            ParameterKind::Number if text.parse::<f64>().is_err() => return Err(must_be("a number")),
            ParameterKind::Time if !is_time(&text) => return Err(must_be("a time such as 2026-11-24T09:30:00Z")),
            ParameterKind::Text | ParameterKind::Count | ParameterKind::Number | ParameterKind::Time => {
                Value::from(text)
            }
            ParameterKind::Mask => serde_json::json!({ "paths": mask_paths(&text) }),
            ParameterKind::Flag => match text.as_str() {
                "true" => Value::from(true),
                "false" => Value::from(false),
                _ => return Err(must_be("true or false")),
            },
            ParameterKind::Word(prefix) => {
                let word = text.to_ascii_uppercase().replace('-', "_");
                match word.as_str() {
                    "" => return Ok(()),
                    word if word.starts_with(prefix) => Value::from(word),
                    word => Value::from(format!("{prefix}{word}")),
                }
            }
        };
        let (fields, field) = inner_fields(request, parameter.name)
            .ok_or_else(|| RequestError::new(name, "belongs to a field that the query has, too", "give one of them"))?;
        let others = fields.entry(field).or_insert_with(|| Value::Array(Vec::new()));
        match others {
            Value::Array(values) if parameter.is_list => values.push(value),
            Value::Array(values) if values.is_empty() => *others = value,
            _ => return Err(RequestError::new(name, "stands twice in the query", "give it once")),
        }
        Ok(())
    }
}

/// The fields among which a parameter stands, and its name there: `place.distance_m` is a field of `place`.
fn inner_fields<'a, 'n>(
    request: &'a mut Map<String, Value>,
    name: &'n str,
) -> Option<(&'a mut Map<String, Value>, &'n str)> {
    let Some((outer, inner)) = name.split_once('.') else { return Some((request, name)) };
    let fields = request.entry(outer).or_insert_with(|| Value::Object(Map::new())).as_object_mut()?;
    Some((fields, inner))
}

/// Adds a field that a header gives. The body may say the same.
fn add_header(request: &mut Map<String, Value>, given: &FromHeader) -> Result<(), RequestError> {
    let FromHeader { header, field, value } = given;
    let same = |other: &Value| other == value || other.as_str() == Some(value.to_string().as_str());
    match field.iter().find_map(|name| request.get(*name)) {
        Some(Value::Null) | None => drop(request.insert(field[1].to_owned(), value.clone())),
        Some(other) if same(other) => {}
        Some(_) => return Err(RequestError::new(field[0], format!("differs from {header}"), "give one of them")),
    }
    Ok(())
}

/// The paths of a mask. In JSON fields have names in camel case, and in a mask the server knows those of the `.proto`
/// file.
fn mask_paths(text: &str) -> Vec<String> {
    let snake = |name: &str| {
        name.chars().fold(String::new(), |mut snake, letter| {
            if letter.is_ascii_uppercase() {
                snake.push('_');
            }
            snake.push(letter.to_ascii_lowercase());
            snake
        })
    };
    text.split(',').map(str::trim).filter(|name| !name.is_empty()).map(snake).collect()
}

fn is_time(text: &str) -> bool {
    serde_json::from_value::<Timestamp>(Value::from(text)).is_ok()
}

fn encode<M: Message + DeserializeOwned>(request: Value) -> Result<Vec<u8>, RequestError> {
    let message: Result<M, _> = serde_path_to_error::deserialize(request);
    message.map(|message| message.encode_to_vec()).map_err(|error| {
        let (path, inner) = (error.path().to_string(), error.inner().to_string());
        // The message of a number that its field cannot hold names only types of Rust.
        let inner =
            if inner.contains("untagged enum") { "a number that the field cannot hold".to_owned() } else { inner };
        let path = if path == "." { "the body" } else { &path };
        RequestError::new(path, format!("is wrong: {inner}"), "give what /openapi.json says about it")
    })
}

fn to_json<M: Message + Default + Serialize>(answer: Bytes) -> Result<Vec<u8>, JsonError> {
    Ok(serde_json::to_vec(&M::decode(answer)?)?)
}

include!(concat!(env!("OUT_DIR"), "/routes.rs"));

#[cfg(test)]
mod tests;
