//! Deadlines and metrics of all requests, gRPC and HTTP.

use super::protocol::is_grpc;
use super::refusal::{refuse, with_problem};
use super::request_id::RequestId;
use super::transcode::Called;
use super::{ARTIFACT_UPLOAD, UNNAMED_UPLOAD};
use crate::api::Api;
use crate::{fixes, status};
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderMap, HeaderValue};
use axum::middleware::Next;
use axum::response::Response;
use lightpath_metrics as metrics;
use lightpath_proto::routes::ROUTES;
use lightpath_service::ServiceError;
use std::collections::HashSet;
use std::sync::LazyLock;
use std::time::{Duration, Instant};
use tokio::time::timeout;
use tonic::Code;
use tracing::Instrument as _;
use uuid::Uuid;

/// Time limit for the answer (of a stream: for its start). The slowest answer is the check of a picture of 64 Mpx that
/// waits for other checks.
const ANSWER_DEADLINE: Duration = Duration::from_secs(120);
/// Time limit for calls that make kernel files before they answer.
const PREPARING_DEADLINE: Duration = Duration::from_secs(600);
/// Methods whose calls do so.
const PREPARING: [&str; 5] = [
    "/lightpath.v1.KernelService/PromoteKernel",
    "/lightpath.v1.KernelService/CheckPromotion",
    "/lightpath.v1.RolloutService/StartRollout",
    "/lightpath.v1.RolloutService/WidenRollout",
    "/lightpath.v1.RolloutService/CompleteRollout",
];
/// Time limit for an upload, whose answer follows its last byte. Each chunk has another time limit.
const UPLOAD_DEADLINE: Duration = Duration::from_secs(24 * 3600);
const UPLOADS: [&str; 3] = ["/lightpath.v1.ArtifactService/WriteArtifact", ARTIFACT_UPLOAD, UNNAMED_UPLOAD];

/// Paths that are answered even while the server stops, so that operators can watch it.
const ALWAYS: [&str; 3] = ["/healthz", "/metrics", "/grpc.health.v1.Health/"];

/// Runs a request within its deadline, or within that of the client (`grpc-timeout`) if it is earlier, and counts it. A
/// stopping server refuses new requests.
pub(super) async fn with_deadline(State(api): State<Api>, mut request: Request, next: Next) -> Response {
    let begin = Instant::now();
    let is_grpc = is_grpc(request.uri().path());
    let method = method(&request);
    let limit = match method.as_str() {
        upload if UPLOADS.contains(&upload) => UPLOAD_DEADLINE,
        preparing if PREPARING.contains(&preparing) => PREPARING_DEADLINE,
        _ => ANSWER_DEADLINE,
    };
    let limit = client_limit(request.headers()).map_or(limit, |client| client.min(limit));
    let id = Uuid::now_v7().to_string();
    request.extensions_mut().insert(RequestId(id.clone()));
    let span = tracing::info_span!("request", id, method);
    let response = if api.is_stopping() && !ALWAYS.iter().any(|path| request.uri().path().starts_with(path)) {
        refuse(status::of(ServiceError::Stopping), is_grpc)
    } else {
        match timeout(limit, next.run(request).instrument(span)).await {
            Ok(response) => response,
            Err(_) => {
                let message = format!("no answer within {} s", limit.as_secs_f64());
                refuse(status::plain(Code::DeadlineExceeded, "NO_ANSWER", message, fixes::AGAIN), is_grpc)
            }
        }
    };
    let (code, took) = (code(&response, is_grpc), begin.elapsed());
    tracing::debug!(id, method, code, took_ms = took.as_secs_f64() * 1e3, "answered");
    metrics::request(method, code, took);
    let mut response = with_problem(response, &id);
    // Users can refer to a request by its id.
    if let Ok(id) = HeaderValue::from_str(&id) {
        response.headers_mut().insert("x-request-id", id);
    }
    response
}

