//! Requests about own things succeed, their answers have no trace of foreign things, and every change is in the audit
//! log.

use super::examples::{Example, examples};
use super::person::Person;
use super::traces::{Traces, snapshot};
use super::two_worlds::TwoWorlds;
use lightpath_proto::v1;
use prost::Message as _;
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use tonic::Code;

/// Fields of a submission that may have the same value as in a foreign job, and the keys of their values.
const LABELS: [(&str, &str); 3] = [("batch", "$batch"), ("request_id", "$request"), ("unique_key", "$key")];
/// Labels of a job on the foreign display that an admin submitted for the owner of own jobs.
const SHARED: [(&str, &str); 2] = [("request_id", "shared request"), ("unique_key", "shared key")];

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn own_things_leave_no_trace_of_foreign_ones_and_every_change_is_logged() {
    let worlds = TwoWorlds::build().await;
    let people = worlds.people();
    let person = people.iter().find(|person| person.name == "lab-admin").unwrap();
    submit_for(&worlds, person).await;
    let traces = Traces::of(&worlds.foreign, &snapshot(&worlds.admin(), "faraway").await);
    let mut made = BTreeSet::new();
    for example in examples() {
        let answer = example.send(person, &example.in_world(&worlds.own_of(person))).await;
        let (code, parts) = match answer {
            Ok(messages) => (Code::Ok, messages.iter().map(|message| message.to_vec()).collect()),
            Err(status) => (status.code(), vec![status.message().as_bytes().to_vec(), status.details().to_vec()]),
        };
        let shown: Vec<_> = parts.iter().map(|part| String::from_utf8_lossy(part)).collect();
        assert_eq!(code, example.answer, "{} {:?}: {shown:?}", example.method, example.messages);
        for part in &parts {
            assert_eq!(traces.found_in(part), None, "{} {:?}: {shown:?}", example.method, example.messages);
        }
        if changes_something(example.method) && code == Code::Ok {
            made.insert(example.method);
        }
    }
    submit_with_foreign_labels(&worlds, person).await;
    submit_with_shared_labels(&worlds, &traces, person).await;
    let all = examples();
    let changing = all.iter().map(|example| example.method).filter(|method| changes_something(method));
    assert_eq!(made, changing.collect(), "every changing method needs an example that succeeds");
    for method in made {
        require_line(&worlds, person, method);
    }
}

/// A submission of a job that waits for no other.
fn submission() -> Example {
    let mut example = examples().into_iter().find(|example| example.method == "JobService/SubmitJob").unwrap();
    example.messages[0]["after"] = Value::Array(Vec::new());
    example
}

/// Submits a job on the foreign display for a person who may not see it.
async fn submit_for(worlds: &TwoWorlds, person: &Person<'_>) {
    let mut messages = submission().in_world(&worlds.foreign);
    messages[0]["owner"] = Value::from(person.name.clone());
    for (label, text) in SHARED {
        messages[0][label] = Value::from(text);
    }
    submission().send(&worlds.admin(), &messages).await.unwrap();
}

/// Submits jobs with a label that the same owner uses for a foreign job. The refusals do not name that job.
async fn submit_with_shared_labels(worlds: &TwoWorlds, traces: &Traces, person: &Person<'_>) {
    for (label, text) in SHARED {
        let mut messages = submission().in_world(&worlds.own_of(person));
        messages[0][label] = Value::from(text);
        let refused = submission().send(person, &messages).await.unwrap_err();
        assert_eq!(refused.code(), Code::AlreadyExists, "{label}: {refused:?}");
        for part in [refused.message().as_bytes(), refused.details()] {
            assert_eq!(traces.found_in(part), None, "{label}: {refused:?}");
        }
    }
}

/// Submits jobs with the labels of a foreign job of another owner. It does not matter that the other job exists.
async fn submit_with_foreign_labels(worlds: &TwoWorlds, person: &Person<'_>) {
    let example = submission();
    for (label, key) in LABELS {
        let mut messages = example.in_world(&worlds.own_of(person));
        messages[0][label] = worlds.foreign.value(key).clone();
        let answer = example.send(person, &messages).await.unwrap_or_else(|status| panic!("{label}: {status:?}"));
        let job = v1::Job::decode(answer[0].clone()).unwrap();
        assert_ne!(job.name, worlds.foreign.text("$waiting"), "{label}");
    }
}

