//! Attackers, each of which loads the server in a way of its own until the end.

use super::hostile_files::HostileFiles;
use crate::material::{DISTANCE_M, WAVELENGTH_M, hologram, request};
use crate::stalled_streams::StalledConnection;
use crate::uploads::noise;
use futures::StreamExt as _;
use lightpath::v1::artifact_service_client::ArtifactServiceClient;
use lightpath::v1::kernel_service_client::KernelServiceClient;
use lightpath::v1::write_artifact_request::Part;
use lightpath::{Client, names, v1};
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout};
use tokio_util::sync::CancellationToken;
use tonic::transport::{Channel, Endpoint};
use tonic::{Code, Request};

/// Pause of an attacker before the next call. The attackers run on the server's own cores, and must leave it some time.
const PACE: Duration = Duration::from_millis(2);
/// Batch of the waiting job.
pub(super) const BATCH: &str = "frames";
/// Attackers, each with a token of its own.
pub(super) const ATTACKERS: [&str; 13] = [
    "bomber", "hoarder", "dripper", "follower", "painter", "chainer", "lister", "packer", "talker", "viewer", "leaver",
    "squeezer", "stranger",
];

/// The least role that allows the attack of this name.
pub(super) fn role(name: &str) -> &'static str {
    match name {
        "packer" | "talker" => "curator",
        _ => "submitter",
    }
}

/// What every attacker knows.
#[derive(Clone)]
pub(super) struct Field {
    pub(super) url: String,
    pub(super) token: String,
    /// A huge picture in a small file.
    pub(super) bomb: String,
    /// A job that waits.
    pub(super) job: String,
    pub(super) files: Arc<HostileFiles>,
    pub(super) end: CancellationToken,
}

impl Field {
    fn client(&self) -> Client {
        Client::connect_with_token(&self.url, &self.token).unwrap()
    }

    fn channel(&self) -> Channel {
        Endpoint::from_shared(self.url.clone()).unwrap().connect_lazy()
    }

    fn with_token<T>(&self, message: T) -> Request<T> {
        let mut request = Request::new(message);
        request.metadata_mut().insert("authorization", format!("Bearer {}", self.token).parse().unwrap());
        request
    }

    /// Repeats an attack from several tasks until the end.
    async fn repeat<F: Future<Output = ()> + Send + 'static>(&self, tasks: usize, attack: impl Fn(Client) -> F) {
        let mut running = JoinSet::new();
        while !self.end.is_cancelled() {
            while running.len() < tasks {
                running.spawn(attack(self.client()));
            }
            if let Some(ended) = running.join_next().await {
                ended.unwrap();
            }
            sleep(PACE).await;
        }
    }
}

/// Submits the bomb, and leaves while it is decoded.
async fn bomb(field: Field) {
    let bomb = field.bomb.clone();
    let attack = move |client: Client| {
        let mut spec = hologram("lab", &bomb, 3, 1);
        spec.target_fit = v1::optimize_hologram::Fit::Contain.into();
        async move {
            let _ = timeout(Duration::from_millis(120), client.submit_job(request(spec, ""))).await;
        }
    };
    field.repeat(8, attack).await;
}

/// Fetches a kernel in a large format, and reads one message.
async fn hoard(field: Field) {
    let mut streams = Vec::new();
    while !field.end.is_cancelled() {
        let fetch = v1::FetchKernelRequest {
            kernel: "displays/learned/kernels/515nm-50mm".to_owned(),
            version: Some(1),
            format: v1::KernelFormat::Complex64.into(),
            offset_bytes: 0,
        };
        let mut kernels = KernelServiceClient::new(field.channel());
        match kernels.fetch_kernel(field.with_token(fetch)).await {
            Ok(stream) => streams.push(stream.into_inner()),
            Err(_) => sleep(Duration::from_millis(50)).await,
        }
        if let Some(stream) = streams.last_mut() {
            let _ = timeout(Duration::from_millis(50), stream.message()).await;
        }
    }
}

/// Opens as many uploads as it can, and sends nothing.
async fn drip(field: Field) {
    let mut open = Vec::new();
    let mut number = 0_u64;
    while !field.end.is_cancelled() {
        number += 1;
        let (parts, sent) = mpsc::channel(2);
        let digest = format!("sha256-{number:064x}");
        let start = v1::WriteArtifactStart { digest, size_bytes: 1 << 20, offset_bytes: 0 };
        parts.send(v1::WriteArtifactRequest { part: Some(Part::Start(start)) }).await.unwrap();
        let stream =
            futures::stream::unfold(sent, |mut sent| async move { sent.recv().await.map(|part| (part, sent)) });
        let request = field.with_token(stream);
        let mut artifacts = ArtifactServiceClient::new(field.channel());
        open.push((parts, tokio::spawn(async move { artifacts.write_artifact(request).await.map(drop) })));
        open.retain(|(_, upload)| !upload.is_finished());
        sleep(Duration::from_millis(20)).await;
    }
}

/// Follows a waiting job with as many streams as it can.
async fn follow(field: Field) {
    let mut streams = Vec::new();
    while !field.end.is_cancelled() {
        match field.client().watch_job(v1::WatchJobRequest { name: field.job.clone() }).await {
            Ok(stream) => streams.push(stream),
            Err(_) => sleep(Duration::from_millis(50)).await,
        }
    }
}

/// Asks for calibration targets of the largest display.
async fn paint(field: Field) {
    let attack = |client: Client| async move {
        let request = v1::CreateCalibrationTargetRequest { display: names::display("wide"), picture: None };
        let _ = client.create_calibration_target(request).await;
    };
    field.repeat(6, attack).await;
}

