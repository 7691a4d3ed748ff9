//! Tests of numbers that may be left out: 0 never stands for a default, for "unknown" or for "none".

use crate::manifests::curl;
use crate::serving::Serving;
use lightpath_proto::v1;
use prost::Message as _;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, SourceCodeInfo};
use serde_json::{Value, json};
use std::collections::BTreeSet;

// What a comment's path counts: the fields of a message, the messages in it, and those of a file.
const FIELD: i32 = 2;
const NESTED: i32 = 3;
const MESSAGE: i32 = 4;

/// A number of the API with its comment and that of its message.
struct Number {
    name: String,
    comment: String,
    comment_of_message: String,
    may_be_unset: bool,
}

/// All numbers of the API.
fn numbers() -> Vec<Number> {
    let set = prost_types::FileDescriptorSet::decode(lightpath_proto::DESCRIPTORS).unwrap();
    let mut numbers = Vec::new();
    for file in set.file.iter().filter(|file| file.package() == "lightpath.v1") {
        let comments = file.source_code_info.as_ref().unwrap();
        for (i, message) in (0..).zip(&file.message_type) {
            add_numbers(&mut numbers, comments, message, message.name(), &[MESSAGE, i]);
        }
    }
    numbers
}

fn add_numbers(
    numbers: &mut Vec<Number>,
    comments: &SourceCodeInfo,
    message: &DescriptorProto,
    name: &str,
    path: &[i32],
) {
    for (i, field) in (0..).zip(&message.field).filter(|(_, field)| is_number(field)) {
        numbers.push(Number {
            name: format!("{name}.{}", field.name()),
            comment: comment(comments, &[path, &[FIELD, i]].concat()),
            comment_of_message: comment(comments, path),
            may_be_unset: field.proto3_optional(),
        });
    }
    for (i, nested) in (0..).zip(&message.nested_type) {
        let path = [path, &[NESTED, i]].concat();
        add_numbers(numbers, comments, nested, &format!("{name}.{}", nested.name()), &path);
    }
}

