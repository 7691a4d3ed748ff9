//! Uploads of artifacts. An upload can continue after a broken connection.

use super::to_wire;
use crate::accounts::StreamKind;
use crate::api::Api;
use futures::stream;
use lightpath_proto::v1;
use lightpath_proto::v1::write_artifact_request::Part;
use lightpath_service::{Call, Field, Files, Result, ServiceError, UploadState};
use prost::bytes::Bytes;
use std::pin::pin;
use tokio::time::timeout;
use tonic::Streaming;

/// Limit on a chunk of an upload \[bytes\]: half of the largest message, which leaves enough for its other fields.
const CHUNK_BYTES_MAX: usize = 2 << 20;

impl Api {
    pub(crate) async fn get_upload(&self, call: &Call, request: v1::GetUploadRequest) -> Result<v1::Upload> {
        let digest = Field::new("digest").digest(&request.digest)?;
        let (received_bytes, complete) = match self.service.files.upload_state(call, &digest).await? {
            UploadState::Complete(record) => (record.size_bytes, true),
            UploadState::Received(bytes) => (bytes, false),
        };
        Ok(v1::Upload { digest, received_bytes, complete })
    }

    pub(crate) async fn write_artifact(
        &self,
        call: &Call,
        mut parts: Streaming<v1::WriteArtifactRequest>,
    ) -> Result<v1::Artifact> {
        let _open = self.streams.open(StreamKind::Upload, &call.client)?;
        let start = match next_part(&mut parts).await? {
            Some(Part::Start(start)) => start,
            Some(Part::Chunk(_)) | None => {
                return Err(Field::new("start").but("is missing", "must be in the first message"));
            }
        };
        let chunks = pin!(stream::try_unfold(parts, async |mut parts| {
            let chunk = next_chunk(&mut parts).await?;
            Ok(chunk.map(|chunk| (chunk, parts)))
        }));
        let v1::WriteArtifactStart { digest, size_bytes, offset_bytes } = start;
        let record = self.service.files.receive(call, &digest, (size_bytes, offset_bytes), chunks).await?;
        Ok(to_wire::artifact(record))
    }
}

/// The next chunk of an upload over gRPC.
async fn next_chunk(parts: &mut Streaming<v1::WriteArtifactRequest>) -> Result<Option<Bytes>> {
    match next_part(parts).await? {
        None => Ok(None),
        Some(Part::Chunk(chunk)) if chunk.len() <= CHUNK_BYTES_MAX => Ok(Some(chunk)),
        Some(Part::Chunk(chunk)) => {
            let allowed = format!("at most {CHUNK_BYTES_MAX} are accepted");
            Err(Field::new("chunk").but(format!("has {} bytes", chunk.len()), allowed))
        }
        Some(Part::Start(_)) => {
            Err(Field::new("start").but("is in a later message", "must be in the first message only"))
        }
    }
}

async fn next_part(parts: &mut Streaming<v1::WriteArtifactRequest>) -> Result<Option<Part>> {
    let message = timeout(Files::UPLOAD_IDLE_MAX, parts.message()).await;
    let message = message.map_err(|_| ServiceError::Idle(Files::UPLOAD_IDLE_MAX))?;
    match message.map_err(|status| ServiceError::Stream(Box::new(status)))? {
        None => Ok(None),
        Some(message) => Ok(Some(Field::new("part").required(message.part)?)),
    }
}
