//! Jobs that prepare a dataset for learning: request, result, memory and time.

use super::Kind;
use crate::dataset::{Alignment, Finalization, Finding, SplitCounts};
use crate::job::estimate::{ALIGNMENT_BYTES_MAX, ALIGNMENT_PAIRS_MAX, Need, PairsSize, REAL};
use lightpath_camera::alignment::PointPair;
use lightpath_optics::memory::EngineSize;
use serde::{Deserialize, Serialize};
use std::slice;

/// Request to prepare a dataset for learning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PrepareDataset {
    /// Id of the dataset.
    pub dataset: String,
    /// Id of the dataset's display.
    pub display: String,
    /// Step of the preparation.
    pub step: PrepareStep,
}

/// A step of preparing a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PrepareStep {
    /// Find the map from pixels of the display to pixels of the camera.
    Align(AlignBy),
    /// Align the photographs if they need it, draw the split, and close the dataset for good.
    Finalize(Finalization),
}

/// Source of an alignment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AlignBy {
    /// Points that the user gave.
    Points {
        /// Columns of the photographs \[px\].
        photo_width_px: u32,
        /// Rows of the photographs \[px\].
        photo_height_px: u32,
        /// Points: at least 4, not all on one line.
        points: Vec<PointPair>,
    },
    /// A photograph of the displayed grid of dots.
    Dots {
        /// Artifact digest of the photograph.
        photo: String,
    },
    /// The pairs of the dataset.
    Pairs,
    /// No source. The alignment is removed: one camera pixel for each pixel of the display.
    None,
}

/// Result of preparing a dataset: the state of the dataset at the end of the job.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PrepareResult {
    /// Map from pixels of the display to pixels of the camera; `None`: one camera pixel for each pixel of the display.
    pub alignment: Option<Alignment>,
    /// Findings about the pairs and the dataset.
    pub findings: Vec<Finding>,
    /// Digest of the finalized dataset, filled in by the store. It is not the digest of an artifact. The store's search
    /// for references to artifacts therefore skips fields of this name.
    pub dataset_digest: Option<String>,
    /// Numbers of pairs by their use; `None`: the dataset is open.
    pub split_counts: Option<SplitCounts>,
}

impl Kind for PrepareDataset {
    fn display(&self) -> &str {
        &self.display
    }

    fn datasets(&self) -> &[String] {
        slice::from_ref(&self.dataset)
    }
}

/// What a job that aligns or finalizes a dataset needs, besides its specification.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreparingInputs {
    /// Engine of the ideal display.
    pub engine: EngineSize,
    /// Pairs of the dataset.
    pub pairs: PairsSize,
    /// Whether finalizing the dataset aligns it first.
    pub needs_alignment: bool,
    /// Memory for decoding the photograph of the dots \[bytes\].
    pub dots_bytes: u64,
}

/// Need of a job that aligns or finalizes a dataset.
#[must_use]
pub fn need(step: &PrepareStep, inputs: &PreparingInputs) -> Need {
    /// Memory for the correlations of all tiles, and for the spectra of those under way \[bytes\].
    const TILES_BYTES: u64 = 26 << 20;
    let PreparingInputs { engine, pairs, needs_alignment, dots_bytes } = *inputs;
    let n = engine.pixels();
    let by_pairs = match step {
        PrepareStep::Align(by) => matches!(by, AlignBy::Pairs),
        // Pairs that are measured again may then need an alignment.
        PrepareStep::Finalize(options) => !options.keep_alignment && (needs_alignment || pairs.is_stale),
    };
    let by_dots = matches!(step, PrepareStep::Align(AlignBy::Dots { .. }));
    let measures = by_pairs || pairs.is_stale || matches!(step, PrepareStep::Align(_));
    let reconstructor = engine.engine_bytes() + engine.scratch_bytes();
    // Phase, photograph, and its copy on the display's grid; then the reconstruction.
    let reading = pairs.decoding_bytes + 3 * REAL * n;
    let compared = engine.light_bytes().max(TILES_BYTES) + 4 * REAL * n;
    let checked = reconstructor + engine.sampling_bytes.max(reading).max(compared);
    let pair = REAL * (n + pairs.photo_px);
    let together = (ALIGNMENT_BYTES_MAX as u64 / pair).clamp(1, ALIGNMENT_PAIRS_MAX as u64).min(pairs.all as u64);
    let next = reading.max(engine.light_bytes() + REAL * n).max(TILES_BYTES + REAL * n);
    let registered = reconstructor + together * pair + next;
    let stages = [
        if measures { checked } else { 0 },
        if by_pairs { registered } else { 0 },
        // A photograph of dots is blurred several times.
        if by_dots { 4 * dots_bytes + 2 * REAL * n } else { 0 },
    ];
    let lights = if measures { 2 * pairs.all } else { 0 } + if by_pairs { 6 * ALIGNMENT_PAIRS_MAX } else { 0 };
    let sampling = if measures || by_pairs { engine.sampling_work as f64 } else { 0.0 };
    Need::new(stages, 3.0 * lights as f64 * engine.light_work() + sampling)
}
