//! What jobs change beside their own result.

use crate::dataset::PreparedDataset;
use crate::kernel::{KernelKey, NewKernelVersion};

/// What a job changes in the transaction that ends it: there is never the one without the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum JobEffect {
    /// Nothing.
    #[default]
    None,
    /// Kernels get their next versions, in the order in which the result names them.
    Kernels(Vec<(KernelKey, NewKernelVersion)>),
    /// A dataset gets what was found out about it.
    Dataset(Box<PreparedDataset>),
}
