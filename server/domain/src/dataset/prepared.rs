//! The preparation of datasets for learning.

use super::{Alignment, Finding, PairChecks, Split};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Options with which a dataset is finalized.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finalization {
    /// Fraction of the pairs without a given split that is drawn for validation.
    pub validation_fraction: f64,
    /// Fraction of the pairs without a given split that is drawn for testing.
    pub test_fraction: f64,
    /// Seed of the draw.
    pub seed: u64,
    /// Whether the alignment is kept even if the photographs are misaligned.
    pub keep_alignment: bool,
}

/// Ids of all pairs with their splits, in the order of the ids. `None`: the pair is not used.
pub type Splits = Vec<(String, Option<Split>)>;

/// Numbers of a finalized dataset's pairs by their use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SplitCounts {
    /// Pairs for learning.
    pub train: u32,
    /// Pairs for validation.
    pub validation: u32,
    /// Pairs for testing.
    pub test: u32,
    /// Pairs that are not used.
    pub excluded: u32,
}

impl SplitCounts {
    /// Counts pairs by their use; `None`: the pair is not used.
    #[must_use]
    pub fn of(splits: impl IntoIterator<Item = Option<Split>>) -> Self {
        let mut counts = Self::default();
        for split in splits {
            *match split {
                Some(Split::Train) => &mut counts.train,
                Some(Split::Validation) => &mut counts.validation,
                Some(Split::Test) => &mut counts.test,
                None => &mut counts.excluded,
            } += 1;
        }
        counts
    }
}

/// Changes of a dataset that a job prepared. The store makes them when the job ends.
#[derive(Clone, Debug, PartialEq)]
pub struct PreparedDataset {
    /// Id of the dataset.
    pub dataset: String,
    /// Revision of the dataset that the job read. If the dataset has another revision when the job ends, the store
    /// refuses the changes.
    pub revision: u64,
    /// New alignment.
    pub alignment: Option<Alignment>,
    /// New measurements, by the ids of the pairs. Pairs that are missing here keep their measurements.
    pub checks: BTreeMap<String, PairChecks>,
    /// New findings about the pairs and the dataset.
    pub findings: Vec<Finding>,
    /// Options and splits that finalize the dataset; `None`: the dataset stays open.
    pub closing: Option<(Finalization, Splits)>,
}
