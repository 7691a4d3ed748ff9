//! Jobs that measure a kernel on a dataset: request, result, memory and time.

use super::Kind;
use crate::dataset::Split;
use crate::job::estimate::{FILE_STAGES, KernelSize, Need, PairsSize, REAL};
use crate::kernel::KernelKey;
use lightpath_optics::{RegionOfInterest, ValidityReport};
use serde::{Deserialize, Serialize};
use std::slice;

/// Request to measure a kernel on a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluateKernel {
    /// Id of the dataset.
    pub dataset: String,
    /// Kernel of the dataset's display, wavelength and distance.
    pub kernel: KernelKey,
    /// Number of the kernel version; `None`: the ideal kernel.
    pub kernel_version: Option<u32>,
    /// Region of the photographs that is compared.
    pub region_of_interest: RegionOfInterest,
}

/// Losses of a kernel on the pairs of a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluateResult {
    /// Losses in the order of the pairs' ids.
    pub pairs: Vec<PairLoss>,
    /// Propagation method of the kernel, and its limits.
    pub propagation: ValidityReport,
}

/// Loss of a kernel on one pair: mean squared error without saturated pixels, with fitted gain and black level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PairLoss {
    /// Id of the pair.
    pub pair: String,
    /// Use of the pair.
    pub split: Split,
    /// Loss in the region of interest.
    pub loss: f64,
    /// Loss over the full frame.
    pub loss_full_frame: f64,
}

impl Kind for EvaluateKernel {
    fn display(&self) -> &str {
        &self.kernel.display
    }

    fn datasets(&self) -> &[String] {
        slice::from_ref(&self.dataset)
    }

    fn kernels(&self) -> Vec<(KernelKey, Option<u32>)> {
        vec![(self.kernel.clone(), self.kernel_version)]
    }
}

/// Need of a job that measures a kernel on a dataset.
#[must_use]
pub fn need(kernel: &KernelSize, pairs: &PairsSize) -> Need {
    let engine = kernel.engine;
    let n = engine.pixels();
    let kept = pairs.kept_bytes(n, 1).into_iter().max().unwrap_or(0);
    let compared = engine.fields_bytes() + engine.scratch_bytes() + 5 * REAL * n;
    let stages = [
        engine.engine_bytes() + kernel.reading_bytes(),
        engine.engine_bytes() + kernel.numbers_bytes() + kept + compared.max(pairs.reading_bytes(n)),
    ];
    let files = 0.4 * pairs.all as f64 * FILE_STAGES * n as f64;
    Need::new(stages, pairs.all as f64 * 2.4 * engine.light_work() + files + engine.sampling_work as f64)
}
