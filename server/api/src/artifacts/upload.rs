//! Uploads of artifacts. An upload can continue after a broken connection.

use super::to_wire;
use crate::accounts::StreamKind;
use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use futures::{Stream, StreamExt as _, stream};
use lightpath_artifacts::{ArtifactError, UploadWriter};
use lightpath_proto::v1;
use lightpath_proto::v1::write_artifact_request::Part;
use lightpath_store::ArtifactRecord;
use prost::bytes::Bytes;
use std::pin::pin;
use std::time::Duration;
use tokio::time::{Instant, sleep, timeout};
use tonic::Streaming;

/// Limit on the size of an artifact \[bytes\]: twice a dense kernel of an 8K display.
const ARTIFACT_BYTES_MAX: u64 = 1 << 30;
/// Limit on a chunk of an upload \[bytes\]: half of the largest message, which leaves enough for its other fields.
const CHUNK_BYTES_MAX: usize = 2 << 20;
/// An upload that receives nothing for this time ends; the received bytes are kept.
const UPLOAD_IDLE_MAX: Duration = Duration::from_secs(60);
/// Time for which an upload waits for another upload of the same artifact by the caller, which may make it unnecessary.
const UPLOAD_TURN_MAX: Duration = Duration::from_secs(60);
const UPLOAD_TURN_POLL: Duration = Duration::from_millis(50);

impl Api {
    pub(crate) async fn get_upload(&self, call: &Call, request: v1::GetUploadRequest) -> Result<v1::Upload, ApiError> {
        let digest = Field::new("digest").digest(&request.digest)?;
        let (received_bytes, complete) = match self.intact_artifact(call, &digest).await? {
            Some(record) => (record.size_bytes, true),
            None => (self.artifacts.uploads().received_bytes(&digest, &call.caller.name).await?, false),
        };
        Ok(v1::Upload { digest, received_bytes, complete })
    }

    pub(crate) async fn write_artifact(
        &self,
        call: &Call,
        mut parts: Streaming<v1::WriteArtifactRequest>,
    ) -> Result<v1::Artifact, ApiError> {
        let _open = self.accounts.streams.open(StreamKind::Upload, &call.client)?;
        let start = match next_part(&mut parts).await? {
            Some(Part::Start(start)) => start,
            Some(Part::Chunk(_)) | None => {
                return Err(Field::new("start").invalid("is missing, but must be in the first message"));
            }
        };
        let chunks = pin!(stream::try_unfold(parts, async |mut parts| {
            let chunk = next_chunk(&mut parts).await?;
            Ok(chunk.map(|chunk| (chunk, parts)))
        }));
        self.receive(call, start, chunks).await
    }

    /// Receives an artifact over HTTP.
    pub(crate) async fn write_artifact_bytes(
        &self,
        call: &Call,
        start: v1::WriteArtifactStart,
        chunks: impl Stream<Item = Result<Bytes, ApiError>> + Unpin,
    ) -> Result<v1::Artifact, ApiError> {
        let _open = self.accounts.streams.open(StreamKind::Upload, &call.client)?;
        self.receive(call, start, chunks).await
    }

    /// Receives an artifact whose digest the caller does not know.
    pub(crate) async fn write_unnamed_artifact(
        &self,
        call: &Call,
        size_bytes: u64,
        chunks: impl Stream<Item = Result<Bytes, ApiError>> + Unpin,
    ) -> Result<v1::Artifact, ApiError> {
        let _open = self.accounts.streams.open(StreamKind::Upload, &call.client)?;
        let size_bytes = Field::new("content-length").integer(size_bytes, 0..=ARTIFACT_BYTES_MAX)?;
        self.artifacts.space().admit(size_bytes)?;
        let stored_bytes_max = self.queue_limits.stored_bytes_per_owner;
        self.store.require_owner_room(&call.caller.name, size_bytes, stored_bytes_max).await?;
        let mut upload = self.artifacts.uploads().begin_unnamed(size_bytes).await?;
        fill(&mut upload, size_bytes, chunks).await?;
        self.publish(call, upload, size_bytes).await
    }

