//! Compiles `lightpath/v1/*.proto` without a protoc: protox parses, prost and tonic generate, pbjson adds
//! protobuf's JSON form.

use prost::Message as _;
use std::{env, error::Error, fs, path::PathBuf};

const PROTOS: [&str; 6] = [
    "lightpath/v1/artifact.proto",
    "lightpath/v1/dataset.proto",
    "lightpath/v1/display.proto",
    "lightpath/v1/job.proto",
    "lightpath/v1/kernel.proto",
    "lightpath/v1/propagation.proto",
];

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=lightpath");
    let descriptors = protox::compile(PROTOS, ["."])?;
    let out_dir = PathBuf::from(env::var("OUT_DIR")?);
    let encoded = descriptors.encode_to_vec();
    fs::write(out_dir.join("descriptors.bin"), &encoded)?;

    tonic_prost_build::configure()
        .bytes(".")
        .compile_well_known_types(true)
        .extern_path(".google.protobuf", "::pbjson_types")
        .compile_fds(descriptors)?;
    pbjson_build::Builder::new().register_descriptors(&encoded)?.emit_fields().build(&[".lightpath.v1"])?;
    Ok(())
}
