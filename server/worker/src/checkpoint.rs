//! The envelope of a saved state: the bytes of the task, followed by one line of JSON. In this order, neither sealing
//! nor unsealing moves the bytes of the task.
//!
//! The line names the job and the lease, which makes the content unique, also among processes that share a bucket and
//! after the database was restored from a backup. Two jobs that do the same work save the same state, and each job deletes
//! its own. Without the envelope both would refer to the same file and delete it.

use lightpath_domain::job::{Job, Lease};
use serde::{Deserialize, Serialize};

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Envelope {
    job: String,
    lease: String,
    code_version: String,
}

/// Puts `state` into its envelope.
pub(super) fn seal(lease: &Lease, mut state: Vec<u8>) -> Result<Vec<u8>, serde_json::Error> {
    let envelope = Envelope {
        job: lease.job.clone(),
        lease: lease.lease_id.clone(),
        code_version: env!("CARGO_PKG_VERSION").to_owned(),
    };
    state.push(b'\n');
    state.extend_from_slice(&serde_json::to_vec(&envelope)?);
    Ok(state)
}

/// Returns the state in `bytes` if this version of the code saved it for `job`. Another version may compute other
/// bytes, so its state is not used and the job starts from the beginning.
pub(super) fn unseal(job: &Job, mut bytes: Vec<u8>) -> Option<Vec<u8>> {
    let end = bytes.iter().rposition(|byte| *byte == b'\n')?;
    let envelope: Envelope = serde_json::from_slice(&bytes[end + 1..]).ok()?;
    if envelope.job != job.id || envelope.code_version != env!("CARGO_PKG_VERSION") {
        return None;
    }
    bytes.truncate(end);
    Some(bytes)
}
