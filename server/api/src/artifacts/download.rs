//! Downloads of artifacts, piece by piece.

use crate::accounts::{OpenStream, StreamKind};
use crate::api::Api;
use crate::call::{Answers, Call};
use crate::error::ApiError;
use crate::field::Field;
use futures::stream::{self, Stream, StreamExt as _};
use lightpath_artifacts::{ArtifactReader, CHUNK_BYTES};
use lightpath_proto::v1;
use prost::bytes::Bytes;

impl Api {
    pub(crate) async fn read_artifact(
        &self,
        call: &Call,
        request: v1::ReadArtifactRequest,
    ) -> Result<Answers<v1::ReadArtifactResponse>, ApiError> {
        let v1::ReadArtifactRequest { digest, offset_bytes, limit_bytes } = request;
        let field = Field::new("digest");
        let digest = field.digest(&digest)?;
        if self.artifact_for_caller(call, &digest).await?.is_none() {
            return Err(field.missing(format!("artifact {digest}"), "use a digest from the result of a job"));
        }
        let open = self.accounts.streams.open(StreamKind::Download, &call.client)?;
        let reader = self.checked_reader(call, &digest, (offset_bytes, limit_bytes)).await?;
        let answers = chunks(reader, open).map(|chunk| chunk.map(|chunk| v1::ReadArtifactResponse { chunk }));
        Ok(answers.boxed())
    }

    /// A reader of at most `limit_bytes` (0: all) of an artifact from `offset_bytes` on. The whole file is compared
    /// with its digest first, which takes a second for each gigabyte.
    pub(crate) async fn checked_reader(
        &self,
        call: &Call,
        digest: &str,
        (offset_bytes, limit_bytes): (u64, u64),
    ) -> Result<ArtifactReader, ApiError> {
        let (artifacts, digest) = (self.artifacts.clone(), digest.to_owned());
        let open = move || artifacts.read_range_blocking(&digest, offset_bytes, limit_bytes);
        Ok(self.accounts.compute(call, CHUNK_BYTES as u64, open).await??)
    }
}

/// Stream of the reader's bytes in pieces. The stream is counted as open until its end.
pub(crate) fn chunks(
    reader: ArtifactReader,
    open: OpenStream,
) -> impl Stream<Item = Result<Bytes, ApiError>> + Send + 'static {
    stream::try_unfold((reader, open), |(mut reader, open)| async move {
        let chunk = reader.next_chunk(CHUNK_BYTES).await?;
        Ok(chunk.map(|chunk| (Bytes::from(chunk), (reader, open))))
    })
}
