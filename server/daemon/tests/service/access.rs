//! Tests of tokens, roles, scopes and TLS.

use crate::serving::{Serving, small_display};
use lightpath_api::tls::TlsFiles;
use lightpath_domain::access::{Caller, Role, Secret};
use lightpath_proto::v1;
use lightpath_proto::v1::display_service_client::DisplayServiceClient;
use lightpath_proto::v1::job_service_client::JobServiceClient;
use lightpath_proto::v1::kernel_service_client::KernelServiceClient;
use lightpath_server::config::Config;
use lightpath_server::server::{self, ServeError};
use lightpath_store::Store;
use prost::Message as _;
use prost::bytes::Bytes;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::Duration;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::sleep;
use tonic::transport::{Certificate, Channel, ClientTlsConfig, Identity};
use tonic::{Code, Request, Status};

// Roles that may call each method. This list does not use the rules of the server. A method that is missing here fails
// the test of all methods.
const MAY_READ: &str = "viewer submitter curator admin";
pub(crate) const MAY_FETCH: &str = "viewer submitter curator firmware admin";
const MAY_SUBMIT: &str = "submitter curator admin";
const MAY_CURATE: &str = "curator admin";
const MAY_ADMINISTER: &str = "admin";
const MAY_UPLOAD: &str = "submitter curator rig admin";
const ALL_CALLERS: &str = "anonymous viewer submitter curator firmware rig admin";
pub(crate) const EXPECTED: &[(&str, &str)] = &[
    ("/lightpath.v1.ArtifactService/GetArtifact", MAY_READ),
    ("/lightpath.v1.ArtifactService/GetUpload", MAY_UPLOAD),
    ("/lightpath.v1.ArtifactService/WriteArtifact", MAY_UPLOAD),
    ("/lightpath.v1.ArtifactService/ReadArtifact", "viewer submitter curator rig admin"),
    ("/lightpath.v1.DatasetService/CreateDataset", MAY_SUBMIT),
    ("/lightpath.v1.DatasetService/GetDataset", MAY_READ),
    ("/lightpath.v1.DatasetService/ListDatasets", MAY_READ),
    ("/lightpath.v1.DatasetService/ListPairs", MAY_READ),
    ("/lightpath.v1.DatasetService/AddPairs", MAY_SUBMIT),
    ("/lightpath.v1.DatasetService/DeleteDataset", MAY_CURATE),
    ("/lightpath.v1.DatasetService/CreateCalibrationTarget", MAY_SUBMIT),
    ("/lightpath.v1.DisplayService/CreateDisplay", MAY_ADMINISTER),
    ("/lightpath.v1.DisplayService/GetDisplay", "viewer submitter curator firmware rig admin"),
    ("/lightpath.v1.DisplayService/ListDisplays", MAY_READ),
    ("/lightpath.v1.DisplayService/UpdateDisplay", MAY_ADMINISTER),
    ("/lightpath.v1.DisplayService/DeleteDisplay", MAY_ADMINISTER),
    ("/lightpath.v1.DisplayService/PlanPropagation", MAY_READ),
    ("/lightpath.v1.EventService/WatchEvents", MAY_READ),
    ("/lightpath.v1.JobService/SubmitJob", MAY_SUBMIT),
    ("/lightpath.v1.JobService/SubmitJobs", MAY_SUBMIT),
    ("/lightpath.v1.JobService/EstimateJob", MAY_SUBMIT),
    ("/lightpath.v1.JobService/GetJob", MAY_READ),
    ("/lightpath.v1.JobService/ListJobs", MAY_READ),
    ("/lightpath.v1.JobService/WatchJob", MAY_READ),
    ("/lightpath.v1.JobService/CancelJob", MAY_SUBMIT),
    ("/lightpath.v1.JobService/RetryJob", MAY_SUBMIT),
    ("/lightpath.v1.JobService/ListJobEvents", MAY_READ),
    ("/lightpath.v1.JobService/GetBatch", MAY_READ),
    ("/lightpath.v1.JobService/GetQueue", MAY_READ),
    ("/lightpath.v1.JobService/PauseQueue", MAY_ADMINISTER),
    ("/lightpath.v1.JobService/ResumeQueue", MAY_ADMINISTER),
    ("/lightpath.v1.ServerService/GetServer", MAY_FETCH),
    ("/lightpath.v1.KernelService/GetKernel", MAY_FETCH),
    // An empty message asks for all displays, which no firmware token may; `manifests` lists those of one.
    ("/lightpath.v1.KernelService/ListKernels", MAY_READ),
    ("/lightpath.v1.KernelService/GetKernelVersion", MAY_FETCH),
    ("/lightpath.v1.KernelService/ListKernelVersions", MAY_FETCH),
    ("/lightpath.v1.KernelService/FetchKernel", MAY_FETCH),
    ("/lightpath.v1.KernelService/GetKernelManifest", MAY_FETCH),
    ("/lightpath.v1.KernelService/GetKeyring", MAY_FETCH),
    ("/lightpath.v1.KernelService/WatchKernel", MAY_FETCH),
    ("/lightpath.v1.KernelService/PromoteKernel", MAY_CURATE),
    ("/lightpath.v1.KernelService/CheckPromotion", MAY_READ),
    ("/lightpath.v1.KernelService/SetPromotionGate", MAY_CURATE),
    ("/lightpath.v1.KernelService/GetPromotionGate", MAY_READ),
    ("/lightpath.v1.KernelService/SetKernelAlias", MAY_CURATE),
    ("/lightpath.v1.KernelService/DeprecateKernelVersion", MAY_CURATE),
    ("/lightpath.v1.KernelService/CompareKernelVersions", MAY_READ),
    ("/lightpath.v1.KernelService/FindNearestKernels", MAY_FETCH),
    ("/lightpath.v1.KernelService/RollbackKernel", MAY_CURATE),
    ("/lightpath.v1.KernelService/ListKernelMoves", MAY_READ),
    ("/lightpath.v1.KernelService/ImportKernel", MAY_CURATE),
    ("/lightpath.v1.KernelService/InterpolateKernel", MAY_SUBMIT),
    ("/lightpath.v1.RolloutService/StartRollout", MAY_CURATE),
    ("/lightpath.v1.RolloutService/WidenRollout", MAY_CURATE),
    ("/lightpath.v1.RolloutService/CompleteRollout", MAY_CURATE),
    ("/lightpath.v1.RolloutService/HaltRollout", MAY_CURATE),
    ("/lightpath.v1.RolloutService/GetRollout", MAY_READ),
    ("/lightpath.v1.RolloutService/ListRollouts", MAY_READ),
    ("/lightpath.v1.DeviceService/ReportDevice", "curator firmware admin"),
    ("/lightpath.v1.DeviceService/ListDevices", MAY_READ),
    ("/lightpath.v1.DeviceService/SetDeviceGroup", MAY_CURATE),
    ("/lightpath.v1.DeviceService/DeleteDevice", MAY_CURATE),
    ("/lightpath.v1.RigService/ServeRig", "rig admin"),
    ("/lightpath.v1.RigService/ListRigs", MAY_READ),
    ("/lightpath.v1.PhotoService/ScorePhoto", MAY_SUBMIT),
    ("/lightpath.v1.WebhookService/CreateWebhook", MAY_ADMINISTER),
    ("/lightpath.v1.WebhookService/GetWebhook", MAY_ADMINISTER),
    ("/lightpath.v1.WebhookService/ListWebhooks", MAY_ADMINISTER),
    ("/lightpath.v1.WebhookService/UpdateWebhook", MAY_ADMINISTER),
    ("/lightpath.v1.WebhookService/TestWebhook", MAY_ADMINISTER),
    ("/lightpath.v1.WebhookService/ListWebhookDeliveries", MAY_ADMINISTER),
    ("/lightpath.v1.WebhookService/DeleteWebhook", MAY_ADMINISTER),
    ("/grpc.health.v1.Health/Check", ALL_CALLERS),
    ("/grpc.health.v1.Health/Watch", ALL_CALLERS),
    ("/grpc.health.v1.Health/List", ""),
    ("/grpc.reflection.v1.ServerReflection/ServerReflectionInfo", MAY_READ),
    ("/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", MAY_READ),
    ("/grpc.reflection.v1.ServerReflection/Other", ""),
    ("/lightpath.v1.JobService/Other", ""),
    ("/lightpath.v2.JobService/GetJob", ""),
    ("/healthz", ALL_CALLERS),
    ("/metrics", MAY_READ),
    ("/v1/jobs", MAY_READ),
    ("/v1/jobs/0193", MAY_READ),
    ("/v1/artifacts/0/content", MAY_READ),
    ("/v1/artifacts/0/picture", MAY_READ),
    ("/v1/colormaps/cyclic", MAY_READ),
    ("/v1/jobs/0/picture", MAY_READ),
    ("/v1/artifacts/0/upload", MAY_SUBMIT),
    ("/v1/artifacts", MAY_SUBMIT),
    ("/openapi.json", MAY_FETCH),
    ("/v1/keyring", MAY_FETCH),
    ("/v1/displays/lab/devices", MAY_READ),
    ("/v1/displays/lab/kernels", MAY_FETCH),
    ("/v1/webhooks", MAY_ADMINISTER),
    ("/v1/displays/lab/kernels/515nm-4mm", MAY_FETCH),
    ("/v1/displays/lab/kernels/515nm-4mm/manifest", MAY_FETCH),
    ("/v1/displays/lab/kernels/515nm-4mm/versions/1/compact/sha256-0", MAY_FETCH),
    ("/v1/jobs/0193/other", ""),
    ("/v1/other", ""),
    ("/", ALL_CALLERS),
    ("/page", ""),
];

