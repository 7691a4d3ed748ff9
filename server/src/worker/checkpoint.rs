//! The envelope of a saved state: one line of JSON, then the task's own bytes.
//!
//! The job and the attempt make its content unique. Two jobs that do the same thing save the same state, and each
//! deletes its own; without the envelope both would name, and delete, the same file.

use crate::job::{Job, Lease};
use serde::{Deserialize, Serialize};

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Envelope {
    job: String,
    attempt: u32,
    code_version: String,
}

/// `state` in its envelope.
pub(super) fn seal(lease: &Lease, state: &[u8]) -> Result<Vec<u8>, serde_json::Error> {
    let envelope =
        Envelope { job: lease.job.clone(), attempt: lease.attempt, code_version: env!("CARGO_PKG_VERSION").to_owned() };
    let mut bytes = serde_json::to_vec(&envelope)?;
    bytes.reserve(state.len() + 1);
    bytes.push(b'\n');
    bytes.extend_from_slice(state);
    Ok(bytes)
}

/// The state that `bytes` hold, where this version of the code saved them for `job`: another version may compute
/// other bytes, and has to start over.
pub(super) fn unseal(job: &Job, mut bytes: Vec<u8>) -> Option<Vec<u8>> {
    let end = bytes.iter().position(|byte| *byte == b'\n')?;
    let envelope: Envelope = serde_json::from_slice(&bytes[..end]).ok()?;
    if envelope.job != job.id || envelope.code_version != env!("CARGO_PKG_VERSION") {
        return None;
    }
    bytes.drain(..=end);
    Some(bytes)
}
