//! Tokens, roles, scopes and TLS: who gets in, and who does not.

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
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tonic::transport::{Certificate, Channel, ClientTlsConfig, Identity};
use tonic::{Code, Request, Status};

/// Who may call what, written down a second time: a method that is missing here fails the walk below.
const LOOKS: &str = "viewer submitter curator admin";
const FETCHES: &str = "viewer submitter curator firmware admin";
const WORKS: &str = "submitter curator admin";
const DECIDES: &str = "curator admin";
const RUNS: &str = "admin";
const EVERYBODY: &str = "nobody viewer submitter curator firmware admin";
const EXPECTED: &[(&str, &str)] = &[
    ("/lightpath.v1.ArtifactService/GetArtifact", LOOKS),
    ("/lightpath.v1.ArtifactService/GetUpload", WORKS),
    ("/lightpath.v1.ArtifactService/WriteArtifact", WORKS),
    ("/lightpath.v1.ArtifactService/ReadArtifact", LOOKS),
    ("/lightpath.v1.DatasetService/CreateDataset", WORKS),
    ("/lightpath.v1.DatasetService/GetDataset", LOOKS),
    ("/lightpath.v1.DatasetService/ListDatasets", LOOKS),
    ("/lightpath.v1.DatasetService/AddPair", WORKS),
    ("/lightpath.v1.DatasetService/CreateCalibrationTarget", WORKS),
    ("/lightpath.v1.DisplayService/CreateDisplay", RUNS),
    ("/lightpath.v1.DisplayService/GetDisplay", LOOKS),
    ("/lightpath.v1.DisplayService/ListDisplays", LOOKS),
    ("/lightpath.v1.DisplayService/DeleteDisplay", RUNS),
    ("/lightpath.v1.DisplayService/PlanPropagation", LOOKS),
    ("/lightpath.v1.JobService/SubmitJob", WORKS),
    ("/lightpath.v1.JobService/GetJob", LOOKS),
    ("/lightpath.v1.JobService/ListJobs", LOOKS),
    ("/lightpath.v1.JobService/WatchJob", LOOKS),
    ("/lightpath.v1.JobService/CancelJob", WORKS),
    ("/lightpath.v1.JobService/RetryJob", WORKS),
    ("/lightpath.v1.JobService/ListJobEvents", LOOKS),
    ("/lightpath.v1.JobService/GetBatch", LOOKS),
    ("/lightpath.v1.JobService/GetQueue", LOOKS),
    ("/lightpath.v1.JobService/PauseQueue", RUNS),
    ("/lightpath.v1.JobService/ResumeQueue", RUNS),
    ("/lightpath.v1.KernelService/GetKernel", FETCHES),
    ("/lightpath.v1.KernelService/ListKernels", LOOKS),
    ("/lightpath.v1.KernelService/GetKernelVersion", FETCHES),
    ("/lightpath.v1.KernelService/ListKernelVersions", LOOKS),
    ("/lightpath.v1.KernelService/FetchKernel", FETCHES),
    ("/lightpath.v1.KernelService/WatchKernel", FETCHES),
    ("/lightpath.v1.KernelService/PromoteKernel", DECIDES),
    ("/lightpath.v1.KernelService/RollbackKernel", DECIDES),
    ("/lightpath.v1.KernelService/ListKernelMoves", LOOKS),
    ("/lightpath.v1.KernelService/ImportKernel", DECIDES),
    ("/lightpath.v1.KernelService/InterpolateKernel", WORKS),
    ("/grpc.health.v1.Health/Check", EVERYBODY),
    ("/grpc.health.v1.Health/Watch", EVERYBODY),
    ("/grpc.reflection.v1.ServerReflection/ServerReflectionInfo", LOOKS),
    ("/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", LOOKS),
    ("/grpc.reflection.v1.ServerReflection/Other", ""),
    ("/lightpath.v1.JobService/Other", ""),
    ("/lightpath.v2.JobService/GetJob", ""),
    ("/healthz", EVERYBODY),
    ("/metrics", LOOKS),
    ("/v1/jobs", LOOKS),
    ("/v1/jobs/0193", LOOKS),
    ("/v1/other", ""),
    ("/", ""),
];