    async fn receive(
        &self,
        call: &Call,
        start: v1::WriteArtifactStart,
        chunks: impl Stream<Item = Result<Bytes, ApiError>> + Unpin,
    ) -> Result<v1::Artifact, ApiError> {
        let digest = Field::new("start.digest").digest(&start.digest)?;
        call.concerns(&digest);
        let size_bytes = Field::new("start.size_bytes").integer(start.size_bytes, 0..=ARTIFACT_BYTES_MAX)?;
        let mut upload = match self.turn(call, &digest, size_bytes, start.offset_bytes).await? {
            Turn::Stored(record) => return Ok(to_wire::artifact(record)),
            Turn::Granted(upload) => upload,
        };
        fill(&mut upload, size_bytes, chunks).await?;
        self.publish(call, upload, size_bytes).await
    }

    /// Ends an upload, and records the artifact.
    async fn publish(&self, call: &Call, upload: UploadWriter, size_bytes: u64) -> Result<v1::Artifact, ApiError> {
        let record = async |digest: String, seen| self.record(call, &digest, size_bytes, seen).await;
        Ok(to_wire::artifact(self.artifacts.publish(upload, record).await?))
    }

    /// Waits while another call of the caller uploads the same artifact, until that artifact is stored or the other
    /// upload has ended.
    async fn turn(&self, call: &Call, digest: &str, size_bytes: u64, offset_bytes: u64) -> Result<Turn, ApiError> {
        let until = Instant::now() + UPLOAD_TURN_MAX;
        loop {
            if let Some(record) = self.intact_artifact(call, digest).await? {
                return Ok(Turn::Stored(record));
            }
            // The bytes of a damaged artifact count already.
            let is_repair = self.artifact_for_caller(call, digest).await?.is_some();
            let new_bytes = if is_repair { 0 } else { size_bytes };
            self.artifacts.space().admit(new_bytes.saturating_sub(offset_bytes))?;
            let stored_bytes_max = self.queue_limits.stored_bytes_per_owner;
            self.store.require_owner_room(&call.caller.name, new_bytes, stored_bytes_max).await?;
            match self.artifacts.uploads().begin(digest, &call.caller.name, size_bytes, offset_bytes).await {
                Err(ArtifactError::UploadBusy { .. }) if Instant::now() < until => sleep(UPLOAD_TURN_POLL).await,
                upload => return Ok(Turn::Granted(upload?)),
            }
        }
    }
}

/// Writes chunks until the upload has all of its bytes, or the chunks end.
async fn fill(
    upload: &mut UploadWriter,
    size_bytes: u64,
    mut chunks: impl Stream<Item = Result<Bytes, ApiError>> + Unpin,
) -> Result<(), ApiError> {
    while upload.received_bytes() < size_bytes {
        let chunk = timeout(UPLOAD_IDLE_MAX, chunks.next()).await.map_err(|_| ApiError::Idle(UPLOAD_IDLE_MAX))?;
        match chunk {
            Some(chunk) => upload.write(chunk?.into()).await?,
            None => break,
        }
    }
    Ok(())
}

/// Result of waiting for another upload.
enum Turn {
    /// The artifact is already stored.
    Stored(ArtifactRecord),
    /// No other call of the caller uploads the artifact.
    Granted(UploadWriter),
}

/// The next chunk of an upload over gRPC.
async fn next_chunk(parts: &mut Streaming<v1::WriteArtifactRequest>) -> Result<Option<Bytes>, ApiError> {
    match next_part(parts).await? {
        None => Ok(None),
        Some(Part::Chunk(chunk)) if chunk.len() <= CHUNK_BYTES_MAX => Ok(Some(chunk)),
        Some(Part::Chunk(chunk)) => {
            let problem = format!("has {} bytes, but at most {CHUNK_BYTES_MAX} are accepted", chunk.len());
            Err(Field::new("chunk").invalid(problem))
        }
        Some(Part::Start(_)) => {
            Err(Field::new("start").invalid("is in a later message, but must be in the first message only"))
        }
    }
}

async fn next_part(parts: &mut Streaming<v1::WriteArtifactRequest>) -> Result<Option<Part>, ApiError> {
    let message = timeout(UPLOAD_IDLE_MAX, parts.message()).await.map_err(|_| ApiError::Idle(UPLOAD_IDLE_MAX))?;
    match message.map_err(|status| ApiError::Stream(Box::new(status)))? {
        None => Ok(None),
        Some(message) => Ok(Some(Field::new("part").required(message.part)?)),
    }
}
