//! The envelope of a saved state: the task's own bytes, then one line of JSON, so that neither sealing nor unsealing has to
//! move them.
//!
//! The job and the attempt make its content unique. Two jobs that do the same thing save the same state, and each
//! deletes its own; without the envelope both would name, and delete, the same file.

use lightpath_domain::job::{Job, Lease};
use serde::{Deserialize, Serialize};

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Envelope {
    job: String,
    attempt: u32,
    code_version: String,
}

/// `state` in its envelope.
pub(super) fn seal(lease: &Lease, mut state: Vec<u8>) -> Result<Vec<u8>, serde_json::Error> {
    let envelope =
        Envelope { job: lease.job.clone(), attempt: lease.attempt, code_version: env!("CARGO_PKG_VERSION").to_owned() };
    state.push(b'\n');
    state.extend_from_slice(&serde_json::to_vec(&envelope)?);
    Ok(state)
}

/// The state that `bytes` hold, where this version of the code saved them for `job`: another version may compute
/// other bytes, and has to start over.
pub(super) fn unseal(job: &Job, mut bytes: Vec<u8>) -> Option<Vec<u8>> {
    let end = bytes.iter().rposition(|byte| *byte == b'\n')?;
    let envelope: Envelope = serde_json::from_slice(&bytes[end + 1..]).ok()?;
    if envelope.job != job.id || envelope.code_version != env!("CARGO_PKG_VERSION") {
        return None;
    }
    bytes.truncate(end);
    Some(bytes)
}
