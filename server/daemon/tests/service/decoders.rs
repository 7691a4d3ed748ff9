//! Tests of every decoder of outside files with damaged files. A decoder must refuse or read them, with bounded memory
//! and without a panic.
//!
//! `LIGHTPATH_FUZZ_SECONDS=600 cargo test --release -p lightpath-server --test service decoders -- --nocapture` tests
//! each decoder for ten minutes. `fuzz/` tests the same decoders with libFuzzer.

use crate::mutation::{Random, add_to_corpus, mutated};
use image::{DynamicImage, ImageFormat};
use lightpath_domain::kernel::KernelModel;
use lightpath_media::kernel_formats::{self, KernelFormat};
use lightpath_media::pictures;
use lightpath_optics::{DisplayModel, Grid, KernelShape, OpticalSetup, Plane, SmoothField};
use lightpath_server::config::{Config, Effective, Settings};
use lightpath_server::fuzzing::{Decoder, HEIGHT_PX, WIDTH_PX};
use std::io::{Cursor, Write as _};
use std::process::Command;
use std::time::{Duration, Instant};

/// Number of damaged files for each decoder, if no time is given.
const FILES: u32 = 1500;
/// Memory limit of the process that decodes \[KiB\]: the largest picture takes 1 GiB while it is read.
const MEMORY_KIB_MAX: u32 = 3 << 20;
/// Environment variable that marks the process with the memory limit.
const LIMITED: &str = "LIGHTPATH_FUZZ_LIMITED";

/// Valid files of a decoder.
fn seeds(decoder: Decoder) -> Vec<Vec<u8>> {
    let setup = OpticalSetup::try_new(Grid::try_new(HEIGHT_PX, WIDTH_PX, 8e-6).unwrap(), 515e-9, 0.05).unwrap();
    let mut errors = SmoothField::flat(3);
    errors.phase[1] = 0.1;
    let model = DisplayModel { kernel: KernelShape::Smooth(errors), ..DisplayModel::ideal(setup) };
    let kernel = |format| kernel_formats::export(&model, KernelModel::Smooth, format).unwrap().bytes;
    let plane = Plane::from_fn(HEIGHT_PX, WIDTH_PX, |y, x| (y + x) as f32 / 120.0);
    let grey = image::load_from_memory(&pictures::grey_png_linear(&plane).unwrap()).unwrap();
    let file = |picture: &DynamicImage, format| {
        let mut bytes = Cursor::new(Vec::new());
        picture.write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    };
    let levels = file(&grey.to_luma8().into(), ImageFormat::Png);
    let files = |picture: DynamicImage| {
        [ImageFormat::Png, ImageFormat::Tiff, ImageFormat::Jpeg].map(|format| file(&picture, format))
    };
    let phase = pictures::npy_f32(&plane).unwrap();
    match decoder {
        Decoder::Target => [files(grey.to_luma8().into()), files(grey.to_rgb8().into())].concat(),
        Decoder::Photograph => [files(grey.to_luma8().into()).to_vec(), vec![phase]].concat(),
        Decoder::Levels => vec![levels],
        Decoder::Phase => vec![phase],
        Decoder::Kernel => {
            use KernelFormat::{Compact, Complex64, F16, Npy, Npz, Pt, Safetensors};
            [Safetensors, Compact, Pt, Npy, Npz, Complex64, F16].map(kernel).to_vec()
        }
        Decoder::StoredKernel => vec![kernel(KernelFormat::Safetensors)],
        Decoder::Settings => {
            let effective = Effective::merge(Settings::default(), Settings::default()).unwrap();
            assert_eq!(effective.config, Config::default());
            vec![effective.to_string().into_bytes()]
        }
        Decoder::BackupManifest => vec![
            br#"{"version":"0.1.0","time_ms":1,"database":"sha256-0","artifacts":1,"artifact_bytes":2,"jobs":3,"damaged":["sha256-1"]}"#
                .to_vec(),
        ],
    }
}

/// Name of the decoder's target in `fuzz/`.
fn fuzz_target(decoder: Decoder) -> &'static str {
    match decoder {
        Decoder::Target => "target",
        Decoder::Photograph => "photograph",
        Decoder::Levels => "levels",
        Decoder::Phase => "phase",
        Decoder::Kernel => "kernel",
        Decoder::StoredKernel => "stored_kernel",
        Decoder::Settings => "settings",
        Decoder::BackupManifest => "backup_manifest",
    }
}

#[test]
fn valid_files_are_read() {
    for decoder in Decoder::ALL {
        // A file with the transfer function alone can be exported, but lacks the properties that an import needs.
        let read = seeds(decoder).iter().filter(|seed| decoder.accepts(seed)).count();
        assert!(read > 0 && (decoder == Decoder::Kernel || read == seeds(decoder).len()), "{decoder:?}: {read}");
        assert!(!decoder.accepts(b"") || decoder == Decoder::Settings, "{decoder:?}");
        add_to_corpus(fuzz_target(decoder), &seeds(decoder));
    }
}

/// Runs this test in a process with a memory limit. An allocation beyond the limit ends that process.
#[test]
fn damaged_files_are_refused_or_read_within_memory() {
    if std::env::var_os(LIMITED).is_some() {
        for decoder in Decoder::ALL {
            writeln!(std::io::stderr(), "{}", decode_damaged_files(decoder)).unwrap();
        }
        return;
    }
    let limited = format!("ulimit -v {MEMORY_KIB_MAX} && ulimit -c 0 && exec \"$0\" \"$@\"");
    let this_test = "decoders::damaged_files_are_refused_or_read_within_memory";
    let status = Command::new("sh")
        .args(["-c", &limited])
        .arg(std::env::current_exe().unwrap())
        .args(["--exact", this_test, "--nocapture"])
        .env(LIMITED, "yes")
        .status()
        .unwrap();
    assert!(status.success(), "{status}");
}

/// Decodes damaged files: [`FILES`] of them, or as many as possible in `LIGHTPATH_FUZZ_SECONDS`. Returns a summary.
fn decode_damaged_files(decoder: Decoder) -> String {
    let seconds = std::env::var("LIGHTPATH_FUZZ_SECONDS").ok().map(|seconds| seconds.parse::<u64>().unwrap());
    let (seeds, mut random) = (seeds(decoder), Random::new(7));
    let (begin, mut decoded, mut read, mut slowest) = (Instant::now(), 0, 0, Duration::ZERO);
    while seconds.map_or(decoded < FILES, |seconds| begin.elapsed() < Duration::from_secs(seconds)) {
        let damaged = mutated(&seeds[random.below(seeds.len())], &seeds, &mut random);
        let started = Instant::now();
        read += u32::from(decoder.accepts(&damaged));
        slowest = slowest.max(started.elapsed());
        decoded += 1;
    }
    assert!(read < decoded, "{decoder:?} refused no file");
    format!("{decoder:?}: {decoded} files, {read} of them read, the slowest took {slowest:.1?}")
}
