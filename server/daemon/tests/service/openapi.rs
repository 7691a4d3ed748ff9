//! Tests of the OpenAPI document against the server: its paths are answered, and answers have the form it says.

use crate::manifests::curl;
use crate::serving::Serving;
use serde_json::{Value, json};

async fn document(serving: &Serving) -> Value {
    let answer = curl(serving, "/openapi.json", &[]).await;
    assert_eq!((answer.status, answer.field("content-type")), (200, Some("application/json")));
    serde_json::from_slice(&answer.body).unwrap()
}

/// What a reference stands for.
fn resolved<'a>(document: &'a Value, schema: &'a Value) -> &'a Value {
    let Some(reference) = schema["$ref"].as_str() else { return schema };
    let found = document.pointer(reference.strip_prefix('#').unwrap());
    found.unwrap_or_else(|| panic!("{reference} is missing"))
}

/// Compares a value with its schema, and returns the number of fields found.
fn check(document: &Value, schema: &Value, value: &Value, at: &str) -> usize {
    let schema = resolved(document, schema);
    let kinds = match &schema["type"] {
        Value::Array(kinds) => kinds.clone(),
        kind => vec![kind.clone()],
    };
    let kind = match value {
        Value::Object(_) => "object",
        Value::Array(_) => "array",
        Value::String(_) => "string",
        Value::Bool(_) => "boolean",
        Value::Number(number) if number.is_u64() || number.is_i64() => "integer",
        Value::Number(_) => "number",
        Value::Null => "null",
    };
    let is_kind = kinds.iter().any(|known| known == kind || (known == "number" && kind == "integer"));
    assert!(is_kind, "{at} is {value}, but the document says {}", schema["type"]);
    match value {
        Value::Object(fields) => {
            let field = |(name, value): (&String, &Value)| {
                let named = &schema["properties"][name];
                let property = if named.is_object() { named } else { &schema["additionalProperties"] };
                assert!(property.is_object(), "{at}.{name} is not in the document");
                1 + check(document, property, value, &format!("{at}.{name}"))
            };
            for name in schema["required"].as_array().into_iter().flatten() {
                assert!(fields.contains_key(name.as_str().unwrap()), "{at} lacks {name}: {value}");
            }
            fields.iter().map(field).sum()
        }
        Value::Array(items) => items.iter().map(|item| check(document, &schema["items"], item, at)).sum(),
        Value::String(text) => {
            // Later servers may answer with other words, but this one is in its own document.
            let is_known = schema["examples"].as_array().is_none_or(|words| words.iter().any(|word| word == text));
            assert!(is_known, "{at} is {text}, but the document knows {}", schema["examples"]);
            0
        }
        _ => 0,
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn answers_have_the_form_that_the_document_says() {
    let serving = Serving::start().await;
    let job = crate::jobs::submit_long(&serving).await;
    let document = document(&serving).await;
    for (path, asked, fields) in [
        ("/v1/jobs", "/v1/jobs".to_owned(), 30),
        ("/v1/jobs/{job}", format!("/v1/{}", job.name), 30),
        ("/v1/jobs/{job}/events", format!("/v1/{}/events", job.name), 3),
        ("/v1/displays", "/v1/displays".to_owned(), 10),
        ("/v1/queue", "/v1/queue".to_owned(), 2),
        ("/v1/jobs/{job}", "/v1/jobs/none".to_owned(), 4),
    ] {
        let answer = curl(&serving, &asked, &[]).await;
        let responses = &document["paths"][path]["get"]["responses"];
        let (key, kind) =
            if answer.status == 200 { ("200", "application/json") } else { ("default", "application/problem+json") };
        let schema = &resolved(&document, &responses[key])["content"][kind]["schema"];
        let found = check(&document, schema, &serde_json::from_slice(&answer.body).unwrap(), path);
        assert!(found >= fields, "{asked} has {found} fields: {}", answer.text());
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_server_answers_every_path_of_the_document() {
    let serving = Serving::start().await;
    let document = document(&serving).await;
    let mut count = 0;
    for (path, verbs) in document["paths"].as_object().unwrap() {
        let asked = path.replace('{', "a-").replace('}', "");
        let answer = curl(&serving, &asked, &["--request", "TRACE"]).await;
        let mut allowed: Vec<String> =
            answer.field("allow").unwrap_or_default().split(',').map(|verb| verb.trim().to_lowercase()).collect();
        // The server answers HEAD wherever it answers GET.
        allowed.retain(|verb| verb != "head");
        allowed.sort();
        let said: Vec<String> = verbs.as_object().unwrap().keys().cloned().collect();
        assert_eq!((answer.status, allowed), (405, said), "{path}");
        count += verbs.as_object().unwrap().len();
    }
    assert!(count > 50, "{count} operations");
}

/// Generators make clients that work from such a document, and strict clients survive later servers.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn requests_are_closed_and_answers_open() {
    let serving = Serving::start().await;
    let document = document(&serving).await;
    let schemas = &document["components"]["schemas"];
    let reached = |first: &str| {
        let (mut names, mut next) = (std::collections::BTreeSet::new(), vec![first.to_owned()]);
        while let Some(name) = next.pop() {
            if names.insert(name.clone()) {
                let text = schemas[&name].to_string();
                let references = text.split("#/components/schemas/").skip(1);
                next.extend(references.map(|rest| rest.split('"').next().unwrap().to_owned()));
            }
        }
        names
    };
    for name in reached("SubmitJobRequest") {
        let schema = &schemas[&name];
        assert!(schema["additionalProperties"] == false || schema["enum"].is_array(), "{name}: {schema}");
    }
    for name in reached("Job") {
        let schema = &schemas[&name];
        assert!(schema["additionalProperties"].is_null() && schema["enum"].is_null(), "{name}: {schema}");
    }
    let spec = &schemas["JobSpecInput"]["not"]["anyOf"];
    assert!(spec.as_array().unwrap().contains(&json!({ "required": ["optimizeHologram", "learnKernel"] })), "{spec}");
    assert_eq!(schemas["Kernel"]["properties"]["aliases"]["additionalProperties"]["type"], "integer");
    let iterations = &schemas["OptimizeHologramInput"]["properties"]["iterations"];
    assert_eq!((&iterations["maximum"], &iterations["type"]), (&json!(10_000), &json!("integer")), "{iterations}");
    let required = &schemas["ModulatorInput"]["required"];
    assert!(required.as_array().unwrap().contains(&json!("widthPx")), "{required}");
    assert_eq!(schemas["ModulatorInput"]["properties"]["widthPx"]["minimum"], 16);
    let listing = document["paths"]["/v1/kernels"]["get"]["parameters"].as_array().unwrap();
    assert!(listing.iter().any(|parameter| parameter["name"] == "place.distanceM"), "{listing:?}");
}
