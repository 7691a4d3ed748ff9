//! The file forms of kernels.

use serde::{Deserialize, Serialize};

/// A file form of a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum KernelFormat {
    /// The native form, `safetensors`.
    Safetensors,
    /// The compact form: a whole smooth model in some hundred bytes.
    Compact,
    /// A `.pt` file with the tensor of the paper.
    Pt,
    /// A `.npy` file with the array of the paper.
    Npy,
    /// A `.npz` archive with the whole model, and with H and the source as arrays.
    Npz,
    /// A `.npy` file with H as complex64.
    Complex64,
    /// A `.npy` file with H as float16.
    F16,
    /// The native form with the record of the version: its number, measurements and lineage.
    Bundle,
}

impl KernelFormat {
    /// All forms.
    pub const ALL: [Self; 8] =
        [Self::Safetensors, Self::Compact, Self::Pt, Self::Npy, Self::Npz, Self::Complex64, Self::F16, Self::Bundle];

    /// Name of the form, as in requests and manifests.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Safetensors => "safetensors",
            Self::Compact => "compact",
            Self::Pt => "pt",
            Self::Npy => "npy",
            Self::Npz => "npz",
            Self::Complex64 => "complex64",
            Self::F16 => "f16",
            Self::Bundle => "bundle",
        }
    }

    /// The form with this name.
    #[must_use]
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|form| form.as_str() == name)
    }
}
