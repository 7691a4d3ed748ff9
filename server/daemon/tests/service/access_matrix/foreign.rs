//! What a token may not see does not exist for it: every name in every request, lists, pages and plain HTTP.

use super::examples::{Example, examples};
use super::fields::{Api, Names, Reference};
use super::person::Person;
use super::protocols::{Client, Form};
use super::traces::{Traces, snapshot};
use super::two_worlds::TwoWorlds;
use super::world::{World, missing};
use prost::bytes::Bytes;
use serde_json::Value;
use std::fmt;
use tonic::{Code, Status};

/// The answer to a request with one name in it, without that name.
#[derive(PartialEq)]
struct Reply {
    code: Code,
    parts: Vec<Vec<u8>>,
}

impl fmt::Debug for Reply {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts: Vec<_> = self.parts.iter().map(|part| String::from_utf8_lossy(part)).collect();
        write!(to, "{:?} {parts:?}", self.code)
    }
}

impl Reply {
    fn new(answer: Result<Vec<Bytes>, Status>, name: &str) -> Self {
        let (code, parts) = match answer {
            Ok(messages) => (Code::Ok, messages.iter().map(|message| message.to_vec()).collect()),
            Err(status) => (status.code(), vec![status.message().as_bytes().to_vec(), status.details().to_vec()]),
        };
        Self { code, parts: parts.iter().map(|part| without(part, name)).collect() }
    }
}

/// Bytes with dots in place of a name, and of the display in this name.
fn without(bytes: &[u8], name: &str) -> Vec<u8> {
    let display = name.split('/').take(2).collect::<Vec<_>>().join("/");
    let mut bytes = bytes.to_vec();
    for name in [name, &display].map(str::as_bytes) {
        while let Some(at) = bytes.windows(name.len()).position(|window| window == name) {
            bytes[at..at + name.len()].fill(b'.');
        }
    }
    bytes
}

/// An answer without the id of the request, which no two have in common.
fn without_request_id(bytes: &[u8]) -> Vec<u8> {
    let Ok(Value::Object(mut answer)) = serde_json::from_slice(bytes) else { return bytes.to_vec() };
    answer.remove("request_id");
    Value::Object(answer).to_string().into_bytes()
}

/// Whether a foreign name in a field of this kind may be answered with this code.
fn is_allowed(names: Names, code: Code) -> bool {
    match names {
        Names::Display | Names::Kernel | Names::KernelVersion | Names::Rollout | Names::Device | Names::Owner => {
            code == Code::PermissionDenied
        }
        Names::Dataset | Names::Job | Names::Artifact | Names::Webhook => {
            matches!(code, Code::NotFound | Code::PermissionDenied)
        }
        Names::VersionNumber => matches!(code, Code::NotFound | Code::Aborted | Code::PermissionDenied),
        // The ids of datasets and webhooks are unique on the server.
        Names::NewId => matches!(code, Code::AlreadyExists | Code::PermissionDenied),
        // The answer must be that for a name which does not exist. Uploads and empty lists are no refusals.
        Names::Upload | Names::Batch => true,
        Names::Label | Names::PageToken | Names::Nothing | Names::Parts | Names::Ignored => false,
    }
}

fn with_name(messages: &[Value], reference: &Reference, name: &Value) -> Vec<Value> {
    let mut messages = messages.to_vec();
    *messages[0].pointer_mut(&reference.pointer).unwrap() = name.clone();
    messages
}

fn as_text(name: &Value) -> String {
    name.as_str().map_or_else(|| name.to_string(), ToOwned::to_owned)
}

/// One person's requests about foreign things, and the problems that they found.
struct Search<'a> {
    worlds: &'a TwoWorlds,
    traces: &'a Traces,
    person: &'a Person<'a>,
    problems: Vec<String>,
}

