//! What can go wrong with artifacts.

use std::io;
use std::path::PathBuf;

/// Why an artifact could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum ArtifactError {
    /// Not a digest.
    #[error("digest \"{digest}\" is malformed, but must be `sha256-` and 64 lower-case hexadecimal digits")]
    BadDigest {
        /// What was given.
        digest: String,
    },
    /// Not on disk.
    #[error("artifact {digest} does not exist")]
    NotFound {
        /// The blob's digest.
        digest: String,
    },
    /// The file no longer has the content that its name promises.
    #[error("the stored bytes of artifact {digest} no longer match its digest; upload it again")]
    DataLoss {
        /// The blob's digest.
        digest: String,
    },
    /// A read past the end.
    #[error("offset_bytes is {offset_bytes}, but must be at most the artifact's size of {size_bytes}")]
    OutOfRange {
        /// First byte wanted.
        offset_bytes: u64,
        /// Size of the blob.
        size_bytes: u64,
    },
    /// An upload does not go on where it stopped.
    #[error("offset_bytes is {offset_bytes}, but must be 0 or the {received_bytes} bytes received so far")]
    WrongOffset {
        /// Where the first chunk was said to belong.
        offset_bytes: u64,
        /// What is here.
        received_bytes: u64,
    },
    /// Somebody uploads the same artifact right now.
    #[error("artifact {digest} is being uploaded by another call; retry when that has ended")]
    UploadBusy {
        /// The blob's digest.
        digest: String,
    },
    /// More or fewer bytes than announced.
    #[error("{received_bytes} bytes arrived, but size_bytes is {size_bytes}")]
    WrongSize {
        /// What arrived.
        received_bytes: u64,
        /// What was announced.
        size_bytes: u64,
    },
    /// The bytes do not hash to the digest.
    #[error("the content hashes to {found}, but digest is {digest}; upload it again from the start")]
    WrongDigest {
        /// What was announced.
        digest: String,
        /// What arrived.
        found: String,
    },
    /// No space left.
    #[error("no space is left on the disk of the artifacts")]
    DiskFull,
    /// Little space left: what there is belongs to work that was accepted before.
    #[error(
        "the server's disk has {} MiB left, and {} of them are kept for work that it has accepted; make room there",
        free_bytes >> 20,
        reserve_bytes >> 20
    )]
    DiskLow {
        /// What is free.
        free_bytes: u64,
        /// What new work must leave free.
        reserve_bytes: u64,
    },
    /// All artifacts together have as many bytes as they may.
    #[error("artifacts have {} of {} MiB that they may have; delete old jobs, or raise stored_mib_max", stored_bytes >> 20, stored_bytes_max >> 20)]
    QuotaSpent {
        /// What they have.
        stored_bytes: u64,
        /// What they may have.
        stored_bytes_max: u64,
    },
    /// Another process works in the data folder.
    #[error("{} is held by another process; stop it, or name another data folder (--data-dir)", path.display())]
    Locked {
        /// The lock file.
        path: PathBuf,
    },
    /// Anything else from the file system.
    #[error("could not {action}")]
    Io {
        /// What was tried.
        action: &'static str,
        /// What the system said.
        source: io::Error,
    },
}

impl ArtifactError {
    pub(super) fn io(action: &'static str, error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Self::DiskFull,
            _ => Self::Io { action, source: error },
        }
    }

    /// The same call may succeed later without anybody doing anything but making room.
    #[must_use]
    pub fn is_transient(&self) -> bool {
        match self {
            Self::DiskFull
            | Self::DiskLow { .. }
            | Self::QuotaSpent { .. }
            | Self::Io { .. }
            | Self::UploadBusy { .. } => true,
            Self::BadDigest { .. }
            | Self::NotFound { .. }
            | Self::DataLoss { .. }
            | Self::OutOfRange { .. }
            | Self::WrongOffset { .. }
            | Self::WrongSize { .. }
            | Self::WrongDigest { .. }
            | Self::Locked { .. } => false,
        }
    }
}
