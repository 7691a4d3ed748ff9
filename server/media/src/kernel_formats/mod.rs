//! Kernels in other people's forms, and small ones for firmware.
//!
//! The native form is [`crate::kernel_file`]; everything else is made from it, or turned into it, here.
//!
//! | form | holds | loses |
//! |---|---|---|
//! | `safetensors` | all of the model | nothing |
//! | `compact` | all of a smooth model, in some hundred bytes ([`compact`]) | digits beyond f32 |
//! | `npz` | every array of the model, H as complex64 | digits beyond f32 |
//! | `complex64` | H alone, `.npy`, complex64 \[2·rows, 2·columns\] | source, response, zero order |
//! | `f16` | H alone, `.npy`, float16 \[2·rows, 2·columns, 2\] | the same, and digits beyond f16 |
//! | `npy`, `pt` | H alone as the paper has it: float32 \[1, 2, rows, columns\], amplitude and phase of the inner half | the same, and H outside the inner half |
//!
//! Everywhere zero frequency is in the middle, at `[rows/2][columns/2]` of the array's own size.
//!
//! # Layout
//!
//! - `export`, `import`: between forms and models. [`compact`]: the small form.
//! - `array`: `.npy`. `archive`: zip files, as `.npz` and `.pt` are. `pickle`: the part of Python's pickle that a tensor is
//!   written in, and nothing that could run. `torch`: `.pt`. `half`: 16-bit floats.
mod archive;
mod array;
pub mod compact;
mod export;
mod half;
mod import;
mod pickle;
mod torch;

pub use export::{Exported, KernelFormat, export};
pub use import::{Imported, import};

use crate::kernel_file::KernelFileError;

/// A `.npy` file of float32 in C order, from its little-endian bytes.
pub(crate) fn npy_f32(shape: &[usize], bytes: &[u8]) -> Vec<u8> {
    array::npy("<f4", shape, bytes)
}

/// A `.npz` archive of `.npy` files by name.
pub(crate) fn npz(files: &[(&str, &[u8])]) -> Result<Vec<u8>, KernelFormatError> {
    archive::write(files)
}

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
