//! Downloads of artifacts, piece by piece.

use crate::accounts::{OpenStream, StreamKind};
use crate::api::Api;
use crate::call::Answers;
use futures::stream::{self, Stream, StreamExt as _};
use lightpath_artifacts::{ArtifactReader, CHUNK_BYTES};
use lightpath_domain::access::Role;
use lightpath_proto::v1;
use lightpath_service::{Call, Field, Result};
use prost::bytes::Bytes;

impl Api {
    pub(crate) async fn read_artifact(
        &self,
        call: &Call,
        request: v1::ReadArtifactRequest,
    ) -> Result<Answers<v1::ReadArtifactResponse>> {
        let v1::ReadArtifactRequest { digest, offset_bytes, limit_bytes } = request;
        let field = Field::new("digest");
        let digest = field.digest(&digest)?;
        let limit_field = Field::new("limit_bytes");
        let limit_bytes =
            limit_field.if_set(limit_bytes, "all bytes", |bytes| limit_field.integer(bytes, 1..=u64::MAX))?;
        match call.caller.role {
            Role::Rig => self.require_shown(call, &field, &digest)?,
            _ => drop(self.service.files.existing(call, &field, &digest).await?),
        }
        let open = self.streams.open(StreamKind::Download, &call.client)?;
        let reader = self.service.files.reader(call, &digest, (offset_bytes, limit_bytes.unwrap_or(0))).await?;
        let answers =
            chunks(reader, open, CHUNK_BYTES).map(|chunk| chunk.map(|chunk| v1::ReadArtifactResponse { chunk }));
        Ok(answers.boxed())
    }

    /// Refuses a rig an artifact that it was not asked to show.
    fn require_shown(&self, call: &Call, field: &Field, digest: &str) -> Result<()> {
        if call.caller.displays.iter().any(|display| self.rigs.shows(display, digest)) {
            return Ok(());
        }
        Err(field.missing(format!("artifact {digest}"), "a rig reads the patterns that it is asked to show"))
    }
}

/// Stream of the reader's bytes in pieces of at most `chunk_bytes`. The stream is counted as open until its end.
pub(crate) fn chunks(
    reader: ArtifactReader,
    open: OpenStream,
    chunk_bytes: usize,
) -> impl Stream<Item = Result<Bytes>> + Send + 'static {
    stream::try_unfold((reader, open), move |(mut reader, open)| async move {
        let chunk = reader.next_chunk(chunk_bytes).await?;
        Ok(chunk.map(|chunk| (Bytes::from(chunk), (reader, open))))
    })
}
