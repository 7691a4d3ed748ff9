//! The audit log: what was changed, and what was refused, by whom, one JSON object per line.
//!
//! ```text
//! DATA_DIR/audit.jsonl     {"time_ms": 1795294800000, "caller": "ada", "address": "10.0.0.7",
//!                           "call": "/lightpath.v1.KernelService/PromoteKernel",
//!                           "object": "displays/lab/kernels/515nm-150mm/versions/3", "outcome": "OK"}
//! DATA_DIR/refusals.jsonl  {"time_ms": …, "caller": "", "address": "10.0.0.9", "call": "/lightpath.v1.JobService/SubmitJob",
//!                           "outcome": "UNAUTHENTICATED", "count": 812}
//! DATA_DIR/*.jsonl.1       the previous file, and so on
//! ```
//!
//! A change is appended when its call ends, even if its client has left before. Refusals are counted, and each kind of
//! refusal is a line a second: so a flood of refused calls can neither fill the disk nor push out the record of
//! changes. Lines are flushed to disk once a second. The log contains the names of callers, but neither secrets nor the
//! contents of requests.

mod journal;

use journal::Journal;
use serde::Serialize;
use std::collections::HashMap;
use std::io;
use std::mem;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

/// Limit on the different refusals a second, each of which is a line. Further ones are counted together. At this rate
/// the files hold nine hours.
const REFUSALS_MAX: usize = 100;
/// Name of the call in the line that counts further refusals.
const OTHERS: &str = "other calls";

/// A call that changed something.
#[derive(Clone, Debug, Serialize)]
pub struct Change {
    /// Name of the token; empty: no token was required.
    pub caller: String,
    /// Address of the client.
    pub address: String,
    /// Method of the call.
    pub call: String,
    /// Name of the resource that was changed or created, or digest of the artifact.
    pub object: String,
    /// `OK`, or the code of the failure.
    pub outcome: String,
}

/// A call that was refused before it changed anything.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Refusal {
    /// Name of the token; empty: no token was required, or the token is unknown.
    pub caller: String,
    /// Address of the client.
    pub address: String,
    /// Method or route of the call.
    pub call: String,
    /// Code of the refusal.
    pub outcome: String,
}

#[derive(Serialize)]
struct ChangeLine<'a> {
    time_ms: u64,
    #[serde(flatten)]
    change: &'a Change,
}

#[derive(Serialize)]
struct RefusalLine<'a> {
    time_ms: u64,
    #[serde(flatten)]
    refusal: &'a Refusal,
    count: u64,
}

/// The audit log of one data folder.
#[derive(Debug)]
pub struct Audit {
    changes: Journal,
    refusals: Journal,
    /// Refusals since the last flush. Locked only for a lookup and an addition.
    counts: Mutex<HashMap<Refusal, u64>>,
}

impl Audit {
    /// Opens the log in `folder`. New lines are appended to it.
    ///
    /// # Errors
    ///
    /// If a file cannot be opened.
    pub fn open(folder: &Path) -> io::Result<Self> {
        let (changes, refusals) = (Journal::open(folder, "audit.jsonl")?, Journal::open(folder, "refusals.jsonl")?);
        Ok(Self { changes, refusals, counts: Mutex::default() })
    }

    /// Appends a line about a change. If that fails, the error goes to the log of the server.
    pub fn change(&self, change: &Change) {
        let written = line(&ChangeLine { time_ms: now_ms(), change }).and_then(|line| self.changes.append(&line));
        if let Err(error) = written {
            tracing::error!(%error, ?change, "the audit log could not be written");
        }
    }

    /// Counts a refusal. [`Self::flush`] writes the counts.
    pub fn refusal(&self, refusal: Refusal) {
        let mut counts = self.counts.lock().unwrap_or_else(PoisonError::into_inner);
        let known = counts.contains_key(&refusal) || counts.len() < REFUSALS_MAX;
        let others =
            || Refusal { caller: String::new(), address: String::new(), call: OTHERS.into(), ..refusal.clone() };
        let key = if known { refusal } else { others() };
        *counts.entry(key).or_default() += 1;
    }

    /// Writes the counted refusals, and flushes all lines since the last flush to disk. Blocks.
    pub fn flush(&self) {
        let counts = mem::take(&mut *self.counts.lock().unwrap_or_else(PoisonError::into_inner));
        let time_ms = now_ms();
        let lines: io::Result<Vec<Vec<u8>>> =
            counts.iter().map(|(refusal, &count)| line(&RefusalLine { time_ms, refusal, count })).collect();
        let written =
            lines.and_then(|lines| if lines.is_empty() { Ok(()) } else { self.refusals.append(&lines.concat()) });
        for result in [written, self.changes.flush(), self.refusals.flush()] {
            if let Err(error) = result {
                tracing::error!(%error, "the audit log could not be flushed");
            }
        }
    }
}

fn line(entry: &impl Serialize) -> io::Result<Vec<u8>> {
    let mut line = serde_json::to_vec(entry)?;
    line.push(b'\n');
    Ok(line)
}

fn now_ms() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_millis() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;
    use std::fs;

    fn lines(folder: &Path, name: &str) -> Vec<Value> {
        fs::read_to_string(folder.join(name)).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    fn refusal(call: &str) -> Refusal {
        Refusal { caller: "eve".into(), address: "::1".into(), call: call.into(), outcome: "PERMISSION_DENIED".into() }
    }

    #[test]
    fn changes_are_appended_over_restarts() {
        let folder = tempfile::tempdir().unwrap();
        for object in ["displays/a", "displays/b"] {
            let audit = Audit::open(folder.path()).unwrap();
            let change = Change {
                caller: "ada".into(),
                address: "::1".into(),
                call: "/x".into(),
                object: object.into(),
                outcome: "OK".into(),
            };
            audit.change(&change);
            audit.flush();
        }
        let lines = lines(folder.path(), "audit.jsonl");
        let objects: Vec<_> = lines.iter().map(|line| (&line["caller"], &line["object"])).collect();
        assert_eq!(objects, [(&"ada".into(), &"displays/a".into()), (&"ada".into(), &"displays/b".into())]);
    }

    #[test]
    fn a_flood_of_refusals_is_a_few_lines() {
        let folder = tempfile::tempdir().unwrap();
        let audit = Audit::open(folder.path()).unwrap();
        for n in 0..10_000 {
            audit.refusal(refusal("/same"));
            audit.refusal(refusal(&format!("/{n}")));
        }
        audit.flush();
        audit.flush();
        let lines = lines(folder.path(), "refusals.jsonl");
        assert_eq!(lines.len(), REFUSALS_MAX + 1);
        let count = |call: &str| lines.iter().find(|line| line["call"] == call).unwrap()["count"].as_u64().unwrap();
        assert_eq!((count("/same"), count(OTHERS)), (10_000, 10_000 - (REFUSALS_MAX as u64 - 1)));
        assert!(fs::read_to_string(folder.path().join("audit.jsonl")).unwrap().is_empty());
    }
}
