//! What a job that prepares a dataset is to do, and what it gave.

use crate::dataset::{Alignment, Finalization, Finding};
use lightpath_optics::alignment::PointPair;
use serde::{Deserialize, Serialize};

/// Make a dataset ready to be learned from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PrepareDataset {
    /// Id of the dataset.
    pub dataset: String,
    /// Id of the dataset's display.
    pub display: String,
    /// What to do with it.
    pub step: PrepareStep,
}

/// What a job does with a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PrepareStep {
    /// Find where the camera sees the display's pixels.
    Align(AlignBy),
    /// Align the photographs where they need it, draw the split and close the dataset for good.
    Finalize(Finalization),
}

/// What an alignment is found from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AlignBy {
    /// Given points.
    Points {
        /// Columns of the photographs \[px\].
        photo_width_px: u32,
        /// Rows of the photographs \[px\].
        photo_height_px: u32,
        /// At least 4 that do not lie on a line.
        points: Vec<PointPair>,
    },
    /// The photograph of the displayed dots.
    Dots {
        /// Artifact digest.
        photo: String,
    },
    /// The pairs that are there.
    Pairs,
    /// Nothing: one camera pixel a pixel of the display.
    None,
}

/// A dataset as a job left it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PrepareResult {
    /// Where the camera sees the display's pixels; `None`: one camera pixel a pixel of the display.
    pub alignment: Option<Alignment>,
    /// What should be known about the pairs and the dataset.
    pub findings: Vec<Finding>,
    /// Of a dataset that was finalized; filled in by the store. No artifact has this digest: the store's references to
    /// artifacts pass over a field of this name.
    pub dataset_digest: Option<String>,
    /// How many pairs are for what, in a dataset that was finalized.
    pub splits: SplitCounts,
}

/// How many pairs are for what.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SplitCounts {
    /// Learned from.
    pub train: u32,
    /// Watched while learning.
    pub validation: u32,
    /// Looked at once, after learning.
    pub test: u32,
    /// For nothing: nothing can be learned from them.
    pub left_out: u32,
}