impl Search<'_> {
    fn check(&mut self, is_right: bool, problem: impl FnOnce() -> String) {
        if !is_right {
            self.problems.push(format!("{} as {}", problem(), self.person.name));
        }
    }

    /// Notes a problem if an answer shows a foreign thing.
    fn check_traces(&mut self, part: &[u8], about: &str) {
        if let Some(trace) = self.traces.found_in(part) {
            let shown = String::from_utf8_lossy(part).into_owned();
            self.check(false, || format!("{about}: the answer has {trace}: {shown:?}"));
        }
    }

    /// Replaces one name in an example by that of a foreign thing and by that of a missing thing, and compares the
    /// answers.
    async fn refer_to(&mut self, example: &Example, reference: &Reference) {
        let messages = example.in_world(&self.worlds.own_of(self.person));
        let foreign = self.reply(&self.worlds.foreign, example, &messages, reference).await;
        let about = format!("{} {reference:?}", example.method);
        self.check(is_allowed(reference.names, foreign.code), || format!("{about}: {foreign:?}"));
        for part in &foreign.parts {
            self.check_traces(part, &about);
        }
        if reference.names != Names::NewId {
            let missing = self.reply(&self.worlds.foreign.missing(), example, &messages, reference).await;
            self.check(foreign == missing, || format!("{about}: {foreign:?} differs from {missing:?}"));
        }
    }

    /// The answer to an example with one name of another world.
    async fn reply(&self, world: &World, example: &Example, messages: &[Value], reference: &Reference) -> Reply {
        let name = world.value(&reference.key);
        Reply::new(example.send(self.person, &with_name(messages, reference, name)).await, &as_text(name))
    }

    /// Continues the list of an example behind a foreign and behind a missing item, in the own and in the foreign list.
    async fn continue_list(&mut self, example: &Example) {
        let own = example.in_world(&self.worlds.own_of(self.person));
        let Some(own_page) = next_page(example.send(self.person, &own).await) else { return };
        self.check_traces(own_page.as_bytes(), example.method);
        let foreign = example.send(&self.worlds.admin(), &example.in_world(&self.worlds.foreign)).await;
        let foreign_page = next_page(foreign).unwrap_or_else(|| panic!("{} has no second page", example.method));
        let ((own_list, _), (foreign_list, item)) =
            (own_page.split_once('\n').unwrap(), foreign_page.split_once('\n').unwrap());
        for list in [own_list, foreign_list] {
            let mut replies = Vec::new();
            for item in [item, &missing(item, "faraway")] {
                let token = hex(&format!("{list}\n{item}"));
                let mut messages = own.clone();
                messages[0]["page_token"] = Value::from(token.clone());
                replies.push(Reply::new(example.send(self.person, &messages).await, &token));
            }
            let about = format!("{} from {item:?} in {list:?}", example.method);
            self.check(replies[0] == replies[1], || format!("{about}: {replies:?}"));
            for part in &replies[0].parts {
                self.check_traces(part, &about);
            }
        }
    }

    /// Asks for jobs, kernels and metrics over plain HTTP.
    async fn ask_over_http(&mut self) {
        let mut client = Client::new(&self.worlds.guarded.serving, Some(self.person.token.clone()));
        let get = Form { method: "GET", content_type: None };
        let path_of = |world: &World, key: &str| match key {
            "$display" => format!("/v1/jobs?display={}", world.text(key)),
            "$batch" => format!("/v1/jobs?display=displays/lab&batch={}", world.text(key)),
            "$kernel" => format!("/v1/{}/manifest", world.text(key)),
            "$spare" => format!("/v1/{}/devices", world.text(key)),
            "$target" => format!("/v1/artifacts/{}/content", world.text(key)),
            "$far_kernel" => format!("/v1/{}/kernels:nearest?place.distance_m=0.004", world.display(key)),
            _ => format!("/v1/{}", world.text(key)),
        };
        for key in ["$display", "$batch", "$waiting", "$ended", "$kernel", "$spare", "$target", "$far_kernel"] {
            let mut answers = Vec::new();
            for world in [&self.worlds.foreign, &self.worlds.foreign.missing()] {
                let answer = client.http1(&path_of(world, key), get).await;
                answers.push((answer.http, without_request_id(&without(&answer.body, world.text(key)))));
            }
            self.check(answers[0] == answers[1], || format!("HTTP {key}: {answers:?}"));
            self.check_traces(&answers[0].1, key);
        }
        for path in [
            "/metrics",
            "/v1/jobs",
            "/v1/jobs?display=displays/lab",
            "/healthz",
            "/v1/displays/lab/kernels",
            "/v1/displays/lab/devices",
            "/v1/displays/lab/kernels:nearest?place.distance_m=0.004",
            "/v1/keyring",
        ] {
            let answer = client.http1(path, get).await;
            self.check_traces(&answer.body, path);
        }
    }
}

/// The text of the token for the next page, `list \n item`; `None` if the answer has no next page.
fn next_page(answer: Result<Vec<Bytes>, Status>) -> Option<String> {
    /// The field that the answers of all lists have.
    #[derive(Clone, PartialEq, prost::Message)]
    struct List {
        #[prost(string, tag = "2")]
        next_page_token: String,
    }
    let list = <List as prost::Message>::decode(answer.ok()?.remove(0)).unwrap();
    let digits = list.next_page_token;
    let byte = |at: usize| u8::from_str_radix(&digits[at..at + 2], 16).unwrap();
    let text = String::from_utf8((0..digits.len()).step_by(2).map(byte).collect()).unwrap();
    (!text.is_empty()).then_some(text)
}

fn hex(text: &str) -> String {
    text.bytes().map(|byte| format!("{byte:02x}")).collect()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn foreign_things_do_not_exist() {
    let (worlds, api) = (TwoWorlds::build().await, Api::read());
    let before = [snapshot(&worlds.admin(), "lab").await, snapshot(&worlds.admin(), "faraway").await];
    let traces = Traces::of(&worlds.foreign, &before[1]);
    let mut problems = Vec::new();
    for person in worlds.people() {
        let mut search = Search { worlds: &worlds, traces: &traces, person: &person, problems: Vec::new() };
        for example in examples() {
            for reference in api.references(&example) {
                search.refer_to(&example, &reference).await;
            }
            if example.messages[0].get("page_token").is_some() {
                search.continue_list(&example).await;
            }
        }
        search.ask_over_http().await;
        problems.append(&mut search.problems);
    }
    assert!(problems.is_empty(), "{} problems:\n{}", problems.len(), problems.join("\n"));
    let after = [snapshot(&worlds.admin(), "lab").await, snapshot(&worlds.admin(), "faraway").await];
    assert!(before == after, "a refused call changed something");
}
