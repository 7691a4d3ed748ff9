//! The code in C of `firmware/c` that checks manifests, keyrings and files, and its vectors in
//! `firmware/vectors/manifests`.
//!
//! The vectors are what this code writes: a test writes them again and compares. Each has a verdict that a person
//! wrote down, which must be that of `Trust` and that of the C code, compiled with sanitizers. Both must also agree
//! about many damaged documents. To write new vectors after a change of the form, and to try a million documents:
//!
//! ```sh
//! LIGHTPATH_WRITE_VECTORS=1 cargo test -p lightpath-manifest --test firmware vectors_are
//! LIGHTPATH_DAMAGED_MANIFESTS=1000000 cargo test --release -p lightpath-manifest --test firmware damaged -- --nocapture
//! ```
#![allow(clippy::unwrap_used)]

/// Questions about documents, and what `Trust` answers.
mod cases;
/// Compiles the C code and its test programs, and runs them.
mod compiler;
/// Damaged documents, and whether `Trust` and the C code agree about each.
mod damage;
/// Well-formed documents of the vectors, and their keys.
mod documents;
/// Documents that are none: a line or a value of each is wrong.
mod malformed;
/// All vectors, with their verdicts.
mod vectors;

use cases::Case;
use compiler::{CHECK_MANIFESTS, MANIFEST_VERDICTS};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Whether the vectors are written instead of compared.
const WRITE: &str = "LIGHTPATH_WRITE_VECTORS";
/// Number of damaged documents, if it is not the ordinary one.
const COUNT: &str = "LIGHTPATH_DAMAGED_MANIFESTS";
/// Number of damaged documents in every run of the tests.
const DAMAGED: usize = 20_000;
/// Largest size of all vectors together \[bytes\]. They are part of the repository.
const BYTES_MAX: usize = 350_000;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../firmware/vectors/manifests")
}

/// What the C code says about each case.
fn answers_in_c(name: &str, cases: &[Case]) -> Vec<String> {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&path, cases::pack(cases)).unwrap();
    let printed = compiler::run(&MANIFEST_VERDICTS, path.as_os_str());
    std::fs::remove_file(path).unwrap();
    let answers: Vec<String> = printed.lines().map(str::to_owned).collect();
    assert_eq!(answers.len(), cases.len());
    answers
}

#[test]
fn vectors_are_those_of_this_code() {
    let set = vectors::all();
    if std::env::var_os(WRITE).is_some() {
        set.write(&folder());
    }
    let bytes = set.compare(&folder());
    assert!(bytes <= BYTES_MAX, "the vectors have {bytes} bytes");
}

#[test]
fn trust_gives_every_vector_the_verdict_that_is_written_down() {
    for (case, verdict) in vectors::all().cases {
        let found = case.verdict();
        assert_eq!((found.name, found.line), (verdict.name, verdict.line), "{}", case.line());
    }
}

#[test]
fn document_names_every_verdict_of_the_vectors_and_no_other() {
    let document = include_str!("../../../docs/firmware.md");
    let table = document.split("| answer | meaning |").nth(1).unwrap().trim_start();
    let rows = table.lines().take_while(|line| line.starts_with('|')).skip(1);
    // The names stand in the first cell, in code type.
    let cells = rows.map(|row| row.split('|').nth(1).unwrap());
    let named: BTreeSet<&str> = cells.flat_map(|cell| cell.split('`').skip(1).step_by(2)).collect();
    let all = vectors::all();
    let asked: BTreeSet<&str> = all.cases.iter().map(|(_, verdict)| verdict.name).collect();
    assert_eq!(named, asked);
}

#[test]
fn the_c_code_gives_every_vector_its_verdict() {
    eprintln!("{}", compiler::run(&CHECK_MANIFESTS, folder().as_os_str()));
}

#[test]
fn the_c_code_reads_in_every_accepted_vector_what_trust_reads() {
    let cases: Vec<Case> = vectors::all().cases.into_iter().map(|(case, _)| case).collect();
    for (case, answer) in cases.iter().zip(answers_in_c("manifest_vectors", &cases)) {
        assert_eq!(answer, case.verdict().to_string(), "{}", case.line());
    }
}

#[test]
fn the_c_code_and_trust_agree_about_damaged_documents() {
    let count = std::env::var(COUNT).map_or(DAMAGED, |text| text.parse().unwrap());
    eprintln!("{}", damage::compare(count));
}

#[test]
fn the_example_of_the_readme_compiles() {
    compiler::compile_example();
}
