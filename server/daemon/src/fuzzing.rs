//! One entry to every decoder of what comes from outside, for fuzzers: whatever the bytes are, it comes back.
//!
//! `fuzz/` feeds these to libFuzzer, `server/tests/service/decoders.rs` to mutated files. Requests are fed over the wire.

use crate::config::{Effective, Settings};
use crate::upkeep::Manifest;
use lightpath_domain::dataset::Encoding;
use lightpath_domain::job::Fit;
use lightpath_media::kernel_file;
use lightpath_media::kernel_formats;
use lightpath_media::pictures;
use lightpath_media::pictures::PhotoReading;
use lightpath_optics::{Grid, OpticalSetup};

/// Size of the display that what is read is for \[px\]; the seeds have it, too.
pub const HEIGHT_PX: usize = 48;
/// See [`HEIGHT_PX`].
pub const WIDTH_PX: usize = 64;

/// Something that reads bytes from outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decoder {
    /// Targets: PNG, TIFF, JPEG.
    Target,
    /// Photographs: the same, and `.npy`.
    Photograph,
    /// Holograms as levels of the display.
    Levels,
    /// Initial phases: `.npy`.
    Phase,
    /// Kernels in any form: safetensors, compact, `.npy`, `.npz`, `.pt`.
    Kernel,
    /// Kernels as they are stored: safetensors.
    StoredKernel,
    /// Settings: TOML.
    Settings,
    /// What a backup says of itself: JSON.
    BackupManifest,
}

impl Decoder {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Target,
        Self::Photograph,
        Self::Levels,
        Self::Phase,
        Self::Kernel,
        Self::StoredKernel,
        Self::Settings,
        Self::BackupManifest,
    ];

    /// Reads `bytes`; whether they were what they should be.
    #[must_use]
    pub fn reads(self, bytes: &[u8]) -> bool {
        match self {
            Self::Target => {
                let fits = [Fit::Contain, Fit::Cover, Fit::Stretch, Fit::Exact].into_iter();
                let read =
                    |fit: &Fit| pictures::target_intensity(bytes, Encoding::Srgb, *fit, HEIGHT_PX, WIDTH_PX).is_ok();
                fits.filter(read).count() > 0
            }
            Self::Photograph => {
                let reading = PhotoReading { encoding: Encoding::Linear, bit_depth: 12, black_level: 0.1 };
                pictures::photo_light(bytes, &reading).is_ok()
            }
            Self::Levels => pictures::levels(bytes, 8, HEIGHT_PX, WIDTH_PX).is_ok(),
            Self::Phase => pictures::phase_npy(bytes, HEIGHT_PX, WIDTH_PX).is_ok(),
            Self::Kernel => {
                let setup = Grid::try_new(HEIGHT_PX, WIDTH_PX, 8e-6)
                    .and_then(|grid| OpticalSetup::try_new(grid, 515e-9, 0.05))
                    .ok();
                setup.is_some_and(|setup| kernel_formats::import(bytes, &setup).is_ok())
            }
            Self::StoredKernel => kernel_file::decode(bytes).is_ok(),
            Self::Settings => std::str::from_utf8(bytes).is_ok_and(|text| {
                let file = Settings::from_toml(text);
                file.is_ok_and(|file| Effective::merge(Settings::default(), file).is_ok())
            }),
            Self::BackupManifest => serde_json::from_slice::<Manifest>(bytes).is_ok(),
        }
    }
}
