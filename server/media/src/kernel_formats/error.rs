//! What can be wrong with a kernel in another form.

use crate::kernel_file::KernelFileError;

/// What is wrong with a kernel in another form.
#[derive(Debug, thiserror::Error)]
pub enum KernelFormatError {
    /// In the native form.
    #[error(transparent)]
    Native(#[from] KernelFileError),
    /// None of the forms.
    #[error(
        "the file is no kernel that can be read (it starts with {start}); send .safetensors as `kernel fetch` writes it, \
         compact, .pt, .npy or .npz"
    )]
    Unknown {
        /// The first bytes, readable.
        start: String,
    },
    /// A damaged archive.
    #[error("the archive is damaged or of a kind that is not read: {0}")]
    Archive(String),
    /// A pickle with something in it that a tensor does not need.
    #[error(
        "the .pt file's pickle has {what} at byte {at}, which a tensor does not need: it could run code, so it is not read and \
         nothing of it was executed; save the tensor alone with torch.save(kernel.detach().cpu(), path), or as .npy"
    )]
    Pickle {
        /// What.
        what: String,
        /// Where in the pickle.
        at: usize,
    },
    /// An array of another type or shape.
    #[error("{what} is {actual}, but must be {expected}")]
    Array {
        /// Which array.
        what: String,
        /// What it is.
        actual: String,
        /// What would be right.
        expected: String,
    },
    /// NaN or infinite.
    #[error("{what} holds a value that is not a finite number, the {index}th")]
    NotFinite {
        /// Which array.
        what: String,
        /// Counted from 0.
        index: usize,
    },
    /// A compact file that is none.
    #[error("the compact kernel {0}")]
    Compact(String),
    /// A model that has no such form.
    #[error("{0}")]
    NoSuchForm(String),
    /// The numbers make no display.
    #[error("the kernel is not possible: {0}")]
    Model(#[from] lightpath_optics::Error),
}
