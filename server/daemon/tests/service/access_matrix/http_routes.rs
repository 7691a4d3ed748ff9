//! Which callers may call each method over HTTP: the same as over gRPC.

use super::protocols::{Client, Form};
use super::roles::{Caller, callers, refusal};
use crate::access::{EXPECTED, Guarded, MAY_FETCH};
use lightpath_proto::routes::{Body, ROUTES, Route};
use std::collections::BTreeSet;
use tonic::Code;

/// Methods without a path over HTTP for their messages: their contents are streams of bytes or signed texts, which have
/// paths of their own, or both sides speak.
const WITHOUT_ROUTE: [&str; 6] = [
    "/lightpath.v1.ArtifactService/ReadArtifact",
    "/lightpath.v1.ArtifactService/WriteArtifact",
    "/lightpath.v1.KernelService/FetchKernel",
    "/lightpath.v1.KernelService/GetKernelManifest",
    "/lightpath.v1.KernelService/GetKeyring",
    "/lightpath.v1.RigService/ServeRig",
];

/// A path of the route, about the display that the tokens are for and the device of the token for firmware.
fn path_of(route: &Route) -> String {
    let path = route
        .path
        .replace("displays/*", "displays/lab")
        .replace("devices/*", "devices/lab-firmware")
        .replace('*', "1")
        .replace(['{', '}'], "");
    let parts = path.split('/').map(|part| part.split_once('=').map_or(part, |(_, value)| value));
    parts.collect::<Vec<_>>().join("/")
}

fn form_of(route: &Route) -> Form {
    let content_type = (route.body != Body::Nothing).then_some("application/json");
    Form { method: route.verb, content_type }
}

async fn call_every_route(caller: Caller, mut client: Client) {
    for route in ROUTES {
        let (path, form) = (path_of(route), form_of(route));
        let roles = match route.path {
            // Firmware may list the kernels of its display, but not all kernels.
            "/v1/{display=displays/*}/kernels" => MAY_FETCH,
            _ => EXPECTED.iter().find(|(method, _)| *method == route.method).unwrap().1,
        };
        // A path with a display concerns that display alone.
        let call = if path.contains("displays/lab") { path.as_str() } else { route.method };
        // A batch may have jobs for any display, and an empty message names none.
        let is_foreign = route.path == "/v1/batches/{batch}" && caller.is_scoped;
        let expected = caller.refusal(call, roles).or(is_foreign.then_some(Code::PermissionDenied));
        for answer in [client.http1(&path, form).await, client.http2(&path, form).await] {
            assert_eq!(refusal(&answer), expected, "{} {path} as {caller:?}: {answer:?}", route.verb);
            assert_eq!(answer.grpc, None, "{} {path} is HTTP", route.verb);
        }
        // Only a caller with a token learns which verbs a path has.
        let trace = Form { method: "TRACE", content_type: None };
        let expected = if caller.is_anonymous() { 401 } else { 405 };
        assert_eq!(client.http1(&path, trace).await.http, expected, "TRACE {path} as {caller:?}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_route_is_allowed_exactly_as_its_method() {
    let guarded = Guarded::start_with(|config| config.calls_per_s_max = 0).await;
    for caller in callers(&guarded).await {
        let client = Client::new(&guarded.serving, caller.token.clone());
        call_every_route(caller, client).await;
    }
}

#[test]
fn every_method_has_a_route() {
    let routed: BTreeSet<&str> = ROUTES.iter().map(|route| route.method).collect();
    let ours = EXPECTED.iter().filter(|(path, roles)| path.starts_with("/lightpath.v1.") && !roles.is_empty());
    let without: BTreeSet<&str> = ours.map(|(path, _)| *path).filter(|path| !routed.contains(path)).collect();
    assert_eq!(without, BTreeSet::from(WITHOUT_ROUTE));
    assert!(routed.iter().all(|method| EXPECTED.iter().any(|(path, _)| path == method)));
}

#[tokio::test]
async fn changes_over_http_are_in_the_audit_log_with_their_object() {
    let guarded = Guarded::start().await;
    let mut admin = Client::new(&guarded.serving, Some(guarded.tokens["admin"].clone()));
    let pause = Form { method: "POST", content_type: Some("application/json") };
    assert_eq!(admin.http1("/v1/queue:pause", pause).await.http, 200);
    let missing = admin.http1("/v1/jobs/none:cancel", pause).await;
    assert_eq!(missing.http, 404);
    let get = Form { method: "GET", content_type: None };
    assert_eq!(admin.http1("/v1/artifacts/0/upload", get).await.http, 405);
    let audit = guarded.audit().await;
    let upload = audit.lines().find(|line| line.contains("/v1/artifacts/{digest}/upload")).unwrap();
    assert!(!upload.contains(r#""outcome":"OK""#), "{upload}");
    assert!(audit.contains(r#""call":"/lightpath.v1.JobService/PauseQueue","object":"#), "{audit}");
    assert!(audit.contains(r#""outcome":"NOT_FOUND""#), "{audit}");
}
