//! Where kernel versions come from: photographs, other distances, or files.

use crate::kernel_format::KernelFormat;
use crate::units::Distance;
use lightpath_optics::{Detector, KernelModel, RegionOfInterest};
use serde::{Deserialize, Serialize};

/// Origin of a kernel version.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KernelLineage {
    /// How the version was made.
    pub origin: KernelOrigin,
    /// Version of the server that made the kernel version.
    pub code_version: String,
}

/// How a kernel version was made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum KernelOrigin {
    /// It was learned from photographs.
    Learned(Learning),
    /// It was interpolated between the distances of a learning, because its own distance was not photographed.
    Interpolated(Learning),
    /// It was imported from a file.
    Imported(Import),
}

/// The learning from which a version comes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Learning {
    /// Id of the job; empty: unknown.
    pub job: String,
    /// Datasets from which the version was learned. The first one has the version's own distance. If one model was
    /// learned for several distances, the datasets of the other distances follow, ascending. For an interpolated
    /// version, all are ascending.
    pub datasets: Vec<LearnedDataset>,
    /// Resource name of the version from which learning started; `None`: the ideal kernel.
    pub parent_version: Option<String>,
    /// What was asked of the learning; `None`: unknown.
    pub parameters: Option<LearningParameters>,
}

/// A dataset from which a version was learned.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LearnedDataset {
    /// Distance from the SLM to the plane of the camera.
    pub distance: Distance,
    /// Id of the dataset; empty: unknown.
    pub id: String,
    /// Digest of the dataset; empty: unknown.
    pub digest: String,
}

/// What can be asked of a learning.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearningParameters {
    /// Model of the kernel.
    pub model: KernelModel,
    /// Highest polynomial degree of the smooth errors; `None`: the validation pairs decide.
    pub degree: Option<u32>,
    /// Number of passes over the training pairs; `None`: the model's default.
    pub epochs: Option<u32>,
    /// Learning rate of Adam; `None`: the model's default.
    pub learning_rate: Option<f64>,
    /// Most evaluations of all pairs in the refinement after Adam; `None`: the model's default.
    pub refinement_evaluations: Option<u32>,
    /// Seed of the order in which pairs are used, and of the random start of the `paper` model.
    pub seed: u64,
    /// Rule that defines the light of a camera pixel.
    pub detector: Detector,
    /// Region of the photographs that is compared.
    pub region_of_interest: RegionOfInterest,
}

/// The file from which a version was imported.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Import {
    /// Form of the file.
    pub format: KernelFormat,
    /// Artifact digest of the file.
    pub artifact: String,
    /// What the file did not hold of a whole model, as a sentence; `None`: it held one.
    pub note: Option<String>,
    /// The version in a bundle, where it was made; `None`: the file was no bundle.
    pub version: Option<OriginalVersion>,
    /// How the version was made, as far as the file says it. Names are those of the server where it was made.
    pub made: Option<Made>,
}

/// A version on the server that made it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct OriginalVersion {
    /// Resource name there.
    pub name: String,
    /// Time when it was made \[ms since 1970\].
    pub create_time_ms: i64,
}

/// How a version was made that came in a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Made {
    /// It was learned from photographs.
    Learned(Learning),
    /// It was interpolated between the distances of a learning.
    Interpolated(Learning),
}

impl KernelLineage {
    /// The lineage of a version that this server makes.
    #[must_use]
    pub fn of(origin: KernelOrigin) -> Self {
        Self { origin, code_version: env!("CARGO_PKG_VERSION").to_owned() }
    }

    /// The learning from which the version comes, here or on another server; `None`: unknown.
    #[must_use]
    pub fn learning(&self) -> Option<&Learning> {
        match &self.origin {
            KernelOrigin::Learned(learning) | KernelOrigin::Interpolated(learning) => Some(learning),
            KernelOrigin::Imported(import) => import.made.as_ref().map(Made::learning),
        }
    }

    /// What was asked of the learning; `None`: unknown.
    #[must_use]
    pub fn parameters(&self) -> Option<&LearningParameters> {
        self.learning()?.parameters.as_ref()
    }

    /// Id of the learning job; empty: unknown.
    #[must_use]
    pub fn job(&self) -> &str {
        self.learning().map_or("", |learning| &learning.job)
    }

    /// The datasets of the learning; empty: unknown.
    #[must_use]
    pub fn datasets(&self) -> &[LearnedDataset] {
        self.learning().map_or(&[], |learning| &learning.datasets)
    }

    /// Whether the version was interpolated: its distance lies between those of the datasets.
    #[must_use]
    pub fn is_interpolated(&self) -> bool {
        match &self.origin {
            KernelOrigin::Learned(_) => false,
            KernelOrigin::Interpolated(_) => true,
            KernelOrigin::Imported(import) => matches!(import.made, Some(Made::Interpolated(_))),
        }
    }

    /// The dataset of the version's own distance; `None`: unknown, or the version was interpolated.
    #[must_use]
    pub fn own_dataset(&self) -> Option<&LearnedDataset> {
        self.datasets().first().filter(|_| !self.is_interpolated())
    }

    /// The distances for which one model was learned jointly, ascending; `None`: the version was learned for one
    /// distance.
    #[must_use]
    pub fn joint_distances(&self) -> Option<Vec<Distance>> {
        let is_joint = self.is_interpolated() || self.datasets().len() > 1;
        is_joint.then(|| {
            let mut distances: Vec<Distance> = self.datasets().iter().map(|dataset| dataset.distance).collect();
            distances.sort_unstable();
            distances
        })
    }
}

impl Import {
    /// The import of a file that holds a whole model and says nothing about its origin.
    #[must_use]
    pub fn of(format: KernelFormat, artifact: String) -> Self {
        Self { format, artifact, note: None, version: None, made: None }
    }
}

impl Made {
    fn learning(&self) -> &Learning {
        match self {
            Self::Learned(learning) | Self::Interpolated(learning) => learning,
        }
    }
}
