//! What can go wrong. Every problem leaves the kernel in use as it was.

use lightpath_manifest::Distrust;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Reason why the agent could not do a step.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    /// A file of the directory cannot be read, written or removed.
    #[error("could not {action} {}: {source}{}", path.display(), hint(source))]
    Disk {
        /// What the agent wanted to do.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The disk has too little space for a kernel.
    #[error(
        "the disk of {} is full: the kernel needs {wanted_bytes} bytes more and {free_bytes} are free; \
         the agent tries again later",
        path.display()
    )]
    Full {
        /// The directory.
        path: PathBuf,
        /// Space that the kernel needs \[bytes\].
        wanted_bytes: u64,
        /// Space that is free \[bytes\].
        free_bytes: u64,
    },
    /// Another agent keeps the directory.
    #[error("another agent works in {}: end it, or choose another directory with --directory", path.display())]
    Locked {
        /// The directory.
        path: PathBuf,
    },
    /// A file with a token or with certificates cannot be used.
    #[error("{0}")]
    Setting(String),
    /// The server cannot be reached, or the connection ended before the answer.
    #[error("could not reach {server}: {reason}")]
    Unreachable {
        /// URL of the server.
        server: String,
        /// What the connection says.
        reason: String,
    },
    /// The server does not accept the token.
    #[error("the server refused the token of this device ({status}: {message}): {fix}")]
    Token {
        /// 401 or 403.
        status: u16,
        /// What the server says.
        message: String,
        /// What to do.
        fix: String,
    },
    /// The server refused a call.
    #[error("the server refused {what} ({status}: {message})")]
    Refused {
        /// What the agent asked for.
        what: &'static str,
        /// Status of HTTP.
        status: u16,
        /// What the server says.
        message: String,
        /// Time after which to ask again, if the server names one.
        retry_after: Option<Duration>,
    },
    /// The keyring of the server is not acceptable.
    #[error("refused the keyring of the server: {}", with_clock_hint(.0))]
    Keyring(Distrust),
    /// The keyring has a lower version than an earlier one.
    #[error("refused the keyring of the server: it has version {found}, but version {known} was accepted before")]
    OlderKeyring {
        /// Version of the keyring.
        found: u32,
        /// Highest version that the agent accepted.
        known: u32,
    },
    /// The manifest of the server is not acceptable.
    #[error("refused the manifest of the server: {}", with_clock_hint(.0))]
    Manifest(Distrust),
    /// The file of a version is not the one of its manifest.
    #[error("refused the file of version {version}: {problem}")]
    Body {
        /// Version of the manifest.
        version: u32,
        /// What is wrong.
        problem: BodyProblem,
    },
    /// The connection ended within a file. The next try continues there.
    #[error("the download of version {version} was cut after {bytes} of {size_bytes} bytes: {reason}")]
    Cut {
        /// Version of the manifest.
        version: u32,
        /// Bytes that are on the disk.
        bytes: u64,
        /// Size in the manifest.
        size_bytes: u64,
        /// Whether this poll brought some of these bytes.
        has_progress: bool,
        /// What the connection says.
        reason: String,
    },
    /// The device's own test cannot be started.
    #[error("could not start the self-test {}: {source}; put a program there, or correct --self-test", program.display())]
    SelfTestStart {
        /// The program.
        program: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The device's own test refused the kernel.
    #[error("the self-test refused version {version}: {reason}")]
    SelfTest {
        /// The version.
        version: u32,
        /// What the test says.
        reason: String,
    },
}

/// What is wrong with the body of a file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BodyProblem {
    /// The body is longer than the manifest says.
    #[error("it is longer than the {size_bytes} bytes of the manifest")]
    Longer {
        /// Size in the manifest.
        size_bytes: u64,
    },
    /// The body is shorter than the manifest says.
    #[error("it has {found_bytes} bytes, but the manifest says {size_bytes}")]
    Shorter {
        /// Size of the body.
        found_bytes: u64,
        /// Size in the manifest.
        size_bytes: u64,
    },
    /// The bytes are others.
    #[error("it has the digest {found}, but the manifest says {wanted}")]
    Digest {
        /// Digest of the bytes.
        found: String,
        /// Digest in the manifest.
        wanted: String,
    },
    /// The server answered with another part than the one that was asked for.
    #[error("the server sent the part \"{found}\" instead of the bytes from {first} of {size_bytes}")]
    Part {
        /// `content-range` of the answer.
        found: String,
        /// First byte that was asked for.
        first: u64,
        /// Size in the manifest.
        size_bytes: u64,
    },
}

impl Problem {
    pub(crate) fn disk(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Disk { action, path: path.to_owned(), source }
    }

    /// Whether the server should hear of this: problems of the network and of access pass no report anyway. A request that
    /// the server refuses for good, such as one for a form that the version lacks, stays a problem until somebody acts.
    pub(crate) fn is_for_report(&self) -> bool {
        match self {
            Self::Disk { .. }
            | Self::Full { .. }
            | Self::Keyring(_)
            | Self::OlderKeyring { .. }
            | Self::Manifest(_)
            | Self::Body { .. }
            | Self::SelfTestStart { .. }
            | Self::SelfTest { .. } => true,
            Self::Refused { status, .. } => (400..500).contains(status) && *status != 429,
            Self::Locked { .. }
            | Self::Setting(_)
            | Self::Unreachable { .. }
            | Self::Token { .. }
            | Self::Cut { .. } => false,
        }
    }

    /// Whether a disk has no space for more bytes, or allows no larger file.
    pub(crate) fn is_no_space(error: &io::Error) -> bool {
        use io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
        matches!(error.kind(), StorageFull | QuotaExceeded | FileTooLarge)
    }
}

fn hint(error: &io::Error) -> &'static str {
    use io::ErrorKind::{PermissionDenied, ReadOnlyFilesystem};
    match error.kind() {
        _ if Problem::is_no_space(error) => "; free some space, the agent tries again later",
        PermissionDenied | ReadOnlyFilesystem => {
            "; give the agent's user the right to write there, the agent tries again later"
        }
        _ => "",
    }
}

fn with_clock_hint(distrust: &Distrust) -> String {
    match distrust {
        Distrust::Time { .. } | Distrust::KeyTime { .. } | Distrust::KeyringTime { .. } => {
            format!("{distrust} (is the clock of this device right?)")
        }
        _ => distrust.to_string(),
    }
}