/// A server that requires tokens, and a token for every role.
pub(crate) struct Guarded {
    pub(crate) serving: Serving,
    /// Secret of the token of each role.
    pub(crate) tokens: BTreeMap<&'static str, String>,
}

impl Guarded {
    pub(crate) async fn start() -> Self {
        Self::start_with(|_| {}).await
    }

    pub(crate) async fn start_with(change: impl FnOnce(&mut Config)) -> Self {
        let mut tokens = BTreeMap::new();
        let prepared = tempfile::tempdir().unwrap();
        let data_dir = prepared.path().join("data");
        let store = open_store(&data_dir).await;
        for role in Role::ALL {
            let displays = if matches!(role, Role::Firmware | Role::Rig) { vec!["lab".to_owned()] } else { Vec::new() };
            tokens.insert(role.as_str(), create_token(&store, role.as_str(), role, &displays, None).await);
        }
        store.close().await;
        let serving =
            Serving::start_in(prepared, Config { data_dir, require_tokens: true, ..Config::default() }, change);
        Self { serving: serving.await, tokens }
    }

    pub(crate) async fn store(&self) -> Store {
        open_store(&self.serving.config.data_dir).await
    }

    fn kernels(&self) -> KernelServiceClient<Channel> {
        KernelServiceClient::new(self.serving.channel.clone())
    }

