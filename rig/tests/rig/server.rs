//! A server with the services that a rig needs, in this process.

use lightpath::v1::artifact_service_server::{ArtifactService, ArtifactServiceServer};
use lightpath::v1::display_service_server::{DisplayService, DisplayServiceServer};
use lightpath::v1::rig_service_server::{RigService, RigServiceServer};
use lightpath::v1::serve_rig_request::Message as Said;
use lightpath::v1::serve_rig_response::{Connected, Message, Rest, Take};
use lightpath::v1::{self, write_artifact_request::Part};
use lightpath::{Client, digest_of};
use std::collections::HashMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::sync::{mpsc, watch};
use tokio_stream::StreamExt as _;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};

type Responses = mpsc::Sender<Result<v1::ServeRigResponse, Status>>;

/// The server; clones are the same one.
#[derive(Clone)]
pub struct Server {
    inside: Arc<Mutex<Inside>>,
    /// Number of streams so far.
    streams: Arc<watch::Sender<u32>>,
    said: mpsc::UnboundedSender<Said>,
    pub url: String,
}

struct Inside {
    artifacts: HashMap<String, Vec<u8>>,
    display: v1::Display,
    rig: Option<v1::Rig>,
    responses: Option<Responses>,
    /// What every call gets instead of an answer.
    refusal: Option<Status>,
    /// What an upload gets instead of an answer.
    upload_refusal: Option<Status>,
}

impl Server {
    /// Starts a server with a display, and returns it with what rigs say.
    pub async fn start(width_px: u32, height_px: u32) -> (Self, mpsc::UnboundedReceiver<Said>) {
        let modulator = v1::Modulator { width_px, height_px, pixel_pitch_x_m: 8e-6, ..Default::default() };
        let display = v1::Display {
            name: "displays/lab".into(),
            modulator: Some(modulator),
            wavelengths_m: vec![515e-9],
            ..Default::default()
        };
        let inside = Inside {
            artifacts: HashMap::new(),
            display,
            rig: None,
            responses: None,
            refusal: None,
            upload_refusal: None,
        };
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let (said, heard) = mpsc::unbounded_channel();
        let server = Self { inside: Arc::new(Mutex::new(inside)), streams: Arc::new(watch::Sender::new(0)), said, url };
        let services = tonic::transport::Server::builder()
            .add_service(RigServiceServer::new(server.clone()))
            .add_service(ArtifactServiceServer::new(server.clone()))
            .add_service(DisplayServiceServer::new(server.clone()));
        tokio::spawn(services.serve_with_incoming(tokio_stream::wrappers::TcpListenerStream::new(listener)));
        (server, heard)
    }

    fn with<T>(&self, change: impl FnOnce(&mut Inside) -> T) -> T {
        change(&mut self.inside.lock().unwrap())
    }

    pub fn client(&self) -> Client {
        Client::connect_with_token(&self.url, "lp_token").unwrap()
    }

    /// Stores a file and returns its digest.
    pub fn store(&self, bytes: Vec<u8>) -> String {
        let digest = digest_of(&bytes);
        self.with(|inside| inside.artifacts.insert(digest.clone(), bytes));
        digest
    }

    pub fn stored(&self, digest: &str) -> Option<Vec<u8>> {
        self.with(|inside| inside.artifacts.get(digest).cloned())
    }

    pub fn rig(&self) -> v1::Rig {
        self.with(|inside| inside.rig.clone()).unwrap()
    }

    /// Waits until this many streams were opened.
    pub async fn connected(&self, streams: u32) {
        let mut seen = self.streams.subscribe();
        let wait = seen.wait_for(|count| *count >= streams);
        tokio::time::timeout(Duration::from_secs(20), wait).await.expect("the rig connects").unwrap();
    }

    pub async fn ask(&self, take: Take) {
        self.tell(Message::Take(take)).await;
    }

    pub async fn rest(&self) {
        self.tell(Message::Rest(Rest {})).await;
    }

    async fn tell(&self, message: Message) {
        let responses = self.with(|inside| inside.responses.clone()).unwrap();
        responses.send(Ok(v1::ServeRigResponse { message: Some(message) })).await.unwrap();
    }

    /// Ends the stream with a status, and answers all further calls with `refusal`.
    pub async fn cut(&self, status: Status, refusal: Option<Status>) {
        let responses = self.with(|inside| {
            inside.refusal = refusal;
            inside.responses.take()
        });
        responses.unwrap().send(Err(status)).await.unwrap();
    }

    pub fn refuse(&self, refusal: Status) {
        self.with(|inside| inside.refusal = Some(refusal));
    }

    pub fn refuse_uploads(&self, refusal: Option<Status>) {
        self.with(|inside| inside.upload_refusal = refusal);
    }

    fn answers(&self) -> Result<(), Status> {
        self.with(|inside| inside.refusal.clone()).map_or(Ok(()), Err)
    }
}

