//! Changes that jobs make besides their own result.

use crate::dataset::PreparedDataset;
use crate::kernel::{KernelKey, NewKernelVersion};

/// A change that a job makes when it ends. The store makes the change and ends the job in one transaction.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum JobEffect {
    /// No change.
    #[default]
    None,
    /// New kernel versions, in the order of the kernels in the result.
    Kernels(Vec<(KernelKey, NewKernelVersion)>),
    /// Alignment, measurements and findings of a dataset, and its split if the job finalizes it.
    Dataset(Box<PreparedDataset>),
}
