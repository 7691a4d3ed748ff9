//! Jobs that make the report of a kernel version: request, result, memory and time.

use super::Kind;
use crate::job::estimate::{KernelSize, Need, PairsSize, REAL};
use crate::kernel::KernelKey;
use lightpath_optics::learning::KernelModel;
use lightpath_optics::memory::{EngineSize, LearningSize};
use serde::{Deserialize, Serialize};

/// Largest number of other versions in a report. The newest ones are used.
pub const OTHER_VERSIONS_MAX: u32 = 12;

/// Request to make the report of a kernel version.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReportKernel {
    /// Key of the kernel.
    pub kernel: KernelKey,
    /// Number of the kernel version.
    pub version: u32,
}

/// Report of a kernel version, for people.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReportResult {
    /// Artifact digest of the report as one HTML file, with all pictures in it.
    pub html: String,
    /// Artifact digest of the report's numbers (`.npz`).
    pub arrays: String,
    /// Pictures of the report, in order.
    pub figures: Vec<ReportFigure>,
}

/// A picture of a report.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReportFigure {
    /// File name, with the extension `.png` or `.svg`.
    pub name: String,
    /// Title of the picture.
    pub title: String,
    /// Artifact digest of the picture.
    pub artifact: String,
}

impl Kind for ReportKernel {
    fn display(&self) -> &str {
        &self.kernel.display
    }
}

/// What the report of a kernel version needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReportInputs {
    /// Kernel of the version.
    pub kernel: KernelSize,
    /// Model of the version.
    pub model: KernelModel,
    /// Size of the largest file of another version \[bytes\].
    pub other_file_bytes: u64,
    /// Size of the files of all versions that it shows \[bytes\].
    pub other_files_bytes: u64,
    /// Pairs of its dataset; `None`: it has none.
    pub pairs: Option<PairsSize>,
    /// Rows and columns of the region that is compared \[px\].
    pub region_px: [usize; 2],
}

/// Need of a report.
#[must_use]
pub fn need(inputs: &ReportInputs) -> Need {
    /// Memory for the spectrum of a hologram in f64 and its transposed copies, for each pixel \[bytes\].
    const SPECTRUM_BYTES_PER_PX: u64 = 68;
    /// Memory for charts, pictures and point spread functions \[bytes\].
    const DRAWING_BYTES: u64 = 120 << 20;
    /// Work of drawing and writing the page.
    const DRAWING_WORK: f64 = 8e9;
    /// Work of reading a byte of another version, and of its pictures.
    const OTHER_STAGES: f64 = 85.0;
    let kernel = inputs.kernel;
    let (engine, n) = (kernel.engine, kernel.engine.pixels());
    // The version's own numbers stay, those of one other version come and go.
    let numbers = kernel.numbers_bytes();
    let others = numbers + 3 * inputs.other_file_bytes;
    let drawn = numbers + inputs.other_file_bytes + engine.sampled_bytes() + engine.sampling_bytes.max(DRAWING_BYTES);
    let compared = inputs.pairs.map_or(0, |pairs| {
        let size = LearningSize {
            // The ideal kernel was sampled before.
            engine: EngineSize {
                kernels_per_side: 1,
                has_source: false,
                wraps_phase: false,
                sampling_bytes: 0,
                ..engine
            },
            model: inputs.model,
            order: kernel.order,
            distances: 1,
            region_px: inputs.region_px,
            // What the photographs could hide is among the parameters.
            blocks: kernel.blocks.with_hidden(),
        };
        let fit =
            if matches!(inputs.model, KernelModel::Display | KernelModel::Varying) { size.fit_bytes() } else { 0 };
        let compared = engine.fields_bytes() + 8 * REAL * n;
        let pair = compared.max(SPECTRUM_BYTES_PER_PX * n) + pairs.reading_bytes(n) + 2 * REAL * n;
        // A kernel with a value for each frequency does not sample the ideal one.
        let reading = if kernel.has_bins { 3 * numbers } else { kernel.reading_bytes() };
        numbers + engine.engine_bytes() + engine.scratch_bytes() + fit + pair.max(reading)
    });
    let pairs = inputs.pairs.map_or(0.0, |pairs| (pairs.all as f64).min(32.0));
    let lights = if inputs.model.is_smooth() { 26.0 } else { 8.0 };
    let work = pairs * lights * engine.light_work() + OTHER_STAGES * inputs.other_files_bytes as f64 + DRAWING_WORK;
    Need::new([others, drawn, compared], work)
}
