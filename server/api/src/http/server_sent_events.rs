//! Streams of answers as server-sent events.

use super::refusal::Refusal;
use super::request_id::RequestId;
use axum::http::HeaderMap;
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures::StreamExt as _;
use lightpath_proto::routes::Route;
use lightpath_proto::v1;
use lightpath_proto::v1::event::Change;
use prost::Message as _;
use prost::bytes::Bytes;
use serde::Serialize;
use std::convert::Infallible;
use tonic::{Status, Streaming};

/// Header in which a client that comes back names the last event that it received.
const LAST_EVENT_ID: &str = "last-event-id";
/// The same in the request of the method.
const LAST_EVENT_ID_FIELD: &str = "last_event_id";

/// Adds the header `last-event-id` to the query of a method that has such a field. The query, if it has one, is older:
/// browsers repeat it at every connection.
pub(super) fn add_last_event_id(route: &Route, headers: &HeaderMap, query: &mut Vec<(String, String)>) {
    let id = headers.get(LAST_EVENT_ID).and_then(|value| value.to_str().ok());
    let parameter = route.query.iter().find(|parameter| parameter.name == LAST_EVENT_ID_FIELD);
    if let (Some(id), Some(parameter)) = (id, parameter) {
        query.retain(|(name, _)| name != parameter.name && name != parameter.json_name);
        query.push((parameter.name.to_owned(), id.to_owned()));
    }
}

/// The answers of a stream as events, and an event `error` for a refusal, which is the last.
///
/// An answer that is an [`v1::Event`] is an event with its id and the name of the change, such as `job`. All other
/// answers are events `message`.
pub(super) fn events(answers: Streaming<Bytes>, route: &'static Route, RequestId(request_id): RequestId) -> Response {
    let events = answers.map(move |answer| {
        let event = answer.and_then(|answer| event(route, answer));
        Ok::<_, Infallible>(event.unwrap_or_else(|status| named("error", &Refusal::from(status).json(&request_id))))
    });
    Sse::new(events).keep_alive(KeepAlive::default()).into_response()
}

fn event(route: &Route, answer: Bytes) -> Result<Event, Status> {
    if !route.query.iter().any(|parameter| parameter.name == LAST_EVENT_ID_FIELD) {
        return route.json(answer).map(|json| named("message", &json)).map_err(internal);
    }
    let v1::Event { id, change } = v1::Event::decode(answer).map_err(internal)?;
    let (name, data) = match change.ok_or_else(|| Status::internal("an event has no change"))? {
        Change::Reset(reset) => ("reset", json(&reset)),
        Change::Job(job) => ("job", json(&job)),
        Change::Kernel(changed) => ("kernel", json(&changed)),
        Change::Dataset(changed) => ("dataset", json(&changed)),
        Change::Display(changed) => ("display", json(&changed)),
        Change::Device(changed) => ("device", json(&changed)),
        Change::Queue(changed) => ("queue", json(&changed)),
    };
    Ok(named(name, &data?).id(id))
}

fn json(message: &impl Serialize) -> Result<Vec<u8>, Status> {
    serde_json::to_vec(message).map_err(internal)
}

fn internal(error: impl ToString) -> Status {
    Status::internal(error.to_string())
}

fn named(name: &str, data: &[u8]) -> Event {
    Event::default().event(name).data(String::from_utf8_lossy(data))
}
