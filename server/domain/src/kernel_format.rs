//! The file forms of kernels.

crate::words! {
    /// A file form of a kernel.
    pub enum KernelFormat {
        /// The native form, `safetensors`.
        Safetensors = "safetensors",
        /// The compact form: a whole smooth model in some hundred bytes.
        Compact = "compact",
        /// A `.pt` file with the tensor of the paper.
        Pt = "pt",
        /// A `.npy` file with the array of the paper.
        Npy = "npy",
        /// A `.npz` archive with the whole model, and with H and the source as arrays.
        Npz = "npz",
        /// A `.npy` file with H as complex64.
        Complex64 = "complex64",
        /// A `.npy` file with H as float16.
        F16 = "f16",
        /// The native form with the record of the version: its number, measurements and lineage.
        Bundle = "bundle",
    }
}

impl KernelFormat {
    /// The form with this name.
    #[must_use]
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|form| form.as_str() == name)
    }
}
