//! Errors of reading and writing kernels in other forms.

use crate::kernel_file::KernelFileError;

/// Reason why a kernel could not be read from another form, or written to it.
#[derive(Debug, thiserror::Error)]
pub enum KernelFormatError {
    /// An error of a file in the native form.
    #[error(transparent)]
    Native(#[from] KernelFileError),
    /// The file has none of the known forms.
    #[error(
        "the file is not a readable kernel (it starts with {start}); send .safetensors as `kernel fetch` writes it, a \
         compact kernel, .pt, .npy or .npz"
    )]
    Unknown {
        /// The first bytes of the file, in readable form.
        start: String,
    },
    /// The archive is damaged, or uses an unsupported feature.
    #[error("the archive is damaged or unsupported: {0}")]
    Archive(String),
    /// The pickle contains an instruction or a name that a tensor does not need.
    #[error(
        "the pickle in the .pt file has {found} at byte {at}, which a tensor does not need; it could run code, so the \
         file is refused and nothing of it was executed; save only the tensor, with \
         torch.save(kernel.detach().cpu(), path), or as .npy"
    )]
    Pickle {
        /// The refused instruction or name.
        found: String,
        /// Position in the pickle \[bytes\].
        at: usize,
    },
    /// An array has a wrong type or shape.
    #[error("{name} is {actual}, but must be {expected}")]
    Array {
        /// Name of the array.
        name: String,
        /// Actual type and shape.
        actual: String,
        /// Allowed types and shapes.
        expected: String,
    },
    /// An array holds a NaN or infinite value.
    #[error("{name} holds a value that is not a finite number, at index {index}")]
    NotFinite {
        /// Name of the array.
        name: String,
        /// Index of the value, counted from 0.
        index: usize,
    },
    /// The compact kernel is damaged or invalid.
    #[error("the compact kernel {0}")]
    Compact(String),
    /// The model cannot be written in the requested form.
    #[error("{0}")]
    NoSuchForm(String),
    /// The numbers do not describe a possible display.
    #[error("the kernel is impossible: {0}")]
    Model(#[from] lightpath_optics::Error),
}