/// Estimates of the memory \[bytes\] and of the time \[s\] for a report on the first version of the own kernel.
async fn report_need(worlds: &TwoWorlds) -> (u64, f64) {
    let report = v1::ReportKernel { kernel_version: format!("{}/versions/1", worlds.own.text("$kernel")) };
    let spec = Some(v1::JobSpec { kind: Some(v1::job_spec::Kind::ReportKernel(report)) });
    let job = worlds.admin().submit(v1::SubmitJobRequest { spec, ..Default::default() }).await;
    (job.estimated_memory_bytes(), job.estimated_time_s())
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_foreign_dataset_with_the_id_of_a_deleted_one_is_not_used() {
    let worlds = TwoWorlds::build().await;
    let (admin, name) = (worlds.admin(), worlds.own.text("$near").to_owned());
    let with_dataset = report_need(&worlds).await;
    let evaluate =
        v1::EvaluateKernel { dataset: name.clone(), kernel: Some(v1::KernelChoice::ideal()), ..Default::default() };
    let spec = Some(v1::JobSpec { kind: Some(v1::job_spec::Kind::EvaluateKernel(evaluate)) });
    let job = admin.submit(v1::SubmitJobRequest { spec, ..Default::default() }).await.name;
    let cancel = v1::CancelJobRequest { name: job.clone() };
    admin.ask::<v1::Job>("JobService/CancelJob", cancel).await.unwrap();
    let delete = v1::DeleteDatasetRequest { name: name.clone() };
    admin.ask::<v1::DeleteDatasetResponse>("DatasetService/DeleteDataset", delete).await.unwrap();
    let without_dataset = report_need(&worlds).await;
    assert_ne!(with_dataset, without_dataset, "the estimate shows whether a dataset is used");
    let display = worlds.foreign.text("$display").to_owned();
    let dataset = v1::Dataset { name: name.clone(), display, place: Some(v1::Place::at_m(4e-3)), ..Default::default() };
    let create = v1::CreateDatasetRequest { dataset: Some(dataset) };
    admin.ask::<v1::Dataset>("DatasetService/CreateDataset", create).await.unwrap();
    let artifact = |key: &str| worlds.foreign.text(key).to_owned();
    let (phase, photo) = (artifact("$pair_phase"), artifact("$pair_photo"));
    let pairs = vec![v1::Pair { id: "p".into(), pattern: phase, photo, ..Default::default() }];
    let add = v1::AddPairsRequest { dataset: name, pairs };
    admin.ask::<v1::AddPairsResponse>("DatasetService/AddPairs", add).await.unwrap();
    assert_eq!(report_need(&worlds).await, without_dataset);
    let people = worlds.people();
    let person = people.iter().find(|person| person.name == "lab-submitter").unwrap();
    let retried = person.ask::<v1::Job>("JobService/RetryJob", v1::RetryJobRequest { name: job }).await;
    assert_eq!(retried.unwrap_err().code(), Code::NotFound, "the job would read the foreign dataset");
}

/// Whether a method changes something. The names of all methods that only read begin with one of these words.
fn changes_something(method: &str) -> bool {
    let (_, name) = method.split_once('/').unwrap();
    !["Get", "List", "Watch", "Read", "Fetch", "Plan", "Find", "Check", "Compare", "Estimate"]
        .iter()
        .any(|word| name.starts_with(word))
}

/// Asserts that the audit log has a line about a successful call.
fn require_line(worlds: &TwoWorlds, person: &Person<'_>, method: &str) {
    let log = fs::read_to_string(worlds.guarded.serving.config.data_dir.join("audit.jsonl")).unwrap();
    let call = format!("/lightpath.v1.{method}");
    let is_line = |line: Value| {
        line["call"] == call.as_str()
            && line["caller"] == person.name.as_str()
            && line["address"] == "127.0.0.1"
            && line["outcome"] == "OK"
            && line["object"].as_str().is_some_and(|object| !object.is_empty())
    };
    assert!(log.lines().any(|line| is_line(serde_json::from_str(line).unwrap())), "{method} has no line: {log}");
}
