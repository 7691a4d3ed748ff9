//! Linear convolution of a field with a transfer function, in three fused passes.
//!
//! ```text
//! u = crop F⁻¹[ H · F[ pad c ] ]        pad: h×w → 2h×2w
//! ```
//!
//! The padded field is never stored. A DFT of length 2n of a signal whose second half is zero equals two DFTs of length
//! n: one of the signal (the even bins) and one of the signal times e^{−iπj/n} (the odd bins). The first half of the
//! inverse is the sum of the two inverse DFTs, the odd one times e^{+iπj/n}. So every transform has the length of the
//! unpadded side, no cropped values are computed, and sides of any length are allowed.
//!
//! A convolution takes three passes over memory. Each pass is parallel and writes contiguous blocks:
//!
//! 1. [rows](rows): compute or read a row, transform it along x, write it row-major;
//! 2. [columns](columns): transform a tile of columns along y, multiply it by H, transform it back, write it
//!    tile-major;
//! 3. rows again: gather a row, transform it back along x, use it.
//!
//! Rows and columns are computed independently, and sums are added in a fixed order, so results do not depend on the
//! number of threads.

mod axis;
mod bins;
mod columns;
mod convolver;
mod kernels;
mod rows;
mod scratch;
mod tile_pass;
mod transfer;

pub(crate) use bins::{frequencies, frequency_per_px, padded_columns, split_bin, tile_columns};
pub(crate) use convolver::Convolver;
pub(crate) use kernels::Kernels;
pub(crate) use scratch::{ROWS, Scratch};
pub use tile_pass::Real;
pub(crate) use transfer::Transfer;

#[cfg(test)]
mod tests;
