//! Jobs that prepare a dataset for learning: request and result.

use crate::dataset::{Alignment, Finalization, Finding};
use lightpath_camera::alignment::PointPair;
use serde::{Deserialize, Serialize};

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
    /// Numbers of pairs in a finalized dataset, by their use.
    pub splits: SplitCounts,
}

/// Numbers of pairs by their use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SplitCounts {
    /// Number of pairs for learning.
    pub train: u32,
    /// Number of pairs for watching the loss during learning.
    pub validation: u32,
    /// Number of pairs for measuring the kernel once, after learning.
    pub test: u32,
    /// Number of pairs that are not used, because of their findings.
    pub left_out: u32,
}
