//! The audit log: changes and refused calls with their callers, one JSON object per line.
//!
//! ```text
//! DATA_DIR/audit.jsonl       {"time_ms": 1795294800000, "caller": "ada", "peer": "10.0.0.7:51234",
//!                             "call": "/lightpath.v1.KernelService/PromoteKernel", "outcome": "OK"}
//! DATA_DIR/audit.jsonl.1     the previous file, and so on
//! ```
//!
//! A line is appended when a call ends, and lines are flushed to disk once a second. The log contains the names of
//! callers, but neither secrets nor the contents of requests.

use lightpath_fail_points as fail;
use serde::Serialize;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

/// Size at which a new file is started \[bytes\]: some hundred thousand lines.
const FILE_BYTES_MAX: u64 = 64 << 20;
/// Number of older files that are kept. The limit prevents a client with many refused calls from filling the disk.
const FILES_KEPT: u32 = 9;
const NAME: &str = "audit.jsonl";

/// An entry about one call.
#[derive(Debug, Serialize)]
pub struct Entry {
    /// Name of the token; empty: no token was required, or the token is unknown.
    pub caller: String,
    /// Address of the client.
    pub peer: String,
    /// Method or path of the call.
    pub call: String,
    /// `OK`, or the code of the refusal.
    pub outcome: String,
}

#[derive(Serialize)]
struct Line<'a> {
    time_ms: u64,
    #[serde(flatten)]
    entry: &'a Entry,
}

/// The audit log of one data folder.
#[derive(Debug)]
pub struct Audit {
    folder: PathBuf,
    /// Locked only for a short append, so that no call waits for a flush.
    file: Mutex<Open>,
}

#[derive(Debug)]
struct Open {
    file: File,
    bytes: u64,
    is_flushed: bool,
}

impl Audit {
    /// Opens the log in `folder`. New lines are appended to it.
    ///
    /// # Errors
    ///
    /// If the file cannot be opened.
    pub fn open(folder: &Path) -> io::Result<Self> {
        Ok(Self { folder: folder.to_owned(), file: Mutex::new(Open::append(folder)?) })
    }

    /// Appends a line. If that fails, the error goes to the log of the server.
    pub fn write(&self, entry: Entry) {
        if let Err(error) = self.append(&entry) {
            tracing::error!(%error, ?entry, "the audit log could not be written");
        }
    }

    /// Flushes the lines appended since the last flush. Blocks.
    pub fn flush(&self) {
        let file = {
            let mut open = self.lock();
            if open.is_flushed {
                return;
            }
            open.is_flushed = true;
            open.file.try_clone()
        };
        if let Err(error) = file.and_then(|file| fail::point("audit.flush").and_then(|()| file.sync_data())) {
            tracing::error!(%error, "the audit log could not be flushed");
        }
    }

    fn append(&self, entry: &Entry) -> io::Result<()> {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let mut line = serde_json::to_vec(&Line { time_ms: since.as_millis() as u64, entry })?;
        line.push(b'\n');
        let mut open = self.lock();
        if open.bytes >= FILE_BYTES_MAX {
            self.rotate()?;
            *open = Open::append(&self.folder)?;
        }
        open.file.write_all(&line)?;
        open.bytes += line.len() as u64;
        open.is_flushed = false;
        Ok(())
    }

    /// Renames `audit.jsonl` to `.1`, `.1` to `.2` and so on, and removes the oldest file.
    fn rotate(&self) -> io::Result<()> {
        let path = |number: u32| match number {
            0 => self.folder.join(NAME),
            number => self.folder.join(format!("{NAME}.{number}")),
        };
        for number in (0..FILES_KEPT).rev() {
            if path(number).exists() {
                fail::point("audit.rename")?;
                fs::rename(path(number), path(number + 1))?;
            }
        }
        Ok(())
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Open> {
        // The state is consistent even after a panic, because a line is appended wholly or not at all.
        self.file.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Open {
    fn append(folder: &Path) -> io::Result<Self> {
        let file = File::options().create(true).append(true).open(folder.join(NAME))?;
        let bytes = file.metadata()?.len();
        Ok(Self { file, bytes, is_flushed: true })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(outcome: &str) -> Entry {
        Entry { caller: "ada".into(), peer: "[::1]:7".into(), call: "/x".into(), outcome: outcome.into() }
    }

    #[test]
    fn lines_are_appended_over_restarts_and_full_files_are_rotated() {
        let folder = tempfile::tempdir().unwrap();
        for outcome in ["OK", "PERMISSION_DENIED"] {
            let audit = Audit::open(folder.path()).unwrap();
            audit.write(entry(outcome));
            audit.flush();
        }
        let text = fs::read_to_string(folder.path().join(NAME)).unwrap();
        let lines: Vec<serde_json::Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        assert_eq!(
            (lines.len(), &lines[0]["caller"], &lines[1]["outcome"]),
            (2, &"ada".into(), &"PERMISSION_DENIED".into())
        );

        let audit = Audit::open(folder.path()).unwrap();
        for _ in 0..=FILES_KEPT + 1 {
            audit.lock().bytes = FILE_BYTES_MAX;
            audit.write(entry("OK"));
        }
        let kept = fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(kept as u32, FILES_KEPT + 1);
    }
}
