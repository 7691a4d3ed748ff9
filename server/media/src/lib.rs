//! File formats for people and programs: pictures, photographs, kernel files, figures and reports.
//!
//! # Layout
//!
//! - [`budget`]: the memory that reading a file may take. `shortened`: texts of files in messages.
//! - [`pictures`]: decoding of targets, photographs and holograms, and encoding of results. `npy`: limits for NumPy's
//!   files.
//! - [`captures`]: photographs of holograms, mapped to the display's grid and checked.
//! - [`photo_scores`]: the quality of any photograph of a target, with pictures.
//! - [`kernel_file`]: kernels as safetensors. [`kernel_formats`]: kernels in other forms.
//! - [`live_pictures`]: small pictures of running jobs, in memory.
//! - [`figures`]: contact sheets, heat maps and curves. [`report`]: reports of kernels as HTML, pictures and arrays.
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod budget;
pub mod captures;
pub mod figures;
pub mod kernel_file;
pub mod kernel_formats;
pub mod live_pictures;
mod npy;
pub mod photo_scores;
pub mod pictures;
pub mod report;
mod shortened;
