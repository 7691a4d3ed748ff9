//! Which callers may make each call: role × scope × content type × HTTP version.

use super::protocols::{Answer, Client, Form};
use crate::access::{EXPECTED, Guarded, create_token};
use crate::serving::small_display;
use lightpath_domain::access::Role;
use lightpath_proto::v1;
use lightpath_proto::v1::display_service_client::DisplayServiceClient;
use prost::Message as _;
use std::collections::BTreeSet;
use tonic::Code;

/// Calls that concern all displays if their message is empty. Tokens for some displays are refused.
const ALL_DISPLAYS: [&str; 8] = [
    "/lightpath.v1.DatasetService/ListDatasets",
    "/lightpath.v1.JobService/GetQueue",
    "/lightpath.v1.JobService/ListJobs",
    "/lightpath.v1.JobService/PauseQueue",
    "/lightpath.v1.JobService/ResumeQueue",
    "/lightpath.v1.KernelService/ListKernels",
    "/metrics",
    "/v1/jobs",
];

/// Forms of requests that gRPC clients send.
const GRPC: [Form; 3] = [
    Form { method: "POST", content_type: Some("application/grpc") },
    Form { method: "POST", content_type: Some("application/grpc+proto") },
    Form { method: "POST", content_type: Some("application/grpc-web") },
];
/// Forms of requests that never reach a gRPC method.
const NOT_GRPC: [Form; 4] = [
    Form { method: "POST", content_type: Some("text/plain") },
    Form { method: "POST", content_type: Some("application/json") },
    Form { method: "POST", content_type: None },
    Form { method: "GET", content_type: Some("application/grpc") },
];
/// Forms of requests for routes of HTTP. Their content type decides nothing.
const HTTP: [Form; 4] = [
    Form { method: "GET", content_type: None },
    Form { method: "GET", content_type: Some("text/plain") },
    Form { method: "GET", content_type: Some("application/json") },
    Form { method: "GET", content_type: Some("application/grpc") },
];

/// A kind of caller.
#[derive(Clone, Debug)]
pub(super) struct Caller {
    /// Name of the role; `anonymous` without a token.
    role: &'static str,
    pub(super) is_scoped: bool,
    pub(super) token: Option<String>,
}

impl Caller {
    /// The refusal of a call with an empty message; `None` if the call is allowed.
    pub(super) fn refusal(&self, path: &str, roles: &str) -> Option<Code> {
        if !roles.split(' ').any(|role| role == self.role) {
            return Some(if self.role == "anonymous" { Code::Unauthenticated } else { Code::PermissionDenied });
        }
        (self.is_scoped && ALL_DISPLAYS.contains(&path)).then_some(Code::PermissionDenied)
    }

    /// Whether the caller has no token.
    pub(super) fn is_anonymous(&self) -> bool {
        self.token.is_none()
    }
}

pub(super) async fn callers(guarded: &Guarded) -> Vec<Caller> {
    let store = guarded.store().await;
    let mut callers = vec![Caller { role: "anonymous", is_scoped: false, token: None }];
    for role in Role::ALL {
        let name = format!("lab-{}", role.as_str());
        let scoped = create_token(&store, &name, role, &["lab".to_owned()], None).await;
        callers.push(Caller { role: role.as_str(), is_scoped: true, token: Some(scoped) });
        // A token for firmware or a rig is never for all displays.
        if !matches!(role, Role::Firmware | Role::Rig) {
            let token = Some(guarded.tokens[role.as_str()].clone());
            callers.push(Caller { role: role.as_str(), is_scoped: false, token });
        }
    }
    callers
}

fn is_grpc(path: &str) -> bool {
    path.matches('/').count() == 2 && path.contains('.')
}

/// The refusal in an answer; `None` if a handler answered.
pub(super) fn refusal(answer: &Answer) -> Option<Code> {
    match (answer.http, answer.grpc) {
        (401, _) | (_, Some(Code::Unauthenticated)) => Some(Code::Unauthenticated),
        (403, _) | (_, Some(Code::PermissionDenied)) => Some(Code::PermissionDenied),
        _ => None,
    }
}

/// Makes every call in every form, and checks the answers.
async fn make_every_call(caller: Caller, mut client: Client) {
    for (path, roles) in EXPECTED {
        let (right, wrong) = if is_grpc(path) { (&GRPC[..], &NOT_GRPC[..]) } else { (&HTTP[..], &[][..]) };
        let expected = caller.refusal(path, roles);
        for &form in right {
            for answer in [client.http1(path, form).await, client.http2(path, form).await] {
                assert_eq!(refusal(&answer), expected, "{path} {form:?} as {caller:?}: {answer:?}");
            }
        }
        for &form in wrong {
            for answer in [client.http1(path, form).await, client.http2(path, form).await] {
                let is_refused = answer.grpc == Some(Code::InvalidArgument) && answer.message.contains("content");
                assert!(is_refused, "{path} {form:?} as {caller:?} reached the method: {answer:?}");
            }
        }
        if !is_grpc(path) {
            let post = Form { method: "POST", content_type: Some("application/json") };
            for answer in [client.http1(path, post).await, client.http2(path, post).await] {
                assert!(answer.http >= 400, "POST {path} as {caller:?}: {answer:?}");
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_call_is_allowed_exactly_as_the_table_says() {
    // The calls of this test come faster than any client's.
    let guarded = Guarded::start_with(|config| config.calls_per_s_max = 0).await;
    let request = v1::CreateDisplayRequest { display: Some(small_display("lab")) };
    let request = crate::access::with_token(&guarded.tokens["admin"], request);
    DisplayServiceClient::new(guarded.serving.channel.clone()).create_display(request).await.unwrap();
    let calls = callers(&guarded).await.into_iter().map(|caller| {
        let client = Client::new(&guarded.serving, caller.token.clone());
        tokio::spawn(make_every_call(caller, client))
    });
    for call in calls.collect::<Vec<_>>() {
        call.await.unwrap();
    }
}

#[test]
fn the_table_has_exactly_the_methods_of_the_server() {
    let sets = [
        lightpath_proto::DESCRIPTORS,
        tonic_health::pb::FILE_DESCRIPTOR_SET,
        tonic_reflection::pb::v1::FILE_DESCRIPTOR_SET,
        tonic_reflection::pb::v1alpha::FILE_DESCRIPTOR_SET,
    ];
    let files = sets.iter().flat_map(|set| prost_types::FileDescriptorSet::decode(*set).unwrap().file);
    let methods: BTreeSet<String> = files
        .flat_map(|file| {
            let package = file.package().to_owned();
            let services =
                file.service.into_iter().map(move |service| (format!("{package}.{}", service.name()), service));
            services.flat_map(|(name, service)| {
                service.method.into_iter().map(move |method| format!("/{name}/{}", method.name()))
            })
        })
        .collect();
    let expected = EXPECTED.iter().filter(|(path, roles)| is_grpc(path) && !roles.is_empty());
    let expected: BTreeSet<String> = expected.map(|(path, _)| (*path).to_owned()).collect();
    assert_eq!(methods, expected, "every method of the server needs a line in EXPECTED with its roles");
}
