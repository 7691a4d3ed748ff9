//! The decoder in C of `firmware/c` and the test vectors of `firmware/vectors`.
//!
//! The vectors are what this code computes: a test computes them again and compares. The decoder, compiled with
//! sanitizers, must give their numbers, must refuse what Lightpath refuses, and must survive a million damaged files.
//! To write new vectors after a change of the form:
//!
//! ```sh
//! LIGHTPATH_WRITE_VECTORS=1 cargo test -p lightpath-media --test firmware vectors_are
//! ```
#![allow(clippy::unwrap_used)]

/// Compiles the decoder and its test programs, and runs them.
mod compiler;
/// Damaged kernels, and whether Lightpath and the decoder agree about each.
mod damage;
/// The kernels of the vectors.
mod kernels;
/// The decoder of the document, in plain sums.
#[path = "../plain_decoder/mod.rs"]
mod plain_decoder;
/// Files that must be refused.
mod refusals;
/// Texts of numbers: writing, reading, comparing.
mod text;
/// The numbers that a decoder must compute.
mod vectors;

use compiler::{Program, run};
use lightpath_media::budget::Budget;
use lightpath_media::kernel_formats::{self, Imported, KernelFormatError};
use lightpath_optics::OpticalSetup;
use std::path::{Path, PathBuf};

/// Whether the vectors are written instead of compared.
const WRITE: &str = "LIGHTPATH_WRITE_VECTORS";
/// Largest size of all vectors together \[bytes\]. They are part of the repository.
const BYTES_MAX: u64 = 400_000;
/// Number of damaged files.
const DAMAGED: u32 = 1_000_000;

/// Reads a kernel with the memory that is counted for its file.
fn import(bytes: &[u8], setup: &OpticalSetup) -> Result<Imported, KernelFormatError> {
    kernel_formats::import(bytes, setup, &Budget::new(kernel_formats::importing_bytes(bytes)))
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../firmware/vectors")
}

#[test]
fn vectors_are_those_of_this_code() {
    let is_writing = std::env::var_os(WRITE).is_some();
    if is_writing {
        vectors::write(&folder());
        refusals::write(&folder());
    }
    vectors::compare(&folder());
    refusals::compare(&folder());
    let bytes: u64 = std::fs::read_dir(folder()).unwrap().map(|file| file.unwrap().metadata().unwrap().len()).sum();
    assert!(bytes <= BYTES_MAX, "the vectors have {bytes} bytes");
}

#[test]
fn lightpath_refuses_every_refused_kernel() {
    refusals::check(&folder());
}

#[test]
fn the_decoder_gives_the_numbers_of_every_vector() {
    let vectors = folder();
    eprintln!("{}", run(Program::CheckVectors, &[vectors.as_os_str()]));
}

#[test]
fn the_example_of_the_readme_compiles() {
    compiler::compile_example();
}

#[test]
fn the_decoder_survives_a_million_damaged_files() {
    let (vectors, count) = (folder(), DAMAGED.to_string());
    eprintln!("{}", run(Program::Fuzz, &[vectors.as_os_str(), count.as_ref()]));
}

#[test]
fn the_decoder_and_lightpath_refuse_the_same_kernels() {
    damage::compare_verdicts(&folder());
}