#[tonic::async_trait]
impl RigService for Server {
    type ServeRigStream = ReceiverStream<Result<v1::ServeRigResponse, Status>>;

    async fn serve_rig(
        &self,
        request: Request<Streaming<v1::ServeRigRequest>>,
    ) -> Result<Response<Self::ServeRigStream>, Status> {
        self.answers()?;
        assert_eq!(request.metadata().get("authorization").unwrap(), "Bearer lp_token");
        let mut messages = request.into_inner();
        let first = messages.message().await?.and_then(|request| request.message);
        let Some(Said::Description(rig)) = first else { return Err(Status::invalid_argument("no description")) };
        let (responses, stream) = mpsc::channel(64);
        let connected = v1::ServeRigResponse { message: Some(Message::Connected(Connected {})) };
        responses.send(Ok(connected)).await.unwrap();
        self.with(|inside| (inside.rig, inside.responses) = (Some(rig), Some(responses)));
        let said = self.said.clone();
        tokio::spawn(async move {
            while let Ok(Some(request)) = messages.message().await {
                let _ = said.send(request.message.unwrap());
            }
        });
        self.streams.send_modify(|streams| *streams += 1);
        Ok(Response::new(ReceiverStream::new(stream)))
    }

    async fn list_rigs(&self, _: Request<v1::ListRigsRequest>) -> Result<Response<v1::ListRigsResponse>, Status> {
        Err(Status::unimplemented(""))
    }
}

#[tonic::async_trait]
impl ArtifactService for Server {
    async fn get_artifact(&self, _: Request<v1::GetArtifactRequest>) -> Result<Response<v1::Artifact>, Status> {
        Err(Status::unimplemented(""))
    }

    async fn get_upload(&self, request: Request<v1::GetUploadRequest>) -> Result<Response<v1::Upload>, Status> {
        self.answers()?;
        self.with(|inside| inside.upload_refusal.clone()).map_or(Ok(()), Err)?;
        let digest = request.into_inner().digest;
        let complete = self.stored(&digest).is_some();
        Ok(Response::new(v1::Upload { digest, received_bytes: 0, complete }))
    }

    async fn write_artifact(
        &self,
        request: Request<Streaming<v1::WriteArtifactRequest>>,
    ) -> Result<Response<v1::Artifact>, Status> {
        self.answers()?;
        let (mut messages, mut bytes, mut digest) = (request.into_inner(), Vec::new(), String::new());
        while let Some(message) = messages.next().await {
            match message?.part.unwrap() {
                Part::Start(start) => digest = start.digest,
                Part::Chunk(chunk) => bytes.extend_from_slice(&chunk),
            }
        }
        assert_eq!(self.store(bytes), digest);
        Ok(Response::new(v1::Artifact { digest, ..Default::default() }))
    }

    type ReadArtifactStream = ReceiverStream<Result<v1::ReadArtifactResponse, Status>>;

    async fn read_artifact(
        &self,
        request: Request<v1::ReadArtifactRequest>,
    ) -> Result<Response<Self::ReadArtifactStream>, Status> {
        self.answers()?;
        let bytes = self.stored(&request.into_inner().digest).ok_or_else(|| Status::not_found("no such artifact"))?;
        let (sender, stream) = mpsc::channel(1);
        sender.send(Ok(v1::ReadArtifactResponse { chunk: bytes.into() })).await.unwrap();
        Ok(Response::new(ReceiverStream::new(stream)))
    }
}

#[tonic::async_trait]
impl DisplayService for Server {
    async fn get_display(&self, request: Request<v1::GetDisplayRequest>) -> Result<Response<v1::Display>, Status> {
        self.answers()?;
        let display = self.with(|inside| inside.display.clone());
        if request.into_inner().name != display.name {
            return Err(Status::not_found("the display is not declared"));
        }
        Ok(Response::new(display))
    }

    async fn create_display(&self, _: Request<v1::CreateDisplayRequest>) -> Result<Response<v1::Display>, Status> {
        Err(Status::unimplemented(""))
    }

    async fn list_displays(
        &self,
        _: Request<v1::ListDisplaysRequest>,
    ) -> Result<Response<v1::ListDisplaysResponse>, Status> {
        Err(Status::unimplemented(""))
    }

    async fn update_display(&self, _: Request<v1::UpdateDisplayRequest>) -> Result<Response<v1::Display>, Status> {
        Err(Status::unimplemented(""))
    }

    async fn delete_display(
        &self,
        _: Request<v1::DeleteDisplayRequest>,
    ) -> Result<Response<v1::DeleteDisplayResponse>, Status> {
        Err(Status::unimplemented(""))
    }

    async fn plan_propagation(
        &self,
        _: Request<v1::PlanPropagationRequest>,
    ) -> Result<Response<v1::PlanPropagationResponse>, Status> {
        Err(Status::unimplemented(""))
    }
}
