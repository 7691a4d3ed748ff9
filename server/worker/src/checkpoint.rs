//! The envelope of a saved state: the bytes of the task, followed by one line of JSON. In this order, neither sealing
//! nor unsealing moves the bytes of the task.
//!
//! The line names the job and the lease, which makes the content unique, also among processes that share a bucket and
//! after the database was restored from a backup. Two jobs that do the same work save the same state, and each job deletes
//! its own. Without the envelope both would refer to the same file and delete it.

use crate::computer::computer;
use lightpath_domain::job::Lease;
use serde::{Deserialize, Serialize};

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Envelope {
    job: String,
    lease: String,
    computer: String,
}

/// Puts `state` into its envelope.
pub(super) fn seal(lease: &Lease, mut state: Vec<u8>) -> Result<Vec<u8>, serde_json::Error> {
    let envelope = Envelope { job: lease.job.clone(), lease: lease.lease_id.clone(), computer: computer().to_owned() };
    state.push(b'\n');
    state.extend_from_slice(&serde_json::to_vec(&envelope)?);
    Ok(state)
}

/// Returns the state in `bytes` if the same version of the program saved it for the `job` on the same kind of processor.
/// Others may compute other bytes, so their state is not used and the job starts from the beginning.
pub(super) fn unseal(job: &str, mut bytes: Vec<u8>) -> Option<Vec<u8>> {
    let end = bytes.iter().rposition(|byte| *byte == b'\n')?;
    let envelope: Envelope = serde_json::from_slice(&bytes[end + 1..]).ok()?;
    if envelope.job != job || envelope.computer != computer() {
        return None;
    }
    bytes.truncate(end);
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn state_of_another_version_or_processor_is_not_used() {
        let id = "0193f0a0-0000-7000-8000-000000000000";
        let lease = Lease { job: id.to_owned(), attempt: 1, lease_id: "lease".to_owned(), until_ms: 1 };
        let sealed = seal(&lease, b"a state\nof two lines".to_vec()).unwrap();
        assert_eq!(unseal(id, sealed.clone()).unwrap(), b"a state\nof two lines");
        let text = String::from_utf8(sealed).unwrap();
        for (own, other) in [("lightpath 0.", "lightpath 9."), (std::env::consts::ARCH, "riscv64"), (id, "0193f0a0-1")]
        {
            let changed = text.replace(own, other);
            assert_ne!(changed, text);
            assert_eq!(unseal(id, changed.into_bytes()), None, "{other}");
        }
    }
}
