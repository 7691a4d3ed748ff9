//! The artifact service.

use super::error::ApiError;
use super::field::Field;
use super::time::{now_ms, timestamp};
use super::{Api, caller, required};
use futures::stream::{self, BoxStream, Stream, StreamExt as _};
use lightpath_artifacts::{ArtifactError, ArtifactReader, UploadWriter};
use lightpath_proto::v1;
use lightpath_proto::v1::artifact_service_server::ArtifactService;
use lightpath_proto::v1::write_artifact_request::Part;
use lightpath_store::ArtifactRecord;
use prost::bytes::Bytes;
use std::time::Duration;
use tokio::time::{Instant, sleep, timeout};
use tonic::{Request, Response, Status, Streaming};

/// Largest artifact \[bytes\]: a dense kernel of an 8K display, twice over.
const ARTIFACT_BYTES_MAX: u64 = 1 << 30;
/// Largest chunk of an upload \[bytes\]: half a message, so that the rest of the message surely fits.
const CHUNK_BYTES_MAX: usize = 2 << 20;
/// An upload that brings nothing for this long has lost its client; what arrived is kept.
const UPLOAD_IDLE_MAX: Duration = Duration::from_secs(60);
/// How long an upload waits for another one of the same artifact, which makes it needless.
const UPLOAD_TURN_MAX: Duration = Duration::from_secs(60);
const UPLOAD_TURN_POLL: Duration = Duration::from_millis(50);

#[tonic::async_trait]
impl ArtifactService for Api {
    async fn get_artifact(&self, request: Request<v1::GetArtifactRequest>) -> Result<Response<v1::Artifact>, Status> {
        let field = Field::new("digest");
        let digest = field.digest(&request.into_inner().digest)?;
        // Who asks whether it is there goes on to use it.
        match self.artifact_in_use(&digest).await? {
            Some(record) => Ok(Response::new(to_wire(record))),
            None => Err(field.missing(format!("artifact {digest}"), "upload it first").into()),
        }
    }

    async fn get_upload(&self, request: Request<v1::GetUploadRequest>) -> Result<Response<v1::Upload>, Status> {
        let digest = Field::new("digest").digest(&request.into_inner().digest)?;
        let (received_bytes, complete) = match self.artifact_in_use(&digest).await? {
            Some(record) => (record.size_bytes, true),
            None => (self.artifacts.upload_received(&digest).await.map_err(ApiError::from)?, false),
        };
        Ok(Response::new(v1::Upload { digest, received_bytes, complete }))
    }

    async fn write_artifact(
        &self,
        request: Request<Streaming<v1::WriteArtifactRequest>>,
    ) -> Result<Response<v1::Artifact>, Status> {
        let mut parts = request.into_inner();
        let _permit = self.uploader()?;
        let start = match next_part(&mut parts).await? {
            Some(Part::Start(start)) => start,
            Some(Part::Chunk(_)) | None => {
                return Err(Field::new("start").invalid("is missing, but must come in the first message").into());
            }
        };
        Ok(Response::new(to_wire(self.receive(start, parts).await?)))
    }

    type ReadArtifactStream = BoxStream<'static, Result<v1::ReadArtifactResponse, Status>>;

    async fn read_artifact(
        &self,
        request: Request<v1::ReadArtifactRequest>,
    ) -> Result<Response<Self::ReadArtifactStream>, Status> {
        let v1::ReadArtifactRequest { digest, offset_bytes, limit_bytes } = request.into_inner();
        let field = Field::new("digest");
        let digest = field.digest(&digest)?;
        if self.artifact_for_caller(&digest).await?.is_none() {
            return Err(field.missing(format!("artifact {digest}"), "take a digest from a job's result").into());
        }
        let reader = self.artifacts.read(&digest, offset_bytes, limit_bytes).await.map_err(ApiError::from)?;
        let stream = chunks(reader).map(|chunk| chunk.map(|chunk| v1::ReadArtifactResponse { chunk }));
        Ok(Response::new(stream.boxed()))
    }
}

