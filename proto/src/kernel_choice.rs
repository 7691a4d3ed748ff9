//! Choices of kernels in messages.

use crate::v1::{KernelChoice, kernel_choice::Kind};

impl KernelChoice {
    /// The ideal kernel.
    #[must_use]
    pub fn ideal() -> Self {
        Kind::Ideal(Default::default()).into()
    }

    /// The active version.
    #[must_use]
    pub fn active() -> Self {
        Kind::Active(Default::default()).into()
    }

    /// The version with a resource name, `displays/{id}/kernels/{k}/versions/{n}`.
    #[must_use]
    pub fn version(name: impl Into<String>) -> Self {
        Kind::Version(name.into()).into()
    }
}

impl From<Kind> for KernelChoice {
    fn from(kind: Kind) -> Self {
        Self { kind: Some(kind) }
    }
}
