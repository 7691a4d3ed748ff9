//! Access to every decoder of outside input, for fuzzers. A decoder must return for any bytes, without a panic.
//!
//! `fuzz/` calls the decoders with inputs from libFuzzer, `server/daemon/tests/service/decoders.rs` with mutated files.
//! Requests are tested over the network.

use crate::config::{Effective, Settings};
use crate::upkeep::Manifest;
use lightpath_domain::dataset::Encoding;
use lightpath_domain::job::Fit;
use lightpath_media::budget::Budget;
use lightpath_media::kernel_file;
use lightpath_media::kernel_formats;
use lightpath_media::pictures;
use lightpath_media::pictures::{PhotoReading, Placement};
use lightpath_optics::{Grid, OpticalSetup};

/// Height of the display in the inputs \[px\]; the seed files have the same.
pub const HEIGHT_PX: usize = 48;
/// Width of the display in the inputs \[px\]; the seed files have the same.
pub const WIDTH_PX: usize = 64;

/// Largest memory of a kernel \[bytes\]: what one call may use of the default of `computing_mib_max`. A server refuses larger
/// ones before it reads them.
const KERNEL_BYTES_MAX: u64 = 1536 << 20;

/// A decoder of outside input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decoder {
    /// Decoder of targets: PNG, JPEG, TIFF, BMP, `.npy`.
    Target,
    /// Decoder of photographs: PNG, JPEG, TIFF, BMP, `.npy`.
    Photograph,
    /// Decoder of holograms as levels of the display.
    Levels,
    /// Decoder of initial phases: `.npy`.
    Phase,
    /// Decoder of kernels in any form: safetensors, compact, `.npy`, `.npz`, `.pt`.
    Kernel,
    /// Decoder of stored kernels: safetensors.
    StoredKernel,
    /// Decoder of settings: TOML.
    Settings,
    /// Decoder of the manifest of a backup: JSON.
    BackupManifest,
}

impl Decoder {
    /// All decoders.
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

    /// Memory that the server counts for decoding `bytes`, besides themselves \[bytes\]; `None`: it counts none, because they
    /// come from the operator.
    #[must_use]
    pub fn counted_bytes(self, bytes: &[u8]) -> Option<u64> {
        let counted = match self {
            Self::Target | Self::Levels | Self::Phase => pictures::reading_bytes(bytes, (HEIGHT_PX * WIDTH_PX) as u64),
            Self::Photograph => pictures::reading_bytes(bytes, 0),
            Self::Kernel => kernel_formats::importing_bytes(bytes),
            Self::StoredKernel => kernel_file::decoding_bytes(bytes.len() as u64),
            Self::Settings | Self::BackupManifest => return None,
        };
        Some(counted.saturating_sub(bytes.len() as u64))
    }

    /// Decodes `bytes`. Returns whether they are valid.
    #[must_use]
    pub fn accepts(self, bytes: &[u8]) -> bool {
        match self {
            Self::Target => {
                let fits = [Fit::Contain, Fit::Cover, Fit::Stretch, Fit::Exact].into_iter();
                let read = |fit: &Fit| {
                    pictures::target_intensity(bytes, Encoding::Srgb, &Placement::whole(*fit, HEIGHT_PX, WIDTH_PX))
                        .is_ok()
                };
                fits.filter(read).count() > 0
            }
            Self::Photograph => {
                let reading = PhotoReading { encoding: Encoding::Linear, bit_depth: 12, black_level: 0.1 };
                pictures::photo(bytes, &reading).is_ok()
            }
            Self::Levels => pictures::levels(bytes, 8, HEIGHT_PX, WIDTH_PX).is_ok(),
            Self::Phase => pictures::phase_npy(bytes, HEIGHT_PX, WIDTH_PX).is_ok(),
            Self::Kernel => {
                let setup = Grid::try_new(HEIGHT_PX, WIDTH_PX, 8e-6)
                    .and_then(|grid| OpticalSetup::try_new(grid, 515e-9, 0.05))
                    .ok();
                let budget = Budget::new(kernel_formats::importing_bytes(bytes).min(KERNEL_BYTES_MAX));
                setup.is_some_and(|setup| kernel_formats::import(bytes, &setup, &budget).is_ok())
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