/// Name of the method for the metrics: one of a fixed set, so that clients cannot create new ones.
fn method(request: &Request) -> String {
    if let Some(called) = request.extensions().get::<Called>() {
        return called.method().unwrap_or("unknown").to_owned();
    }
    let route = request.extensions().get::<MatchedPath>().map(MatchedPath::as_str);
    match route {
        None => "unknown".to_owned(),
        Some(route) if route.ends_with("{*rest}") => {
            let path = request.uri().path();
            if is_method(path) { path.to_owned() } else { "unknown".to_owned() }
        }
        Some(route) => route.to_owned(),
    }
}

/// Starts the counters of the metrics for all methods.
pub(super) fn expect_all() {
    metrics::expect_requests(METHODS.iter().map(|method| (method.clone(), "Ok")));
    metrics::expect_requests(ROUTES.iter().map(|route| (route.method.to_owned(), "200")));
    metrics::expect_requests(super::routes().map(|(path, _)| (path.to_owned(), "200")));
}

/// Paths of all gRPC methods.
static METHODS: LazyLock<HashSet<String>> = LazyLock::new(methods);

/// Whether the descriptors contain a method with this path.
fn is_method(path: &str) -> bool {
    METHODS.contains(path)
}

fn methods() -> HashSet<String> {
    use prost::Message as _;
    let sets = [lightpath_proto::DESCRIPTORS, tonic_health::pb::FILE_DESCRIPTOR_SET];
    let files =
        sets.iter().filter_map(|set| prost_types::FileDescriptorSet::decode(*set).ok()).flat_map(|set| set.file);
    let paths = files.flat_map(|file| {
        let package = file.package().to_owned();
        file.service.into_iter().flat_map(move |service| {
            let name = format!("/{package}.{}/", service.name());
            service.method.into_iter().map(move |method| format!("{name}{}", method.name()))
        })
    });
    paths.collect()
}

/// The code of the answer: of gRPC if the headers contain it (as for errors; otherwise it counts as OK), else of HTTP.
fn code(response: &Response, is_grpc: bool) -> String {
    if !is_grpc {
        return response.status().as_str().to_owned();
    }
    let code = response.headers().get("grpc-status").map_or(Code::Ok, |status| Code::from_bytes(status.as_bytes()));
    format!("{code:?}")
}

/// Deadline that the client sent: up to eight digits and a unit.
fn client_limit(headers: &HeaderMap) -> Option<Duration> {
    let text = headers.get("grpc-timeout")?.to_str().ok()?;
    let (digits, unit) = text.split_at_checked(text.len().checked_sub(1)?)?;
    if digits.len() > 8 {
        return None;
    }
    let count: u64 = digits.parse().ok()?;
    match unit {
        "H" => Some(Duration::from_secs(count * 3600)),
        "M" => Some(Duration::from_secs(count * 60)),
        "S" => Some(Duration::from_secs(count)),
        "m" => Some(Duration::from_millis(count)),
        "u" => Some(Duration::from_micros(count)),
        "n" => Some(Duration::from_nanos(count)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn client_deadlines_are_read_as_grpc_writes_them() {
        let limit = |text: &str| {
            client_limit(&HeaderMap::from_iter([("grpc-timeout".parse().unwrap(), text.parse().unwrap())]))
        };
        assert_eq!(limit("5S"), Some(Duration::from_secs(5)));
        assert_eq!(limit("250m"), Some(Duration::from_millis(250)));
        assert_eq!(limit("1H"), Some(Duration::from_secs(3600)));
        for bad in ["", "S", "5", "5s", "123456789S", "-1S"] {
            assert_eq!(limit(bad), None, "{bad}");
        }
    }

    #[test]
    fn only_paths_of_methods_are_known() {
        assert!(is_method("/lightpath.v1.JobService/SubmitJob") && is_method("/grpc.health.v1.Health/Check"));
        assert!(!is_method("/lightpath.v1.JobService/Other"));
    }
}
