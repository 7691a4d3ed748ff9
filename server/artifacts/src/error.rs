//! Errors of the artifact folder.

use std::io;
use std::path::PathBuf;

/// A result with an [`ArtifactError`], if it names no other error.
pub type Result<T, E = ArtifactError> = std::result::Result<T, E>;

/// Why an artifact could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum ArtifactError {
    /// The digest is malformed.
    #[error("digest \"{digest}\" is malformed, but must be `sha256-` and 64 lower-case hexadecimal digits")]
    BadDigest {
        /// Digest in the request.
        digest: String,
    },
    /// No artifact with this digest is on disk.
    #[error("artifact {digest} does not exist")]
    NotFound {
        /// Digest of the artifact.
        digest: String,
    },
    /// The file's content no longer matches its digest.
    #[error("the stored bytes of artifact {digest} no longer match its digest; upload it again")]
    DataLoss {
        /// Digest of the artifact.
        digest: String,
    },
    /// A read starts past the end of the artifact.
    #[error("offset_bytes is {offset_bytes}, but must be at most the artifact's size of {size_bytes}")]
    OutOfRange {
        /// First byte of the read.
        offset_bytes: u64,
        /// Size of the artifact \[bytes\].
        size_bytes: u64,
    },
    /// A chunk of an upload does not start where the stored part ends.
    #[error("offset_bytes is {offset_bytes}, but must be 0 or the {received_bytes} bytes received so far")]
    WrongOffset {
        /// Offset in the request \[bytes\].
        offset_bytes: u64,
        /// Bytes of the upload that are stored.
        received_bytes: u64,
    },
    /// Another call is uploading the same artifact.
    #[error("artifact {digest} is being uploaded by another call; retry when that call has ended")]
    UploadBusy {
        /// Digest of the artifact.
        digest: String,
    },
    /// The upload has more or fewer bytes than announced.
    #[error("{received_bytes} bytes arrived, but size_bytes is {size_bytes}")]
    WrongSize {
        /// Bytes that arrived.
        received_bytes: u64,
        /// Bytes that were announced.
        size_bytes: u64,
    },
    /// The uploaded bytes do not match the announced digest.
    #[error("the content hashes to {found}, but digest is {digest}; upload it again from the start")]
    WrongDigest {
        /// Digest that was announced.
        digest: String,
        /// Digest of the bytes that arrived.
        found: String,
    },
    /// The disk is full.
    #[error("no space is left on the disk of the artifacts")]
    DiskFull,
    /// The rest of the disk is reserved for jobs and uploads that the server has already accepted.
    #[error(
        "the server's disk has {} MiB free, but {} MiB are reserved for accepted work; remove files from the disk",
        free_bytes >> 20,
        reserve_bytes >> 20
    )]
    DiskLow {
        /// Free space on the disk \[bytes\].
        free_bytes: u64,
        /// Space that new work must leave free \[bytes\].
        reserve_bytes: u64,
    },
    /// All artifacts together have reached their limit.
    #[error("all artifacts take {} MiB, and the limit is {} MiB; remove old jobs, or raise stored_mib_max", stored_bytes >> 20, stored_bytes_max >> 20)]
    QuotaSpent {
        /// Size of all artifacts \[bytes\].
        stored_bytes: u64,
        /// Limit on the size of all artifacts \[bytes\].
        stored_bytes_max: u64,
    },
    /// Another process uses the data folder.
    #[error(
        "{} is locked by another process, such as a server or a restore; stop that process or wait for its end, or \
         choose another folder",
        path.display()
    )]
    Locked {
        /// Path of the lock file.
        path: PathBuf,
    },
    /// A setting of the remote is wrong.
    #[error("the remote for artifacts cannot be used: {problem}")]
    BadRemote {
        /// What is wrong.
        problem: String,
    },
    /// The server of the remote does not keep what artifacts need.
    #[error("the server of the remote for artifacts is unfit: {problem}")]
    UnfitRemote {
        /// What it does wrong.
        problem: String,
    },
    /// The objects of the remote belong to another installation.
    #[error(
        "the remote holds the artifacts of installation {found}, but this data folder belongs to {kept}; correct the \
         remote's URL, or use another data folder"
    )]
    OtherRemote {
        /// Name of the installation that the data folder has kept.
        kept: String,
        /// Name of the installation in the remote.
        found: String,
    },
    /// The remote did not answer, or refused.
    #[error("the remote for artifacts could not {action}")]
    Remote {
        /// The operation that failed.
        action: &'static str,
        /// What the remote or the network said.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// Any other error of the file system.
    #[error("could not {action}")]
    Io {
        /// The operation that failed.
        action: &'static str,
        /// Error of the operating system.
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
            | Self::Locked { .. } => false,
        }
    }
}
