//! Files that conversions make.

use lightpath_domain::kernel::KernelVersion;
use lightpath_media::kernel_formats::{KernelFormat, Loss};

/// What a file was made from, and its format.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct ConversionKey {
    /// Name of the version. Bundles of versions with equal files differ.
    pub(super) version: String,
    /// Digest of the version's own file. In another database the name may be that of another version.
    pub(super) artifact: String,
    pub(super) format: KernelFormat,
}

impl ConversionKey {
    pub(super) fn new(version: &KernelVersion, format: KernelFormat) -> Self {
        let name = format!("{}/versions/{}", version.key, version.version);
        Self { version: name, artifact: version.content.artifact.clone(), format }
    }
}

/// A converted file.
#[derive(Clone, Debug, PartialEq)]
pub struct Converted {
    /// Digest of the file.
    pub digest: String,
    /// Size of the file \[bytes\].
    pub size_bytes: u64,
    /// Error that the format causes.
    pub relative_error: f64,
    /// What the format does not hold.
    pub losses: Vec<Loss>,
}