/// Submits jobs that wait for many others.
async fn chain(field: Field) {
    let (bomb, job) = (field.bomb.clone(), field.job.clone());
    let attack = move |client: Client| {
        let waiting =
            v1::SubmitJobRequest { after: vec![job.clone(); 256], ..request(hologram("lab", &bomb, 3, 1), "") };
        async move {
            let _ = timeout(Duration::from_millis(300), client.submit_job(waiting)).await;
        }
    };
    field.repeat(4, attack).await;
}

/// Lists jobs in the most expensive ways.
async fn list(field: Field) {
    let attack = |client: Client| async move {
        let jobs = v1::ListJobsRequest {
            page_size: 1000,
            state: v1::job::State::Succeeded.into(),
            batch: BATCH.into(),
            ..Default::default()
        };
        let _ = client.list_jobs(jobs).await;
        let _ = client.get_batch(v1::GetBatchRequest { batch: BATCH.into() }).await;
    };
    field.repeat(4, attack).await;
}

/// Imports a file that is no kernel, again and again.
async fn import(field: Field, file: impl Fn(&HostileFiles) -> &Vec<u8>) {
    let artifact = field.client().upload_bytes(file(&field.files).clone()).await.unwrap();
    let attack = move |client: Client| {
        let import = v1::ImportKernelRequest {
            display: names::display("learned"),
            wavelength_m: Some(WAVELENGTH_M),
            place: Some(v1::Place::at_m(DISTANCE_M)),
            artifact: artifact.clone(),
            ..Default::default()
        };
        async move {
            let error = client.import_kernel(import).await.unwrap_err();
            assert_ne!(error.code(), Some(Code::PermissionDenied), "the attack does not happen");
        }
    };
    field.repeat(4, attack).await;
}

/// Looks at pictures that would take much if their profiles were unpacked, or if they were made as large as each other.
async fn view(field: Field) {
    let client = field.client();
    let profile = client.upload_bytes(field.files.profile.clone()).await.unwrap();
    let [row, column] = field.files.thin.clone().map(|file| client.upload_bytes(file));
    let (row, column) = (row.await.unwrap(), column.await.unwrap());
    let paths = [
        format!("/v1/artifacts/{profile}/picture"),
        format!("/v1/artifacts/{row}/picture?minus={column}&minus_fit=stretch"),
    ];
    let address = field.url.trim_start_matches("http://").to_owned();
    let mut looking = JoinSet::new();
    for path in paths.iter().cycle() {
        if field.end.is_cancelled() {
            return;
        }
        let (address, token) = (address.clone(), field.token.clone());
        let request = format!(
            "GET {path} HTTP/1.1\r\nhost: localhost\r\nauthorization: Bearer {token}\r\nconnection: close\r\n\r\n"
        );
        looking.spawn(async move {
            let Ok(mut stream) = TcpStream::connect(&address).await else { return };
            let _ = stream.write_all(request.as_bytes()).await;
            let _ = timeout(Duration::from_secs(5), stream.read_to_end(&mut Vec::new())).await;
        });
        if looking.len() >= 8 {
            looking.join_next().await;
        }
        sleep(PACE).await;
    }
}

/// Begins uploads of 8 MiB, and leaves in the middle of each.
async fn leave(field: Field) {
    let mut number = 0_u64;
    while !field.end.is_cancelled() {
        number += 1;
        let start =
            v1::WriteArtifactStart { digest: format!("sha256-{:064x}", !number), size_bytes: 8 << 20, offset_bytes: 0 };
        let chunk = noise(512 << 10, number).into();
        let parts = [Part::Start(start), Part::Chunk(chunk)].map(|part| v1::WriteArtifactRequest { part: Some(part) });
        let stream = futures::stream::iter(parts).chain(futures::stream::pending());
        let mut artifacts = ArtifactServiceClient::new(field.channel());
        let _ = timeout(Duration::from_millis(100), artifacts.write_artifact(field.with_token(stream))).await;
    }
}

/// Asks for long lists that may be compressed, and reads nothing of them.
async fn squeeze(field: Field) {
    while !field.end.is_cancelled() {
        let mut connections = Vec::new();
        for _ in 0..2 {
            let mut connection = StalledConnection::connect(&field.url, 1).await;
            connection.ask_all("/v1/jobs?pageSize=1000", Some(&field.token)).await;
            connections.push(connection);
        }
        sleep(Duration::from_secs(2)).await;
    }
}

/// Sends refused requests with long paths, without a token.
async fn knock(field: Field) {
    let address = field.url.trim_start_matches("http://").to_owned();
    let path = "x".repeat(50_000);
    while !field.end.is_cancelled() {
        let Ok(mut stream) = TcpStream::connect(&address).await else { continue };
        let request = format!("GET /{path} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n");
        let _ = stream.write_all(request.as_bytes()).await;
        let _ = timeout(Duration::from_secs(1), stream.read_to_end(&mut Vec::new())).await;
        sleep(PACE).await;
    }
}

/// The attack of the client with this name.
pub(super) async fn attack(name: &'static str, field: Field) {
    match name {
        "bomber" => bomb(field).await,
        "hoarder" => hoard(field).await,
        "dripper" => drip(field).await,
        "follower" => follow(field).await,
        "painter" => paint(field).await,
        "chainer" => chain(field).await,
        "lister" => list(field).await,
        "packer" => import(field, |files| &files.archive).await,
        "talker" => import(field, |files| &files.header).await,
        "viewer" => view(field).await,
        "leaver" => leave(field).await,
        "squeezer" => squeeze(field).await,
        _ => knock(field).await,
    }
}
