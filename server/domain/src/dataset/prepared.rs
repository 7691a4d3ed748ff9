//! Datasets made ready to be learned from.

use super::{Alignment, Finding, PairChecks, Split};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How a dataset is finalized.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finalization {
    /// Part of the pairs without a split that is drawn for validation.
    pub validation_fraction: f64,
    /// Part of the pairs without a split that is drawn for the test.
    pub test_fraction: f64,
    /// Of the draw.
    pub seed: u64,
    /// The alignment stays as it is, however far off the photographs are.
    pub keep_alignment: bool,
}

/// Every pair's id with its split, in the order of the ids; no split: the pair is left out.
pub type Splits = Vec<(String, Option<Split>)>;

/// What a job found out about a dataset, to be stored when the job ends.
#[derive(Clone, Debug, PartialEq)]
pub struct PreparedDataset {
    /// Id of the dataset.
    pub dataset: String,
    /// The revision of the dataset that the job read. A dataset that has another one by now stays as it is.
    pub revision: u64,
    /// The alignment from now on.
    pub alignment: Option<Alignment>,
    /// Measured again, by the ids of the pairs.
    pub checks: BTreeMap<String, PairChecks>,
    /// What should be known about the pairs and the dataset.
    pub findings: Vec<Finding>,
    /// Closes the dataset for good; `None`: it stays open.
    pub closing: Option<(Finalization, Splits)>,
}
