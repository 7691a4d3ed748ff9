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
//! - `error`: what can be wrong with them.
mod archive;
mod array;
pub mod compact;
mod error;
mod export;
mod half;
mod import;
mod pickle;
mod torch;

pub use error::KernelFormatError;
pub use export::{Exported, KernelFormat, export};
pub use import::{Imported, import};

/// A `.npy` file of float32 in C order, from its little-endian bytes.
pub(crate) fn npy_f32(shape: &[usize], bytes: &[u8]) -> Vec<u8> {
    array::npy("<f4", shape, bytes)
}

/// A `.npz` archive of `.npy` files by name.
pub(crate) fn npz(files: &[(&str, &[u8])]) -> Result<Vec<u8>, KernelFormatError> {
    archive::write(files)
}