fn is_number(field: &FieldDescriptorProto) -> bool {
    let others = [Type::Message, Type::String, Type::Bytes, Type::Bool, Type::Enum];
    field.label() != Label::Repeated && !others.contains(&field.r#type())
}

fn comment(comments: &SourceCodeInfo, path: &[i32]) -> String {
    let found = comments.location.iter().find(|location| location.path == path);
    found.map(|location| location.leading_comments().to_owned()).unwrap_or_default()
}

/// Whether a comment gives 0 another meaning than that of a number.
fn has_special_zero(comment: &str) -> bool {
    let words: Vec<&str> = comment.split_whitespace().collect();
    let follows = |next: &str| ["means", "stands", "for", "if", "without", "before"].contains(&next);
    words.contains(&"0:") || words.windows(2).any(|pair| pair[0] == "0" && follows(pair[1]))
}

#[test]
fn only_sizes_of_pages_have_a_zero_that_is_no_number() {
    for comment in [
        "Bits of a level, 1 to 16; 0 means 8.",
        "Exposure time [s]. 0: unknown.",
        "Loss; 0 without\n validation pairs.",
        "All values are 0 if the version was not measured.",
    ] {
        assert!(has_special_zero(comment), "{comment}");
    }
    let numbers = numbers();
    assert!(numbers.len() > 200, "{} numbers", numbers.len());
    let sizes_of_pages = |number: &&Number| number.name.ends_with(".page_size");
    assert!(numbers.iter().filter(sizes_of_pages).all(|size| has_special_zero(&size.comment)));
    for Number { name, comment, comment_of_message, .. } in numbers.iter().filter(|number| !sizes_of_pages(number)) {
        for comment in [comment, comment_of_message] {
            assert!(
                !has_special_zero(comment),
                "{name} must be optional, and say what it means if it is unset: {comment}"
            );
        }
    }
}

#[test]
fn numbers_that_may_be_unset_say_what_that_means() {
    let is_said = |comment: &str| ["Unset", "unset", "Required"].iter().any(|word| comment.contains(word));
    let numbers = numbers();
    let unsaid = numbers.iter().filter(|number| number.may_be_unset && !is_said(&number.comment));
    let unsaid: Vec<&str> = unsaid.map(|number| number.name.as_str()).collect();
    assert!(unsaid.is_empty(), "{unsaid:?}");
}

/// Requests over HTTP, each with the field that its body is (empty: the request) and the schema of its body. They have
/// no number that may be left out.
fn requests(target: &str) -> Vec<(&'static str, &'static str, &'static str, Value)> {
    let place = json!({ "distanceM": 0.05 });
    let modulator = json!({ "widthPx": 64, "heightPx": 48, "pixelPitchXM": 8e-6 });
    let display = |orders: &str| {
        json!({
            "name": "displays/new", "modulator": modulator, "wavelengthsM": [515e-9], "simulatedBench": {}, orders: {}
        })
    };
    let dataset = json!({ "name": "datasets/new", "display": "displays/lab", "place": place });
    let hologram = json!({
        "display": "displays/lab", "planes": [{ "place": place, "target": target }], "method": "HOLOGRAM_METHOD_ADAM",
        "loss": {},
    });
    let pair = json!({ "id": "a", "pattern": target, "photo": target });
    vec![
        ("/v1/displays", "display", "DisplayInput", display("allOrders")),
        ("/v1/displays", "display", "DisplayInput", display("orderFilter")),
        ("/v1/datasets", "dataset", "DatasetInput", dataset),
        ("/v1/datasets/new:addPairs", "", "AddPairsRequest", json!({ "pairs": [pair] })),
        ("/v1/jobs", "", "SubmitJobRequest", json!({ "spec": { "optimizeHologram": hologram } })),
    ]
}

async fn post(serving: &Serving, path: &str, body: &Value) -> Value {
    let (json, body) = ("content-type: application/json", body.to_string());
    let answer = curl(serving, path, &["--header", json, "--data", &body]).await;
    serde_json::from_slice(&answer.body).unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn explicit_zeros_are_refused_all_at_once_and_the_fix_says_to_leave_them_out() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let target = serving.upload(&crate::jobs::picture()).await;
    let document: Value = serde_json::from_str(lightpath_proto::OPENAPI).unwrap();
    let schemas = &document["components"]["schemas"];
    let mut count = 0;
    for (path, body, schema, mut request) in requests(&target) {
        let expected = zeroed(schemas, &schemas[schema], &mut request, body);
        let problem = post(&serving, path, &request).await;
        let refused = problem["fields"].as_array().unwrap().iter();
        let refused = refused.filter(|wrong| wrong["fix"].as_str().unwrap().contains("leave it out for "));
        let refused: BTreeSet<String> = refused.map(|wrong| wrong["field"].as_str().unwrap().to_owned()).collect();
        assert_eq!(refused, expected, "{path}: {problem}");
        count += refused.len();
    }
    assert!(count >= 15, "{count} fields");
    serving.stop().await.unwrap();
}

/// Numbers whose comments have no range.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn no_wavelength_or_version_is_0() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let plan = json!({ "place": { "distanceM": 0.05 }, "wavelengthM": 0 });
    let alias = json!({ "alias": "best", "version": 0 });
    let report = json!({ "kernel": "515nm-50mm", "version": 0 });
    let tried = json!({ "kernel": "515nm-50mm", "triedVersion": 0 });
    for (path, request, field) in [
        ("/v1/displays/lab:planPropagation", plan, "wavelength_m"),
        ("/v1/displays/lab/kernels/515nm-50mm:setAlias", alias, "version"),
        ("/v1/displays/lab/devices/a:report", report, "version"),
        ("/v1/displays/lab/devices/a:report", tried, "tried_version"),
    ] {
        let problem = post(&serving, path, &request).await;
        let wrong = &problem["fields"][0];
        let fix = wrong["fix"].as_str().unwrap_or_default();
        assert!(wrong["field"] == field && fix.contains("leave it out for "), "{path}: {problem}");
    }
    let request =
        v1::FetchKernelRequest { kernel: crate::kernels::KERNEL.into(), version: Some(0), ..Default::default() };
    let refused = crate::kernels::client(&serving).fetch_kernel(request).await;
    crate::serving::expect(refused.map(drop), tonic::Code::InvalidArgument, "version is 0, but must be 1 or more");
    let digest = serving.upload(b"abc").await;
    let request = v1::ReadArtifactRequest { digest, limit_bytes: Some(0), ..Default::default() };
    let refused = serving.artifacts().read_artifact(request).await;
    crate::serving::expect(refused.map(drop), tonic::Code::InvalidArgument, "limit_bytes is 0, but must be 1 to");
    serving.stop().await.unwrap();
}

/// Sets every number that may be left out and must not be 0, according to the document, to 0. Returns the paths of
/// these fields.
fn zeroed(schemas: &Value, schema: &Value, value: &mut Value, at: &str) -> BTreeSet<String> {
    let name = schema["$ref"].as_str().and_then(|reference| reference.rsplit('/').next());
    let schema = name.map_or(schema, |name| &schemas[name]);
    let mut paths = BTreeSet::new();
    match value {
        Value::Object(fields) => {
            for (name, property) in schema["properties"].as_object().unwrap() {
                let path = if at.is_empty() { snake_case(name) } else { format!("{at}.{}", snake_case(name)) };
                if let Some(value) = fields.get_mut(name) {
                    paths.extend(zeroed(schemas, property, value, &path));
                } else if excludes_zero(property) {
                    fields.insert(name.clone(), 0.into());
                    paths.insert(path);
                }
            }
        }
        Value::Array(items) => {
            for (i, item) in items.iter_mut().enumerate() {
                paths.extend(zeroed(schemas, &schema["items"], item, &format!("{at}[{i}]")));
            }
        }
        _ => {}
    }
    paths
}

fn excludes_zero(schema: &Value) -> bool {
    !schema["exclusiveMinimum"].is_null() || schema["minimum"].as_f64().is_some_and(|least| least > 0.0)
}

fn snake_case(name: &str) -> String {
    let lower = |c: char| if c.is_ascii_uppercase() { format!("_{}", c.to_ascii_lowercase()) } else { c.to_string() };
    name.chars().map(lower).collect()
}
