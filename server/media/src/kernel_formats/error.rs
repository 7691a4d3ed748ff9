//! Errors of reading and writing kernels in other forms.

use crate::budget::OverBudget;
use crate::kernel_file::KernelFileError;

/// Reason why a kernel could not be read from another form, or written to it; the messages say what each means.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum KernelFormatError {
    #[error(transparent)]
    Native(#[from] KernelFileError),
    #[error(
        "the file is not a readable kernel (it starts with {start}); send .safetensors as `kernel fetch` writes it, a \
         compact kernel, .pt, .npy or .npz"
    )]
    Unknown { start: String },
    #[error(transparent)]
    Memory(#[from] OverBudget),
    #[error("the archive is damaged or unsupported: {0}")]
    Archive(String),
    #[error(
        "the pickle in the .pt file has {found} at byte {at}, which a tensor does not need; it could run code, so the \
         file is refused and nothing of it was executed; save only the tensor, with \
         torch.save(kernel.detach().cpu(), path), or as .npy"
    )]
    Pickle { found: String, at: usize },
    /// An array has a wrong type or shape.
    #[error("{name} is {actual}, but must be {expected}")]
    Array { name: String, actual: String, expected: String },
    /// `index` counts from 0.
    #[error("{name} holds a value that is not a finite number, at index {index}")]
    NotFinite { name: String, index: usize },
    #[error("the compact kernel {0}")]
    Compact(String),
    /// The model cannot be written in the requested form.
    #[error("{0}")]
    NoSuchForm(String),
    /// The numbers do not describe a possible display.
    #[error("the kernel is impossible: {0}")]
    Model(#[from] lightpath_optics::Error),
}
