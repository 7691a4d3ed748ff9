//! Downloads of artifacts, piece by piece.

use crate::api::Api;
use crate::call::Answers;
use crate::error::ApiError;
use crate::field::Field;
use futures::stream::{self, Stream, StreamExt as _};
use lightpath_artifacts::ArtifactReader;
use lightpath_domain::access::Caller;
use lightpath_proto::v1;
use prost::bytes::Bytes;

impl Api {
    pub(crate) async fn read_artifact(
        &self,
        caller: &Caller,
        request: v1::ReadArtifactRequest,
    ) -> Result<Answers<v1::ReadArtifactResponse>, ApiError> {
        let v1::ReadArtifactRequest { digest, offset_bytes, limit_bytes } = request;
        let field = Field::new("digest");
        let digest = field.digest(&digest)?;
        if self.artifact_for_caller(caller, &digest).await?.is_none() {
            return Err(field.missing(format!("artifact {digest}"), "use a digest from the result of a job"));
        }
        let reader = self.artifacts.read(&digest, offset_bytes, limit_bytes).await?;
        let answers = chunks(reader).map(|chunk| chunk.map(|chunk| v1::ReadArtifactResponse { chunk }));
        Ok(answers.boxed())
    }
}

/// Stream of the reader's bytes in pieces.
pub(crate) fn chunks(reader: ArtifactReader) -> impl Stream<Item = Result<Bytes, ApiError>> + Send + 'static {
    stream::try_unfold(reader, |mut reader| async move {
        let chunk = reader.next_chunk().await?;
        Ok(chunk.map(|chunk| (Bytes::from(chunk), reader)))
    })
}
