//! Datasets: immutable sets of (phase hologram, photograph) pairs.

use crate::units::{Distance, Wavelength};
use serde::{Deserialize, Serialize};

/// A dataset with its pairs.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset {
    /// Last part of the resource name.
    pub id: String,
    /// Id of the display.
    pub display: String,
    /// One of the display's.
    pub wavelength: Wavelength,
    /// From the SLM to the camera's plane.
    pub distance: Distance,
    /// How the photographs' grey values stand for light.
    pub photo_encoding: Encoding,
    /// In the order of their ids.
    pub pairs: Vec<Pair>,
    /// Number of pairs, also where `pairs` was left out.
    pub pair_count: u32,
    /// Digest of everything above and the split; set when finalized.
    pub digest: Option<String>,
    /// [ms since 1970]
    pub create_time_ms: i64,
    /// [ms since 1970]
    pub finalize_time_ms: Option<i64>,
}

/// How grey values stand for light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Encoding {
    /// Value / full scale is the intensity.
    Linear,
    /// IEC 61966-2-1.
    Srgb,
}

/// One hologram and its photograph, by digest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pair {
    /// Unique in the dataset.
    pub id: String,
    /// Artifact digest of the hologram.
    pub phase: String,
    /// Artifact digest of the photograph.
    pub photo: String,
    /// What the pair is used for; drawn when the dataset is finalized unless given.
    pub split: Option<Split>,
}

/// What a pair is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Split {
    /// Learned from.
    Train,
    /// Watched while learning.
    Validation,
    /// Looked at once, after learning.
    Test,
}