/// A server that asks for tokens, and a token for every role.
pub(crate) struct Guarded {
    pub(crate) serving: Serving,
    /// `nobody` has none.
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
        let store = open(&data_dir).await;
        for role in Role::ALL {
            let displays = if role == Role::Firmware { vec!["lab".to_owned()] } else { Vec::new() };
            tokens.insert(role.as_str(), make(&store, role.as_str(), role, &displays, None).await);
        }
        store.close().await;
        let serving =
            Serving::start_in(prepared, Config { data_dir, require_tokens: true, ..Config::default() }, change);
        Self { serving: serving.await, tokens }
    }

    pub(crate) async fn store(&self) -> Store {
        open(&self.serving.config.data_dir).await
    }

    fn kernels(&self) -> KernelServiceClient<Channel> {
        KernelServiceClient::new(self.serving.channel.clone())
    }

    fn audit(&self) -> String {
        fs::read_to_string(self.serving.config.data_dir.join("audit.jsonl")).unwrap()
    }
}

async fn open(data_dir: &Path) -> Store {
    fs::create_dir_all(data_dir).unwrap();
    Store::open(&data_dir.join("lightpath.db")).await.unwrap()
}

/// A new token; `expire_ms` since 1970.
pub(crate) async fn make(store: &Store, name: &str, role: Role, displays: &[String], expire_ms: Option<i64>) -> String {
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

/// Sends an empty message to a method, or gets a path; the status, as gRPC names it.
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
        // A stream that stays open is one that was let in.
        let answer = grpc.streaming(request, path, codec).await;
        return answer.map_or_else(|status| status.code(), |_| Code::Ok);
    }
    let mut stream = TcpStream::connect(serving.address).await.unwrap();
    let authorization = token.map(|token| format!("authorization: Bearer {token}\r\n")).unwrap_or_default();
    let request = format!("GET {path} HTTP/1.1\r\nhost: x\r\n{authorization}connection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    match answer.split(' ').nth(1).unwrap() {
        "401" => Code::Unauthenticated,
        "403" => Code::PermissionDenied,
        _ => Code::Ok,
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_call_is_for_the_roles_that_it_names_and_no_other() {
    let guarded = Guarded::start().await;
    let methods = [lightpath_proto::DESCRIPTORS, tonic_health::pb::FILE_DESCRIPTOR_SET];
    let files = methods.iter().flat_map(|set| prost_types::FileDescriptorSet::decode(*set).unwrap().file);
    for file in files {
        for service in &file.service {
            for method in &service.method {
                let path = format!("/{}.{}/{}", file.package(), service.name(), method.name());
                let known = EXPECTED.iter().any(|(expected, _)| *expected == path) || path.ends_with("Health/List");
                assert!(known, "say in this test who may call {path}");
            }
        }
    }
    for (path, roles) in EXPECTED {
        for who in EVERYBODY.split(' ') {
            let code = call(&guarded.serving, path, guarded.tokens.get(who).map(String::as_str)).await;
            let is_let_in = !matches!(code, Code::Unauthenticated | Code::PermissionDenied);
            assert_eq!(is_let_in, roles.split(' ').any(|role| role == who), "{path} as {who}: {code:?}");
            if !is_let_in {
                let expected = if who == "nobody" { Code::Unauthenticated } else { Code::PermissionDenied };
                assert_eq!(code, expected, "{path} as {who}");
            }
        }
    }
    let audit = guarded.audit();
    assert!(audit.contains(r#""caller":"viewer""#) && audit.contains(r#""outcome":"PERMISSION_DENIED""#), "{audit}");
    for token in guarded.tokens.values() {
        assert!(!audit.contains(token.as_str()), "a secret is in the audit log");
    }
}

#[tokio::test]
async fn tokens_that_are_not_accepted_all_look_the_same() {
    let guarded = Guarded::start().await;
    let store = guarded.store().await;
    let expired = make(&store, "expired", Role::Admin, &[], Some(2)).await;
    let revoked = make(&store, "revoked", Role::Admin, &[], None).await;
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
            .create_token(&Caller { name: "revoked".into(), ..Caller::anybody() }, &"0".repeat(64), None, 9)
            .await
            .is_err()
    );
}

#[tokio::test]
async fn a_scoped_token_knows_its_own_displays_only() {
    let guarded = Guarded::start().await;
    let admin = &guarded.tokens["admin"];
    for id in ["lab", "other"] {
        let request = v1::CreateDisplayRequest { display: Some(small_display(id)) };
        let mut displays = DisplayServiceClient::new(guarded.serving.channel.clone());
        displays.create_display(with_token(admin, request)).await.unwrap();
    }
    let store = guarded.store().await;
    let scoped = make(&store, "lab-only", Role::Curator, &["lab".to_owned()], None).await;
    let channel = || guarded.serving.channel.clone();
    let mut displays = DisplayServiceClient::new(channel());
    let listed = displays.list_displays(with_token(&scoped, v1::ListDisplaysRequest::default())).await.unwrap();
    let names: Vec<String> = listed.into_inner().displays.into_iter().map(|display| display.name).collect();
    assert_eq!(names, ["displays/lab"]);
    let get = |name: &str| v1::GetDisplayRequest { name: name.to_owned() };
    displays.get_display(with_token(&scoped, get("displays/lab"))).await.unwrap();
    denied(displays.get_display(with_token(&scoped, get("displays/other"))).await);

    let mut jobs = JobServiceClient::new(channel());
    denied(jobs.list_jobs(with_token(&scoped, v1::ListJobsRequest::default())).await);
    let own = v1::ListJobsRequest { display: "displays/lab".into(), ..Default::default() };
    jobs.list_jobs(with_token(&scoped, own)).await.unwrap();
    denied(jobs.get_queue(with_token(&scoped, v1::GetQueueRequest {})).await);

    // Firmware fetches the kernels of its display, and those of no other.
    let fetch = |display: &str| v1::FetchKernelRequest {
        kernel: format!("displays/{display}/kernels/515nm-50mm"),
        version: 1,
        ..Default::default()
    };
    let firmware = &guarded.tokens["firmware"];
    let own = guarded.kernels().fetch_kernel(with_token(firmware, fetch("lab"))).await.map(drop);
    assert_eq!(own.unwrap_err().code(), Code::NotFound, "it may, but there is none");
    denied(guarded.kernels().fetch_kernel(with_token(firmware, fetch("other"))).await.map(drop));
}

#[tokio::test]
async fn jobs_carry_the_name_of_their_token() {
    let guarded = Guarded::start().await;
    let request = v1::CreateDisplayRequest {
        display: Some(v1::Display { simulated_bench: Some(v1::SimulatedBench::default()), ..small_display("lab") }),
    };
    let mut displays = DisplayServiceClient::new(guarded.serving.channel.clone());
    displays.create_display(with_token(&guarded.tokens["admin"], request)).await.unwrap();
    let mut jobs = JobServiceClient::new(guarded.serving.channel.clone());
    let submit = |owner: &str| v1::SubmitJobRequest { owner: owner.to_owned(), ..Default::default() };
    let submitter = &guarded.tokens["submitter"];
    let refused = jobs.submit_job(with_token(submitter, submit("somebody else"))).await.unwrap_err();
    assert_eq!(refused.code(), Code::PermissionDenied);
    // Past the owner, the missing spec is what is wrong.
    let refused = jobs.submit_job(with_token(submitter, submit("submitter"))).await.unwrap_err();
    assert_eq!(refused.code(), Code::InvalidArgument);
    let audit = guarded.audit();
    assert!(audit.contains(r#""call":"/lightpath.v1.DisplayService/CreateDisplay","outcome":"OK""#), "{audit}");
    assert!(audit.contains(r#""outcome":"INVALID_ARGUMENT""#), "{audit}");
}

#[tokio::test]
async fn others_get_in_only_with_tls_and_tokens() {
    let folder = tempfile::tempdir().unwrap();
    let config = Config { data_dir: folder.path().join("data"), compute_threads: 1, ..Config::default() };
    let start = |config: Config| async move {
        let listener = TcpListener::bind("0.0.0.0:0").await.unwrap();
        server::run(listener, config, std::future::ready(())).await
    };
    assert!(matches!(start(config.clone()).await, Err(ServeError::NoTls { .. })));
    let files = certificate(folder.path(), "localhost");
    assert!(matches!(start(with_tls(&config, &files)).await, Err(ServeError::NoTokens)));
    let half = Config { tls_key: None, ..with_tls(&config, &files) };
    assert!(matches!(start(half).await, Err(ServeError::Config(_))));
    start(Config { insecure: true, ..config.clone() }).await.unwrap();
    let store = open(&config.data_dir).await;
    make(&store, "ada", Role::Viewer, &[], None).await;
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

/// A self-signed certificate and its key, as files.
fn certificate(folder: &Path, name: &str) -> TlsFiles {
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
async fn certificates_are_checked_and_read_again_when_they_change() {
    let folder = tempfile::tempdir().unwrap();
    let files = certificate(folder.path(), "first.lab");
    let old = folder.path().join("old.pem");
    fs::copy(&files.certificate, &old).unwrap();
    let serving = Serving::start_secured(|config| *config = with_tls(config, &files)).await;
    connect(&serving, "first.lab", &old, None).await.unwrap();
    assert!(connect(&serving, "second.lab", &old, None).await.is_err(), "another name");
    let plain = Channel::from_shared(format!("http://{}", serving.address)).unwrap().connect().await;
    let plain = match plain {
        Err(_) => true,
        Ok(channel) => JobServiceClient::new(channel).list_jobs(v1::ListJobsRequest::default()).await.is_err(),
    };
    assert!(plain, "no TLS, no answer");

    certificate(folder.path(), "second.lab");
    // The server looks every ten seconds; what is waited for is that it has looked.
    let deadline = tokio::time::Instant::now() + std::time::Duration::from_secs(30);
    while connect(&serving, "second.lab", &files.certificate, None).await.is_err() {
        assert!(tokio::time::Instant::now() < deadline, "the new certificate is not used");
        tokio::time::sleep(std::time::Duration::from_millis(200)).await;
    }
    serving.stop().await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn client_certificates_are_wanted_where_an_authority_is_set() {
    let (folder, clients) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let own = certificate(clients.path(), "bench");
    let authority = Some(own.certificate.clone());
    let files = TlsFiles { client_authority: authority, ..certificate(folder.path(), "lab") };
    let serving = Serving::start_secured(|config| *config = with_tls(config, &files)).await;
    assert!(connect(&serving, "lab", &files.certificate, None).await.is_err(), "without a certificate");
    let identity = Identity::from_pem(fs::read(&own.certificate).unwrap(), fs::read(&own.key).unwrap());
    connect(&serving, "lab", &files.certificate, Some(identity)).await.unwrap();
    serving.stop().await.unwrap();
}

fn denied<T: std::fmt::Debug>(answer: Result<T, Status>) {
    assert_eq!(answer.unwrap_err().code(), Code::PermissionDenied);
}

#[test]
fn the_walk_sends_something() {
    // Every message of the API can be empty: what is refused is refused for who sends it.
    assert_eq!(v1::GetJobRequest::decode(Bytes::new()).unwrap(), v1::GetJobRequest::default());
}
