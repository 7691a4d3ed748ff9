//! Uploads of artifacts. An upload can continue after a broken connection.

use super::Files;
use crate::call::Call;
use crate::error::{Result, ServiceError};
use crate::field::Field;
use futures::{Stream, StreamExt as _};
use lightpath_artifacts::{ArtifactError, UploadTurn, UploadWriter};
use lightpath_store::ArtifactRecord;
use std::time::Duration;
use tokio::time::{Instant, sleep, timeout};

/// Limit on the size of an artifact \[bytes\]: twice a dense kernel of an 8K display.
const ARTIFACT_BYTES_MAX: u64 = 1 << 30;
/// Time for which an upload waits for another upload of the same artifact by the caller, which may make it unnecessary.
const UPLOAD_TURN_MAX: Duration = Duration::from_secs(60);
const UPLOAD_TURN_POLL: Duration = Duration::from_millis(50);

/// How far an upload has come.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum UploadState {
    /// The artifact is stored.
    Complete(ArtifactRecord),
    /// The server has this number of bytes of the caller.
    Received(u64),
}

impl Files {
    /// An upload that receives nothing for this time ends; the received bytes are kept.
    pub const UPLOAD_IDLE_MAX: Duration = Duration::from_secs(60);

    /// The record of an artifact that the caller is about to use, which counts as a use. Refuses one that is not stored.
    pub async fn uploaded(&self, call: &Call, field: &Field, digest: &str) -> Result<ArtifactRecord> {
        let missing = || field.missing(format!("artifact {digest}"), "upload it first");
        self.in_use(call, digest).await?.ok_or_else(missing)
    }

    /// How far the caller's upload of an artifact has come.
    pub async fn upload_state(&self, call: &Call, digest: &str) -> Result<UploadState> {
        Ok(match self.intact(call, digest).await? {
            Some(record) => UploadState::Complete(record),
            None => UploadState::Received(self.artifacts.uploads().received_bytes(digest, &call.caller.name).await?),
        })
    }

    /// Receives an artifact from `offset_bytes` on.
    pub async fn receive(
        &self,
        call: &Call,
        digest: &str,
        (size_bytes, offset_bytes): (u64, u64),
        chunks: impl Stream<Item = Result<impl Into<Vec<u8>>>> + Unpin,
    ) -> Result<ArtifactRecord> {
        let digest = Field::new("start.digest").digest(digest)?;
        call.concerns(&digest);
        let size_bytes = Field::new("start.size_bytes").integer(size_bytes, 0..=ARTIFACT_BYTES_MAX)?;
        let mut upload = match self.turn(call, &digest, size_bytes, offset_bytes).await? {
            Turn::Stored(record) => return Ok(record),
            Turn::Granted(turn) => self.admitted(call, *turn).await?,
        };
        fill(&mut upload, size_bytes, chunks).await?;
        self.publish(call, upload, size_bytes).await
    }

    /// Receives an artifact whose digest the caller does not know.
    pub async fn receive_unnamed(
        &self,
        call: &Call,
        size_bytes: u64,
        chunks: impl Stream<Item = Result<impl Into<Vec<u8>>>> + Unpin,
    ) -> Result<ArtifactRecord> {
        let size_bytes = Field::new("content-length").integer(size_bytes, 0..=ARTIFACT_BYTES_MAX)?;
        self.require_room_to_ask(call, size_bytes).await?;
        let turn = self.artifacts.uploads().turn_unnamed(&call.caller.name, size_bytes).await?;
        let mut upload = self.admitted(call, turn).await?;
        fill(&mut upload, size_bytes, chunks).await?;
        self.publish(call, upload, size_bytes).await
    }

    /// Begins an upload if the caller may store its bytes.
    async fn admitted(&self, call: &Call, turn: UploadTurn) -> Result<UploadWriter> {
        self.require_owner_room(call, turn.claim()).await?;
        Ok(turn.open().await?)
    }

    /// Ends an upload, and records the artifact.
    async fn publish(&self, call: &Call, upload: UploadWriter, size_bytes: u64) -> Result<ArtifactRecord> {
        let record = async |digest: String, seen| self.record(call, &digest, size_bytes, seen).await;
        self.artifacts.publish(upload, record).await
    }

    /// Waits while another call of the caller uploads the same artifact, until that artifact is stored or the other
    /// upload has ended.
    async fn turn(&self, call: &Call, digest: &str, size_bytes: u64, offset_bytes: u64) -> Result<Turn> {
        let until = Instant::now() + UPLOAD_TURN_MAX;
        loop {
            if let Some(record) = self.intact(call, digest).await? {
                return Ok(Turn::Stored(record));
            }
            // The bytes of a damaged artifact count already.
            let is_repair = self.readable(call, digest).await?.is_some();
            let sizes = (size_bytes, if is_repair { 0 } else { size_bytes });
            self.require_room_to_ask(call, sizes.1).await?;
            match self.artifacts.uploads().turn(digest, &call.caller.name, sizes, offset_bytes).await {
                Err(ArtifactError::UploadBusy { .. }) if Instant::now() < until => sleep(UPLOAD_TURN_POLL).await,
                turn => return Ok(Turn::Granted(Box::new(turn?))),
            }
        }
    }
}

/// Writes chunks until the upload has all of its bytes, or the chunks end.
async fn fill(
    upload: &mut UploadWriter,
    size_bytes: u64,
    mut chunks: impl Stream<Item = Result<impl Into<Vec<u8>>>> + Unpin,
) -> Result<()> {
    while upload.received_bytes() < size_bytes {
        let idle = |_| ServiceError::Idle(Files::UPLOAD_IDLE_MAX);
        match timeout(Files::UPLOAD_IDLE_MAX, chunks.next()).await.map_err(idle)? {
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
    Granted(Box<UploadTurn>),
}