impl Api {
    /// An artifact's record, where it is stored and the caller may read it. To a token that is not for all displays, one of
    /// others does not exist; brought whole, it is the token's own, too.
    pub(super) async fn artifact_for_caller(&self, digest: &str) -> Result<Option<ArtifactRecord>, ApiError> {
        let Some(record) = self.store.artifact(digest).await? else { return Ok(None) };
        let Some(caller) = caller::scoped() else { return Ok(Some(record)) };
        let concerns = self.store.artifact_concerns(digest, &caller.name, &caller.displays).await?;
        Ok(concerns.then_some(record))
    }

    /// The same for a caller who goes on to use it.
    async fn artifact_in_use(&self, digest: &str) -> Result<Option<ArtifactRecord>, ApiError> {
        match self.artifact_for_caller(digest).await? {
            Some(_) => Ok(self.store.use_artifact(digest, now_ms()).await?),
            None => Ok(None),
        }
    }

    async fn receive(
        &self,
        start: v1::WriteArtifactStart,
        mut parts: Streaming<v1::WriteArtifactRequest>,
    ) -> Result<ArtifactRecord, ApiError> {
        let digest = Field::new("start.digest").digest(&start.digest)?;
        let size_bytes = Field::new("start.size_bytes").integer(start.size_bytes, 0..=ARTIFACT_BYTES_MAX)?;
        let mut upload = match self.turn(&digest, size_bytes, start.offset_bytes).await? {
            Turn::Stored(record) => return Ok(record),
            Turn::Ours(upload) => upload,
        };
        while upload.received_bytes() < size_bytes {
            match next_part(&mut parts).await? {
                Some(Part::Chunk(chunk)) if chunk.len() <= CHUNK_BYTES_MAX => upload.write(chunk.into()).await?,
                Some(Part::Chunk(chunk)) => {
                    let problem = format!("has {} bytes, but at most {CHUNK_BYTES_MAX} are accepted", chunk.len());
                    return Err(Field::new("chunk").invalid(problem));
                }
                Some(Part::Start(_)) => {
                    return Err(Field::new("start").invalid("comes twice, but must come in the first message only"));
                }
                None => break,
            }
        }
        let _publishing = self.artifacts.publishing().await;
        upload.finish().await?;
        Ok(self.store.record_artifact(&digest, size_bytes, &caller::name(), now_ms()).await?)
    }

    /// Waits where somebody uploads the same artifact: soon it is here, or it is our turn.
    async fn turn(&self, digest: &str, size_bytes: u64, offset_bytes: u64) -> Result<Turn, ApiError> {
        let until = Instant::now() + UPLOAD_TURN_MAX;
        loop {
            if let Some(record) = self.artifact_in_use(digest).await? {
                return Ok(Turn::Stored(record));
            }
            self.artifacts.admit(size_bytes.saturating_sub(offset_bytes))?;
            let stored_bytes_max = self.queue_limits.stored_bytes_per_owner;
            self.store.require_owner_room(&caller::name(), size_bytes, stored_bytes_max).await?;
            match self.artifacts.upload(digest, size_bytes, offset_bytes).await {
                Err(ArtifactError::UploadBusy { .. }) if Instant::now() < until => sleep(UPLOAD_TURN_POLL).await,
                upload => return Ok(Turn::Ours(upload?)),
            }
        }
    }
}

enum Turn {
    Stored(ArtifactRecord),
    Ours(UploadWriter),
}

async fn next_part(parts: &mut Streaming<v1::WriteArtifactRequest>) -> Result<Option<Part>, ApiError> {
    let message = timeout(UPLOAD_IDLE_MAX, parts.message()).await.map_err(|_| ApiError::Idle(UPLOAD_IDLE_MAX))?;
    match message.map_err(|status| ApiError::Stream(Box::new(status)))? {
        None => Ok(None),
        Some(message) => Ok(Some(required(&Field::new("part"), message.part)?)),
    }
}

/// The reader's bytes, piece by piece.
pub(super) fn chunks(reader: ArtifactReader) -> impl Stream<Item = Result<Bytes, Status>> + Send + 'static {
    stream::try_unfold(reader, |mut reader| async move {
        let chunk = reader.next_chunk().await.map_err(ApiError::from)?;
        Ok(chunk.map(|chunk| (Bytes::from(chunk), reader)))
    })
}

fn to_wire(record: ArtifactRecord) -> v1::Artifact {
    v1::Artifact {
        digest: record.digest,
        size_bytes: record.size_bytes,
        create_time: Some(timestamp(record.create_time_ms)),
    }
}
