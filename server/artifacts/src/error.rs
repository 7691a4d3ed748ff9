//! Errors of the artifact folder.

use std::io;
use std::path::PathBuf;

/// A result with an [`ArtifactError`], if it names no other error.
pub type Result<T, E = ArtifactError> = std::result::Result<T, E>;

/// Why an artifact could not be written or read; the messages say what each means.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum ArtifactError {
    #[error("digest \"{digest}\" is malformed, but must be `sha256-` and 64 lower-case hexadecimal digits")]
    BadDigest { digest: String },
    #[error("artifact {digest} does not exist")]
    NotFound { digest: String },
    #[error("the stored bytes of artifact {digest} no longer match its digest; upload it again")]
    DataLoss { digest: String },
    #[error("offset_bytes is {offset_bytes}, but must be at most the artifact's size of {size_bytes}")]
    OutOfRange { offset_bytes: u64, size_bytes: u64 },
    #[error("offset_bytes is {offset_bytes}, but must be 0 or the {received_bytes} bytes received so far")]
    WrongOffset { offset_bytes: u64, received_bytes: u64 },
    #[error("artifact {digest} is being uploaded by another call; retry when that call has ended")]
    UploadBusy { digest: String },
    #[error("{received_bytes} bytes arrived, but size_bytes is {size_bytes}")]
    WrongSize { received_bytes: u64, size_bytes: u64 },
    #[error("the content hashes to {found}, but digest is {digest}; upload it again from the start")]
    WrongDigest { digest: String, found: String },
    #[error("no space is left on the disk of the artifacts")]
    DiskFull,
    #[error(
        "the server's disk has {} MiB free, but {} MiB are reserved for accepted work, and {} MiB are needed for bytes \
         that are arriving; remove files from the disk, or retry when other uploads have ended",
        free_bytes >> 20,
        reserve_bytes >> 20,
        claimed_bytes >> 20
    )]
    DiskLow { free_bytes: u64, reserve_bytes: u64, claimed_bytes: u64 },
    #[error("all artifacts and the uploads under way take {} MiB, and the limit is {} MiB; remove old jobs, or raise stored_mib_max", stored_bytes >> 20, stored_bytes_max >> 20)]
    QuotaSpent { stored_bytes: u64, stored_bytes_max: u64 },
    #[error(
        "{} is locked by another process, such as a server or a restore; stop that process or wait for its end, or \
         choose another folder",
        path.display()
    )]
    Locked {
        /// Path of the lock file.
        path: PathBuf,
    },
    #[error(
        "{} holds a part of a backup, because a restore into it did not end; run `lightpathd restore` with the same folder \
         again, or choose another folder",
        path.display()
    )]
    Unfinished { path: PathBuf },
    /// A setting of the remote is wrong.
    #[error("the remote for artifacts cannot be used: {problem}")]
    BadRemote { problem: String },
    #[error("the server of the remote for artifacts is unfit: {problem}")]
    UnfitRemote { problem: String },
    #[error(
        "the remote holds the artifacts of installation {found}, but this data folder belongs to {kept}; correct the \
         remote's URL, or use another data folder"
    )]
    OtherRemote { kept: String, found: String },
    /// The remote did not answer, or refused.
    #[error("the remote for artifacts could not {action}")]
    Remote { action: &'static str, source: Box<dyn std::error::Error + Send + Sync> },
    /// Any other error of the file system.
    #[error("could not {action}")]
    Io { action: &'static str, source: io::Error },
}

impl ArtifactError {
    pub(super) fn io(action: &'static str, error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Self::DiskFull,
            _ => Self::Io { action, source: error },
        }
    }

    pub(super) fn remote(action: &'static str, error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        Self::Remote { action, source: error.into() }
    }

    /// Whether the same call may succeed later, if necessary after an operator has made room on the disk.
    #[must_use]
    pub fn is_transient(&self) -> bool {
        match self {
            Self::DiskFull
            | Self::DiskLow { .. }
            | Self::QuotaSpent { .. }
            | Self::Io { .. }
            | Self::Remote { .. }
            | Self::UploadBusy { .. } => true,
            Self::BadDigest { .. }
            | Self::NotFound { .. }
            | Self::DataLoss { .. }
            | Self::OutOfRange { .. }
            | Self::WrongOffset { .. }
            | Self::WrongSize { .. }
            | Self::WrongDigest { .. }
            | Self::BadRemote { .. }
            | Self::UnfitRemote { .. }
            | Self::OtherRemote { .. }
            | Self::Unfinished { .. }
            | Self::Locked { .. } => false,
        }
    }
}
