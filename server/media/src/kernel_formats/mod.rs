//! Kernels in the file forms of other programs, and in a compact form for firmware.
//!
//! The native form is [`crate::kernel_file`]. This module converts between it and all other forms.
//!
//! | form | holds | loses |
//! |---|---|---|
//! | `safetensors` | the whole model | nothing |
//! | `compact` | a whole smooth model, in some hundred bytes ([`compact`]) | digits beyond f32 |
//! | `npz` | the whole model, and H and the source as complex64 (`npz`) | nothing |
//! | `complex64` | H alone, `.npy`, complex64 \[2·rows, 2·columns\] | source, response, zero order, gain, offset, variation, parameters |
//! | `f16` | H alone, `.npy`, float16 \[2·rows, 2·columns, 2\] | as `complex64`, and digits beyond f16 |
//! | `npy`, `pt` | H alone in the paper's layout: float32 \[1, 2, rows, columns\], amplitude and phase of the inner half | as `complex64`, and H outside the inner half |
//!
//! An export lists what it lost ([`Loss`]), and an import what the file did not hold. No form but `safetensors` holds
//! the distances from which a kernel was interpolated. In all forms zero frequency is in the middle, at
//! `[rows/2][columns/2]` of the array's own size.
//!
//! # Layout
//!
//! - `export`, `import`: conversion between forms and models. `imported`: what an import gives. `dense`: H as numbers. [`compact`]: the compact form.
//!   `npz`: archives of a whole model. `losses`: what a form does not hold.
//! - `array`: `.npy` files. `archive`: zip files, the container of `.npz` and `.pt`. `pickle`: the part of Python's
//!   pickle that holds a tensor; it runs no code. `torch`: `.pt` files. `half`: 16-bit floats.
//! - `error`: the errors of all forms.

mod archive;
mod array;
pub mod compact;
mod dense;
mod error;
mod export;
mod half;
mod import;
mod imported;
mod losses;
mod npz;
mod pickle;
mod torch;

pub use error::KernelFormatError;
pub use export::{Exported, export, export_with, exporting_bytes};
pub use import::{import, importing_bytes};
pub use imported::Imported;
pub use lightpath_domain::kernel_format::KernelFormat;
pub use losses::Loss;

/// Writes a `.npy` file of float32 in C order, from its little-endian bytes.
pub(crate) fn npy_f32(shape: &[usize], bytes: &[u8]) -> Vec<u8> {
    array::npy("<f4", shape, bytes)
}

/// Writes a `.npz` archive of named `.npy` files.
pub(crate) fn npz_archive(files: &[(&str, &[u8])]) -> Result<Vec<u8>, KernelFormatError> {
    archive::write(files)
}

#[cfg(test)]
mod tests {
    use super::{Imported, KernelFormatError, importing_bytes};
    use crate::budget::Budget;
    use lightpath_optics::OpticalSetup;

    /// [`import`](super::import) with the memory that is counted for the file.
    pub(super) fn import(bytes: &[u8], setup: &OpticalSetup) -> Result<Imported, KernelFormatError> {
        super::import(bytes, setup, &Budget::new(importing_bytes(bytes)))
    }
}
