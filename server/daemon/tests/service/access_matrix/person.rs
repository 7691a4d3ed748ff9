//! A client with a token, which calls any method by its name.

use crate::raw::Verbatim;
use crate::serving::Serving;
use lightpath_proto::v1;
use prost::Message;
use prost::bytes::Bytes;
use tonic::{Request, Status};

/// A client with a token.
#[derive(Clone)]
pub(super) struct Person<'a> {
    pub(super) serving: &'a Serving,
    pub(super) name: String,
    pub(super) token: String,
}

impl Person<'_> {
    /// Sends messages to a method such as `JobService/GetJob`, and returns the messages of its answer. Streams that
    /// follow a resource end after the first message.
    pub(super) async fn send(&self, method: &str, messages: Vec<Vec<u8>>) -> Result<Vec<Bytes>, Status> {
        let answers_max = if method.contains("/Watch") || method.ends_with("/ServeRig") { 1 } else { usize::MAX };
        self.receive(method, messages, answers_max).await
    }

    async fn receive(&self, method: &str, messages: Vec<Vec<u8>>, answers_max: usize) -> Result<Vec<Bytes>, Status> {
        let mut grpc = tonic::client::Grpc::new(self.serving.channel.clone());
        grpc.ready().await.unwrap();
        let mut request = Request::new(tokio_stream::iter(messages));
        request.metadata_mut().insert("authorization", format!("Bearer {}", self.token).parse().unwrap());
        let path = format!("/lightpath.v1.{method}").parse().unwrap();
        let mut stream = grpc.streaming(request, path, Verbatim).await?.into_inner();
        let mut answers = Vec::new();
        while answers.len() < answers_max {
            match stream.message().await? {
                Some(answer) => answers.push(answer),
                None => break,
            }
        }
        Ok(answers)
    }

    /// Sends one message to a method, and returns the only message of its answer.
    pub(super) async fn ask<A: Message + Default>(&self, method: &str, message: impl Message) -> Result<A, Status> {
        let answers = self.send(method, vec![message.encode_to_vec()]).await?;
        Ok(A::decode(answers.into_iter().next().unwrap_or_default()).unwrap())
    }

    pub(super) async fn upload(&self, bytes: &[u8]) -> String {
        let digest = lightpath_artifacts::digest_of(bytes);
        self.upload_part(&digest, bytes.len() as u64, bytes).await.unwrap();
        digest
    }

    /// Uploads `bytes` as the beginning of an artifact of `size_bytes`.
    pub(super) async fn upload_part(&self, digest: &str, size_bytes: u64, bytes: &[u8]) -> Result<(), Status> {
        use v1::write_artifact_request::Part;
        let start = v1::WriteArtifactStart { digest: digest.to_owned(), size_bytes, offset_bytes: 0 };
        let parts = [Part::Start(start), Part::Chunk(bytes.to_vec().into())];
        let parts = parts.map(|part| v1::WriteArtifactRequest { part: Some(part) }.encode_to_vec());
        self.send("ArtifactService/WriteArtifact", parts.to_vec()).await.map(drop)
    }

    pub(super) async fn submit(&self, request: v1::SubmitJobRequest) -> v1::Job {
        self.ask("JobService/SubmitJob", request).await.unwrap()
    }

    /// Waits until a job has ended.
    pub(super) async fn until_ended(&self, name: &str) -> v1::Job {
        let message = v1::WatchJobRequest { name: name.to_owned() }.encode_to_vec();
        let states = self.receive("JobService/WatchJob", vec![message], usize::MAX).await.unwrap();
        v1::Job::decode(states.into_iter().next_back().unwrap()).unwrap()
    }
}
