//! What a report is made of.

use super::evidence::Evidence;
use lightpath_domain::kernel::KernelVersion;
use lightpath_optics::DisplayModel;

/// Everything that a report is made of.
#[derive(Debug)]
pub struct ReportInput {
    /// What it is about.
    pub version: KernelVersion,
    /// The same as a model.
    pub model: DisplayModel,
    /// Losses while it was learned; empty where that is not known.
    pub loss_history: Vec<f64>,
    /// From the dataset; `None` for imports, and where the dataset can't be read any more.
    pub evidence: Option<Evidence>,
    /// Other versions of the same kernel, newest first.
    pub earlier: Vec<Earlier>,
    /// The model at each distance that it was learned for, ascending; empty where that is one alone.
    pub over_distance: Vec<DisplayModel>,
}

/// Another version of the kernel.
#[derive(Clone, Debug)]
pub struct Earlier {
    /// Its number.
    pub version: u32,
    /// Held-out loss; `None` where nothing was held out.
    pub test_loss: Option<f64>,
    /// Itself.
    pub model: DisplayModel,
}
