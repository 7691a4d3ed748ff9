//! Every decoder of files from outside, fed with damaged ones: it refuses or reads them, within memory, and never panics.
//!
//! `LIGHTPATH_FUZZ_SECONDS=600 cargo test --release -p lightpath-server --test service decoders -- --nocapture` feeds each for
//! ten minutes; `fuzz/` does the same with libFuzzer.

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

/// Files that each decoder gets, where no time is given.
const FILES: u32 = 1500;
/// Memory of the process that decodes \[KiB\]: the largest picture takes 1 GiB while it is read.
const MEMORY_KIB_MAX: u32 = 3 << 20;
/// Set in the process that has the limit.
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
            br#"{"version":"0.1.0","time_ms":1,"database":"sha256-0","artifacts":1,"artifact_bytes":2,"jobs":3}"#
                .to_vec(),
        ],
    }
}

/// What `fuzz/` calls it.
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
        // H alone can be written, but says too little to be read back.
        let read = seeds(decoder).iter().filter(|seed| decoder.reads(seed)).count();
        assert!(read > 0 && (decoder == Decoder::Kernel || read == seeds(decoder).len()), "{decoder:?}: {read}");
        assert!(!decoder.reads(b"") || decoder == Decoder::Settings, "{decoder:?}");
        add_to_corpus(fuzz_target(decoder), &seeds(decoder));
    }
}

/// Runs itself with a limit on its memory: an allocation beyond it ends the process.
#[test]
fn damaged_files_are_refused_or_read_within_memory() {
    if std::env::var_os(LIMITED).is_some() {
        for decoder in Decoder::ALL {
            writeln!(std::io::stderr(), "{}", feed(decoder)).unwrap();
        }
        return;
    }
    let limited = format!("ulimit -v {MEMORY_KIB_MAX} && ulimit -c 0 && exec \"$0\" \"$@\"");
    let itself = "decoders::damaged_files_are_refused_or_read_within_memory";
    let status = Command::new("sh")
        .args(["-c", &limited])
        .arg(std::env::current_exe().unwrap())
        .args(["--exact", itself, "--nocapture"])
        .env(LIMITED, "yes")
        .status()
        .unwrap();
    assert!(status.success(), "{status}");
}

/// Damaged files to a decoder: a number of them, or as many as go into `LIGHTPATH_FUZZ_SECONDS`. Says how that went.
fn feed(decoder: Decoder) -> String {
    let seconds = std::env::var("LIGHTPATH_FUZZ_SECONDS").ok().map(|seconds| seconds.parse::<u64>().unwrap());
    let (seeds, mut random) = (seeds(decoder), Random::new(7));
    let (begin, mut fed, mut read, mut slowest) = (Instant::now(), 0, 0, Duration::ZERO);
    while seconds.map_or(fed < FILES, |seconds| begin.elapsed() < Duration::from_secs(seconds)) {
        let damaged = mutated(&seeds[random.below(seeds.len())], &seeds, &mut random);
        let started = Instant::now();
        read += u32::from(decoder.reads(&damaged));
        slowest = slowest.max(started.elapsed());
        fed += 1;
    }
    assert!(read < fed, "{decoder:?} refuses something");
    format!("{decoder:?}: {fed} files, {read} of them read, the slowest took {slowest:.1?}")
}
