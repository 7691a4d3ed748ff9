//! Bytes that people and programs look at: pictures, photographs, kernel files, figures and reports.
//!
//! # Layout
//!
//! - [`pictures`]: decoding of targets, photographs and holograms, and encoding of results. `npy`: limits of NumPy's files.
//! - [`captures`]: photographs of holograms, brought to the display's grid and checked.
//! - [`kernel_file`]: learned displays as safetensors. [`kernel_formats`]: in other forms.
//! - [`figures`]: contact sheets, heat maps and curves. [`report`]: a learned kernel as HTML, pictures and arrays.
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod captures;
pub mod figures;
pub mod kernel_file;
pub mod kernel_formats;
mod npy;
pub mod pictures;
pub mod report;