    /// Changes and refusals of the audit log. Refusals are written once a second.
    pub(crate) async fn audit(&self) -> String {
        sleep(Duration::from_millis(1500)).await;
        let read = |name| fs::read_to_string(self.serving.config.data_dir.join(name)).unwrap();
        read("audit.jsonl") + &read("refusals.jsonl")
    }
}

async fn open_store(data_dir: &Path) -> Store {
    fs::create_dir_all(data_dir).unwrap();
    Store::open(&data_dir.join("lightpath.db")).await.unwrap()
}

/// Creates a token and returns its secret. It expires at `expire_ms` \[ms since 1970\].
pub(crate) async fn create_token(
    store: &Store,
    name: &str,
    role: Role,
    displays: &[String],
    expire_ms: Option<i64>,
) -> String {
    let secret = Secret::generate().unwrap();
    let caller = Caller { name: name.to_owned(), role, displays: displays.to_vec() };
    store.create_token(&caller, &secret.hash(), expire_ms, 1).await.unwrap();
    secret.reveal().to_owned()
}

pub(crate) fn with_token<T>(token: &str, message: T) -> Request<T> {
    let mut request = Request::new(message);
    request.metadata_mut().insert("authorization", format!("Bearer {token}").parse().unwrap());
    request
}

/// Sends an empty message to a gRPC method, or a GET request to an HTTP path. Returns the status as a gRPC code.
async fn call(serving: &Serving, path: &'static str, token: Option<&str>) -> Code {
    if path.matches('/').count() == 2 && path.contains('.') {
        let mut grpc = tonic::client::Grpc::new(serving.channel.clone());
        grpc.ready().await.unwrap();
        let codec = tonic_prost::ProstCodec::<(), ()>::default();
        let path = tonic::codegen::http::uri::PathAndQuery::from_static(path);
        let mut request = Request::new(tokio_stream::iter([()]));
        if let Some(token) = token {
            request.metadata_mut().insert("authorization", format!("Bearer {token}").parse().unwrap());
        }
        // An open stream means that the caller was accepted.
        let answer = grpc.streaming(request, path, codec).await;
        return answer.map_or_else(|status| status.code(), |_| Code::Ok);
    }
    let mut stream = TcpStream::connect(serving.address).await.unwrap();
    let authorization = token.map(|token| format!("authorization: Bearer {token}\r\n")).unwrap_or_default();
    let request = format!("GET {path} HTTP/1.1\r\nhost: localhost\r\n{authorization}connection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).await.unwrap();
    match String::from_utf8_lossy(&answer).split(' ').nth(1).unwrap() {
        "401" => Code::Unauthenticated,
        "403" => Code::PermissionDenied,
        _ => Code::Ok,
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_method_accepts_exactly_its_roles() {
    // The calls of this test come faster than any client's.
    let guarded = Guarded::start_with(|config| config.calls_per_s_max = 0).await;
    let methods = [lightpath_proto::DESCRIPTORS, tonic_health::pb::FILE_DESCRIPTOR_SET];
    let files = methods.iter().flat_map(|set| prost_types::FileDescriptorSet::decode(*set).unwrap().file);
    for file in files {
        for service in &file.service {
            for method in &service.method {
                let path = format!("/{}.{}/{}", file.package(), service.name(), method.name());
                let known = EXPECTED.iter().any(|(expected, _)| *expected == path);
                assert!(known, "{path} is missing in this test; add the roles that may call it");
            }
        }
    }
    for (path, roles) in EXPECTED {
        for caller in ALL_CALLERS.split(' ') {
            let code = call(&guarded.serving, path, guarded.tokens.get(caller).map(String::as_str)).await;
            let is_allowed = !matches!(code, Code::Unauthenticated | Code::PermissionDenied);
            assert_eq!(is_allowed, roles.split(' ').any(|role| role == caller), "{path} as {caller}: {code:?}");
            if !is_allowed {
                let expected = if caller == "anonymous" { Code::Unauthenticated } else { Code::PermissionDenied };
                assert_eq!(code, expected, "{path} as {caller}");
            }
        }
    }
    let audit = guarded.audit().await;
    assert!(audit.contains(r#""caller":"viewer""#) && audit.contains(r#""outcome":"PERMISSION_DENIED""#), "{audit}");
    for token in guarded.tokens.values() {
        assert!(!audit.contains(token.as_str()), "the audit log contains a secret");
    }
}

#[tokio::test]
async fn all_invalid_tokens_get_the_same_message() {
    let guarded = Guarded::start().await;
    let store = guarded.store().await;
    let expired = create_token(&store, "expired", Role::Admin, &[], Some(2)).await;
    let revoked = create_token(&store, "revoked", Role::Admin, &[], None).await;
    let get = |token: String| {
        let mut jobs = JobServiceClient::new(guarded.serving.channel.clone());
        async move { jobs.list_jobs(with_token(&token, v1::ListJobsRequest::default())).await }
    };
    get(revoked.clone()).await.unwrap();
    store.revoke_token("revoked", 5).await.unwrap();
    let mut messages = Vec::new();
    for token in [expired, revoked, "lightpath_0".to_owned(), "x".repeat(5000)] {
        let status = get(token.clone()).await.unwrap_err();
        assert_eq!(status.code(), Code::Unauthenticated);
        assert!(!status.message().contains(&token));
        messages.push(status.message().to_owned());
    }
    messages.dedup();
    assert_eq!(messages.len(), 1, "{messages:?}");
    assert!(
        store
            .create_token(&Caller { name: "revoked".into(), ..Caller::without_token() }, &"0".repeat(64), None, 9)
            .await
            .is_err()
    );
}

#[tokio::test]
async fn scoped_token_sees_only_its_displays() {
    let guarded = Guarded::start().await;
    let admin = &guarded.tokens["admin"];
    for id in ["lab", "other"] {
        let request = v1::CreateDisplayRequest { display: Some(small_display(id)) };
        let mut displays = DisplayServiceClient::new(guarded.serving.channel.clone());
        displays.create_display(with_token(admin, request)).await.unwrap();
    }
    let store = guarded.store().await;
    let scoped = create_token(&store, "lab-only", Role::Curator, &["lab".to_owned()], None).await;
    let channel = || guarded.serving.channel.clone();
    let mut displays = DisplayServiceClient::new(channel());
    let listed = displays.list_displays(with_token(&scoped, v1::ListDisplaysRequest::default())).await.unwrap();
    let names: Vec<String> = listed.into_inner().displays.into_iter().map(|display| display.name).collect();
    assert_eq!(names, ["displays/lab"]);
    let get = |name: &str| v1::GetDisplayRequest { name: name.to_owned() };
    displays.get_display(with_token(&scoped, get("displays/lab"))).await.unwrap();
    assert_denied(displays.get_display(with_token(&scoped, get("displays/other"))).await);

    let mut jobs = JobServiceClient::new(channel());
    assert_denied(jobs.list_jobs(with_token(&scoped, v1::ListJobsRequest::default())).await);
    let own = v1::ListJobsRequest { display: "displays/lab".into(), ..Default::default() };
    jobs.list_jobs(with_token(&scoped, own)).await.unwrap();
    assert_denied(jobs.get_queue(with_token(&scoped, v1::GetQueueRequest {})).await);

    // A firmware token can fetch the kernels of its display only.
    let fetch = |display: &str| v1::FetchKernelRequest {
        kernel: format!("displays/{display}/kernels/515nm-50mm"),
        version: Some(1),
        ..Default::default()
    };
    let firmware = &guarded.tokens["firmware"];
    let own = guarded.kernels().fetch_kernel(with_token(firmware, fetch("lab"))).await.map(drop);
    assert_eq!(own.unwrap_err().code(), Code::NotFound, "the token is accepted, but the kernel does not exist");
    assert_denied(guarded.kernels().fetch_kernel(with_token(firmware, fetch("other"))).await.map(drop));
}

#[tokio::test]
async fn jobs_are_owned_by_the_name_of_their_token() {
    let guarded = Guarded::start().await;
    let request = v1::CreateDisplayRequest {
        display: Some(v1::Display {
            bench: Some(v1::display::Bench::SimulatedBench(v1::SimulatedBench::default())),
            ..small_display("lab")
        }),
    };
    let mut displays = DisplayServiceClient::new(guarded.serving.channel.clone());
    displays.create_display(with_token(&guarded.tokens["admin"], request)).await.unwrap();
    let mut jobs = JobServiceClient::new(guarded.serving.channel.clone());
    let submit = |owner: &str| v1::SubmitJobRequest { owner: owner.to_owned(), ..Default::default() };
    let submitter = &guarded.tokens["submitter"];
    let refused = jobs.submit_job(with_token(submitter, submit("another owner"))).await.unwrap_err();
    assert_eq!(refused.code(), Code::PermissionDenied);
    // The owner is accepted, and the request is refused because its spec is missing.
    let refused = jobs.submit_job(with_token(submitter, submit("submitter"))).await.unwrap_err();
    assert_eq!(refused.code(), Code::InvalidArgument);
    let audit = guarded.audit().await;
    assert!(audit.contains(r#""object":"displays/lab","outcome":"OK""#), "{audit}");
    assert!(audit.contains(r#""outcome":"INVALID_ARGUMENT""#), "{audit}");
}

#[tokio::test]
async fn other_machines_need_tls_and_tokens() {
    let folder = tempfile::tempdir().unwrap();
    let config = Config { data_dir: folder.path().join("data"), compute_threads: 1, ..Config::default() };
    // A server says that it listens only if it serves.
    let start = |config: Config| async move {
        let listener = TcpListener::bind("0.0.0.0:0").await.unwrap();
        let (bound, mut announced) = (listener.local_addr().unwrap(), None);
        let announce = |address| {
            announced = Some(address);
            Ok(())
        };
        let ended = server::run_and_announce(listener, config, None, announce, std::future::ready(())).await;
        assert_eq!(announced, ended.is_ok().then_some(bound), "{ended:?}");
        ended
    };
    assert!(matches!(start(config.clone()).await, Err(ServeError::NoTls { .. })));
    let files = write_certificate(folder.path(), "localhost");
    assert!(matches!(start(with_tls(&config, &files)).await, Err(ServeError::NoTokens)));
    let incomplete = Config { tls_key: None, ..with_tls(&config, &files) };
    assert!(matches!(start(incomplete).await, Err(ServeError::Config(_))));
    start(Config { insecure: true, ..config.clone() }).await.unwrap();
    let store = open_store(&config.data_dir).await;
    create_token(&store, "ada", Role::Viewer, &[], None).await;
    store.close().await;
    start(with_tls(&config, &files)).await.unwrap();
    let missing = TlsFiles {
        certificate: folder.path().join("none.pem"),
        key: folder.path().join("key.pem"),
        client_authority: None,
    };
    let refused = start(with_tls(&config, &missing)).await.unwrap_err().to_string();
    assert!(refused.contains("none.pem"), "{refused}");
}

fn with_tls(config: &Config, files: &TlsFiles) -> Config {
    Config {
        tls_cert: Some(files.certificate.clone()),
        tls_key: Some(files.key.clone()),
        tls_client_ca: files.client_authority.clone(),
        ..config.clone()
    }
}

/// Writes a self-signed certificate and its key to files.
fn write_certificate(folder: &Path, name: &str) -> TlsFiles {
    let made = rcgen::generate_simple_self_signed([name.to_owned()]).unwrap();
    let files = TlsFiles { certificate: folder.join("cert.pem"), key: folder.join("key.pem"), client_authority: None };
    fs::write(&files.certificate, made.cert.pem()).unwrap();
    fs::write(&files.key, made.signing_key.serialize_pem()).unwrap();
    files
}

async fn connect(
    serving: &Serving,
    name: &str,
    authority: &Path,
    identity: Option<Identity>,
) -> Result<Channel, String> {
    let authority = Certificate::from_pem(fs::read(authority).unwrap());
    let mut tls = ClientTlsConfig::new().domain_name(name).ca_certificate(authority);
    if let Some(identity) = identity {
        tls = tls.identity(identity);
    }
    let endpoint = Channel::from_shared(format!("https://{}", serving.address)).unwrap().tls_config(tls).unwrap();
    let channel = endpoint.connect().await.map_err(|error| format!("{error:?}"))?;
    let health = tonic_health::pb::health_client::HealthClient::new(channel.clone())
        .check(tonic_health::pb::HealthCheckRequest::default())
        .await;
    health.map(|_| channel).map_err(|status| format!("{status:?}"))
}

#[tokio::test(flavor = "multi_thread")]
async fn certificates_are_checked_and_reloaded_after_a_change() {
    let folder = tempfile::tempdir().unwrap();
    let files = write_certificate(folder.path(), "first.lab");
    let old = folder.path().join("old.pem");
    fs::copy(&files.certificate, &old).unwrap();
    let serving = Serving::start_secured(|config| *config = with_tls(config, &files)).await;
    connect(&serving, "first.lab", &old, None).await.unwrap();
    assert!(connect(&serving, "second.lab", &old, None).await.is_err(), "the certificate has another name");
    let plain = Channel::from_shared(format!("http://{}", serving.address)).unwrap().connect().await;
    let plain = match plain {
        Err(_) => true,
        Ok(channel) => JobServiceClient::new(channel).list_jobs(v1::ListJobsRequest::default()).await.is_err(),
    };
    assert!(plain, "a call without TLS must fail");

    write_certificate(folder.path(), "second.lab");
    // The server checks its certificate files every ten seconds.
    let deadline = tokio::time::Instant::now() + std::time::Duration::from_secs(30);
    while connect(&serving, "second.lab", &files.certificate, None).await.is_err() {
        assert!(tokio::time::Instant::now() < deadline, "the server does not use the new certificate");
        tokio::time::sleep(std::time::Duration::from_millis(200)).await;
    }
    serving.stop().await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn client_certificates_are_required_if_an_authority_is_set() {
    let (folder, clients) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let own = write_certificate(clients.path(), "bench");
    let authority = Some(own.certificate.clone());
    let files = TlsFiles { client_authority: authority, ..write_certificate(folder.path(), "lab") };
    let serving = Serving::start_secured(|config| *config = with_tls(config, &files)).await;
    assert!(
        connect(&serving, "lab", &files.certificate, None).await.is_err(),
        "a client without a certificate must be refused"
    );
    let identity = Identity::from_pem(fs::read(&own.certificate).unwrap(), fs::read(&own.key).unwrap());
    connect(&serving, "lab", &files.certificate, Some(identity)).await.unwrap();
    serving.stop().await.unwrap();
}

/// Asserts that access was denied.
fn assert_denied<T: std::fmt::Debug>(answer: Result<T, Status>) {
    assert_eq!(answer.unwrap_err().code(), Code::PermissionDenied);
}

#[test]
fn empty_messages_are_valid_requests() {
    // Empty messages can be decoded. So the calls in the test of all methods are refused only because of their caller.
    assert_eq!(v1::GetJobRequest::decode(Bytes::new()).unwrap(), v1::GetJobRequest::default());
}
