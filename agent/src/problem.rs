//! What can go wrong. Every problem leaves the kernel in use as it was.

use lightpath_manifest::{Distrust, Time};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Reason why the agent could not do a step; the messages say what each means.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum Problem {
    #[error("could not {action} {}: {source}{}", path.display(), hint(source))]
    Disk { action: &'static str, path: PathBuf, source: io::Error },
    #[error(
        "the disk of {} is full: the kernel needs {wanted_bytes} bytes more and {free_bytes} are free; \
         the agent tries again later",
        path.display()
    )]
    Full { path: PathBuf, wanted_bytes: u64, free_bytes: u64 },
    #[error("another agent works in {}: end it, or choose another directory with --directory", path.display())]
    Locked { path: PathBuf },
    /// A file with a token or with certificates cannot be used.
    #[error("{0}")]
    Setting(String),
    /// The server cannot be reached, or the connection ended before the answer.
    #[error("could not reach {server}: {reason}")]
    Unreachable { server: String, reason: String },
    #[error("the server refused the token of this device ({status}: {message}): {fix}")]
    Token {
        /// 401 or 403.
        status: u16,
        message: String,
        fix: String,
    },
    #[error("the server refused {what} ({status}: {message})")]
    Refused {
        what: &'static str,
        status: u16,
        message: String,
        /// Time after which to ask again, if the server names one.
        retry_after: Option<Duration>,
    },
    /// The server has no kernel for the optics of the settings.
    #[error(
        "display {display} has no kernel at {wanted}; {there}; learn one with `lightpath kernel learn`, or correct \
         --wavelength and --distance"
    )]
    NoKernel { display: String, wanted: String, there: String },
    /// The answer names no kernel, as that of a web server for files.
    #[error("{server} has no list of kernels, as a mirror: give the id of the kernel with --kernel")]
    NoList { server: String },
    #[error("refused the keyring of the server: {}", with_clock_hint(.0))]
    Keyring(Distrust),
    #[error("refused the keyring of the server: it has version {found}, but version {known} was accepted before")]
    OlderKeyring { found: u32, known: u32 },
    #[error("refused the manifest of the server: {}", with_clock_hint(.0))]
    Manifest(Distrust),
    #[error("refused the file of version {version}: {problem}")]
    Body { version: u32, problem: BodyProblem },
    /// The connection ended within a file. The next try continues there.
    #[error("the download of version {version} was cut after {bytes} of {size_bytes} bytes: {reason}")]
    Cut {
        version: u32,
        /// Bytes that are on the disk.
        bytes: u64,
        size_bytes: u64,
        /// Whether this poll brought some of these bytes.
        has_progress: bool,
        reason: String,
    },
    /// A slot has something that the agent did not put there.
    #[error("{} cannot be used: {found}; remove it, the directory belongs to the agent alone", path.display())]
    Foreign { path: PathBuf, found: &'static str },
    /// An answer that says nothing.
    #[error("the server said that its manifest has not changed (304), but was asked for it in any case")]
    Unasked,
    /// Whatever the server answers: it has shown no manifest that counts for longer than a manifest's life.
    #[error("the server has confirmed nothing since {issued}, the manifest expired at {expires}: {cause}")]
    Unconfirmed { issued: Time, expires: Time, cause: Box<Problem> },
    /// The bytes that passed the self-test are not those of the manifest.
    #[error(
        "the self-test {} has changed the file of version {version}, which it may only read: correct it",
        program.display()
    )]
    Changed { version: u32, program: PathBuf },
    #[error("could not start the self-test {}: {source}; put a program there, or correct --self-test", program.display())]
    SelfTestStart { program: PathBuf, source: io::Error },
    /// The disk lost what an agent of a set had fetched.
    #[error("the kernel for {wavelength} is not whole: the agent fetches it again")]
    NotReady { wavelength: String },
    #[error("the self-test refused version {version}: {reason}")]
    SelfTest { version: u32, reason: String },
}

/// What is wrong with the body of a file; the messages say what each means.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)]
pub enum BodyProblem {
    #[error("it is longer than the {size_bytes} bytes of the manifest")]
    Longer { size_bytes: u64 },
    #[error("it has {found_bytes} bytes, but the manifest says {size_bytes}")]
    Shorter { found_bytes: u64, size_bytes: u64 },
    #[error("it has the digest {found}, but the manifest says {wanted}")]
    Digest { found: String, wanted: String },
    #[error("the server sent the part \"{found}\" instead of the bytes from {first} of {size_bytes}")]
    Part {
        /// `content-range` of the answer.
        found: String,
        first: u64,
        size_bytes: u64,
    },
}

impl Problem {
    pub(crate) fn disk(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Disk { action, path: path.to_owned(), source }
    }

    /// Whether the server should hear of this: problems of the network and of access pass no report anyway. A request that
    /// the server refuses for good, such as one for a format that the version lacks, stays a problem until somebody acts.
    pub(crate) fn is_for_report(&self) -> bool {
        match self {
            Self::Disk { .. }
            | Self::Full { .. }
            | Self::Keyring(_)
            | Self::OlderKeyring { .. }
            | Self::Manifest(_)
            | Self::Body { .. }
            | Self::Foreign { .. }
            | Self::Unasked
            | Self::Unconfirmed { .. }
            | Self::Changed { .. }
            | Self::SelfTestStart { .. }
            | Self::SelfTest { .. } => true,
            Self::Refused { status, .. } => (400..500).contains(status) && *status != 429,
            Self::Locked { .. }
            | Self::NotReady { .. }
            | Self::Setting(_)
            | Self::Unreachable { .. }
            | Self::Token { .. }
            | Self::NoKernel { .. }
            | Self::NoList { .. }
            | Self::Cut { .. } => false,
        }
    }

    /// Time after which to ask again, if the server named one.
    pub(crate) fn retry_after(&self) -> Option<Duration> {
        match self {
            Self::Refused { retry_after, .. } => *retry_after,
            Self::Unconfirmed { cause, .. } => cause.retry_after(),
            _ => None,
        }
    }

    /// Whether something in a folder is at fault, while another place on the disk may do.
    pub(crate) fn is_of_folder(&self, folder: &Path) -> bool {
        match self {
            Self::Foreign { path, .. } => path.starts_with(folder),
            Self::Disk { path, source, .. } => path.starts_with(folder) && !Self::is_no_space(source),
            _ => false,
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
