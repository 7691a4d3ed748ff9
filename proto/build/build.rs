//! Compiles `lightpath/v1/*.proto` without protoc. protox parses the files, prost and tonic generate Rust code, and
//! pbjson adds the JSON form of protobuf.
//!
//! `words`: the values of every enumeration with their comments. `annotations`: the methods over HTTP, for `routes`, their
//! table, and `openapi`, their document, with the `schemas` of messages and the `ranges` of numbers.

mod annotations;
mod openapi;
mod ranges;
mod routes;
mod schemas;
mod words;

use prost::Message as _;
use std::{env, error::Error, fs, path::PathBuf};

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=lightpath");
    println!("cargo:rerun-if-changed=google");
    println!("cargo:rerun-if-changed=build");
    println!("cargo:rerun-if-changed=openapi.json");
    let mut compiler = protox::Compiler::new(["."])?;
    compiler.include_imports(true).include_source_info(true).open_files(protos()?)?;
    let descriptors = compiler.file_descriptor_set();
    let out_dir = PathBuf::from(env::var("OUT_DIR")?);
    // Only this form has the annotations of the methods: the types of prost do not know them.
    fs::write(out_dir.join("descriptors.bin"), compiler.encode_file_descriptor_set())?;
    fs::write(out_dir.join("words.rs"), words::words_code(&descriptors.file)?)?;
    let pool = compiler.descriptor_pool();
    fs::write(out_dir.join("routes.rs"), routes::routes_code(&pool)?)?;
    let document = openapi::openapi_document(&pool, &fs::read_to_string("openapi.json")?)?;
    fs::write(out_dir.join("openapi.json"), document)?;

    let encoded = descriptors.encode_to_vec();
    tonic_prost_build::configure()
        .bytes(".")
        .compile_well_known_types(true)
        .extern_path(".google.protobuf", "::pbjson_types")
        .compile_fds(descriptors)?;
    pbjson_build::Builder::new().register_descriptors(&encoded)?.emit_fields().build(&[".lightpath.v1"])?;
    Ok(())
}

/// The files of the API, in the order of their names.
fn protos() -> Result<Vec<PathBuf>, std::io::Error> {
    let entries = fs::read_dir("lightpath/v1")?.collect::<Result<Vec<_>, _>>()?;
    let mut files: Vec<PathBuf> = entries.iter().map(fs::DirEntry::path).collect();
    files.sort();
    Ok(files)
}
