//! Each kind of job: its request, its result, and the memory and the time that it needs. A kind has a file here, and a
//! row in the table of all kinds.

pub mod capture_photos;
pub mod evaluate_kernel;
pub mod learn_kernel;
pub mod optimize_hologram;
pub mod prepare_dataset;
pub mod report_kernel;
pub mod simulate_capture;
pub mod suggest_holograms;
pub mod verify_hologram;

use crate::kernel::KernelKey;
use capture_photos::{CapturePhotos, CapturePhotosResult};
use evaluate_kernel::{EvaluateKernel, EvaluateResult};
use learn_kernel::{LearnKernel, LearnResult};
use optimize_hologram::{HologramResult, OptimizeHologram};
use prepare_dataset::{PrepareDataset, PrepareResult};
use report_kernel::{ReportKernel, ReportResult};
use serde::{Deserialize, Serialize};
use simulate_capture::{CaptureResult, SimulateCapture};
use suggest_holograms::{SuggestHolograms, SuggestResult};
use verify_hologram::{VerifyHologram, VerifyResult};

/// A request of one kind.
trait Kind {
    /// Id of the display.
    fn display(&self) -> &str;

    /// Ids of the datasets that the job reads or prepares.
    fn datasets(&self) -> &[String] {
        &[]
    }

    /// Kernels that the job uses, with the number of the version; `None`: the ideal one.
    fn kernels(&self) -> Vec<(KernelKey, Option<u32>)> {
        Vec::new()
    }

    /// Whether the job needs the rig of its display.
    fn needs_rig(&self) -> bool {
        false
    }
}

/// Declares all kinds, each with the word for it, its request and its result.
macro_rules! kinds {
    ($($(#[$about:meta])+ $kind:ident($request:ty) = $word:literal => $answer:ty,)+) => {
        /// Work that a job must do.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "kind")]
        pub enum JobSpec {
            $($(#[$about])+ #[serde(rename = $word)] $kind($request),)+
        }

        /// Result of a job.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "kind")]
        pub enum JobResult {
            $(#[doc = concat!("Result of [`", stringify!($kind), "`].")] #[serde(rename = $word)] $kind($answer),)+
        }

        impl JobSpec {
            /// Words for all kinds of jobs.
            pub const KINDS: [&'static str; [$($word),+].len()] = [$($word),+];

            /// The word for the job's kind, as it is stored.
            #[must_use]
            pub fn kind(&self) -> &'static str {
                match self {
                    $(Self::$kind(_) => $word,)+
                }
            }

            /// Id of the job's display.
            #[must_use]
            pub fn display(&self) -> &str {
                match self {
                    $(Self::$kind(request) => request.display(),)+
                }
            }

            /// Ids of the job's datasets.
            #[must_use]
            pub fn datasets(&self) -> &[String] {
                match self {
                    $(Self::$kind(request) => request.datasets(),)+
                }
            }

            /// Whether the job needs the rig of its display.
            #[must_use]
            pub fn needs_rig(&self) -> bool {
                match self {
                    $(Self::$kind(request) => request.needs_rig(),)+
                }
            }

            /// Kernels that the job uses, with the number of the version; `None`: the ideal one. A hologram job has one for
            /// each wavelength and plane, starting with all planes of the first wavelength.
            #[must_use]
            pub fn kernels(&self) -> Vec<(KernelKey, Option<u32>)> {
                match self {
                    $(Self::$kind(request) => request.kernels(),)+
                }
            }
        }
    };
}

kinds! {
    /// Compute holograms that show targets.
    OptimizeHologram(Box<OptimizeHologram>) = "optimize_hologram" => Box<HologramResult>,
    /// Learn kernels from datasets.
    LearnKernel(LearnKernel) = "learn_kernel" => LearnResult,
    /// Photograph a hologram on a simulated display.
    SimulateCapture(SimulateCapture) = "simulate_capture" => CaptureResult,
    /// Measure a kernel on a dataset.
    EvaluateKernel(EvaluateKernel) = "evaluate_kernel" => EvaluateResult,
    /// Prepare a dataset for learning.
    PrepareDataset(PrepareDataset) = "prepare_dataset" => PrepareResult,
    /// Make the report of a kernel version.
    ReportKernel(ReportKernel) = "report_kernel" => ReportResult,
    /// Judge holograms by an independent model.
    VerifyHologram(VerifyHologram) = "verify_hologram" => VerifyResult,
    /// Suggest holograms to photograph.
    SuggestHolograms(SuggestHolograms) = "suggest_holograms" => SuggestResult,
    /// Photograph patterns at the bench of a display.
    CapturePhotos(CapturePhotos) = "capture_photos" => CapturePhotosResult,
}

impl JobSpec {
    /// Id of the job's dataset. If the job has several datasets, it is the first.
    #[must_use]
    pub fn dataset(&self) -> Option<&str> {
        self.datasets().first().map(String::as_str)
    }
}
