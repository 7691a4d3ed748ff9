//! What the service does, in domain words, below wire and HTTP.
//!
//! Each resource has a small struct whose methods are its use cases. It has only what it needs. It takes and returns
//! domain types. Refusals name the field of the request that they are about, as everybody who asks knows it.
//!
//! # Layout
//!
//! - [`Displays`], [`Datasets`], [`Jobs`], [`Kernels`], [`Photos`], [`Webhooks`], [`Devices`]: the resources.
//! - [`Promotions`], [`Rollouts`]: which version is active, and where. [`Manifests`]: what devices trust.
//! - [`Files`]: artifacts, as callers read and store them.
//! - [`Computing`]: what calls compute, in fair turns, with a limit on its memory.
//! - [`Call`]: who asks. [`Client`]: for whom it is counted. [`permissions`]: which displays, devices and owners a caller
//!   may name.
//! - [`Field`]: checks of values, by the paths of their fields. [`check_all!`], [`collect_all`]: checks that go on, so that
//!   a refusal names all wrong fields. [`propagation`], [`region_of`]: checks of what light can do.
//! - [`ServiceError`]: why a request is refused or fails.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod call;
mod client;
mod computing;
mod datasets;
mod devices;
mod displays;
mod error;
mod field;
mod files;
mod jobs;
mod kernels;
mod manifests;
pub mod permissions;
mod photos;
mod promotions;
pub mod propagation;
mod region;
mod rollouts;
mod webhooks;
mod wrong_fields;

pub use call::Call;
pub use client::Client;
pub use computing::Computing;
pub use datasets::{CalibrationTarget, Datasets};
pub use devices::Devices;
pub use displays::Displays;
pub use error::{Fix, LimitReason, Result, ServiceError, WrongField, text_of_wrong};
pub use field::{Field, shortened};
pub use files::{Files, Minus, UploadState};
pub use jobs::{CheckedJob, JobLimits, Jobs, Outlook, QueueState, Submission, WaitReason, Waiting};
pub use kernels::{Converted, KernelChoice, KernelImport, Kernels, VersionFile, for_device};
pub use manifests::{Issued, ManifestRules, Manifests};
pub use photos::{PhotoScore, Photos, ScoreRequest};
pub use promotions::{Passage, Promotions, Verdict};
pub use region::region_of;
pub use rollouts::Rollouts;
pub use webhooks::{NewWebhook, Webhooks};
pub use wrong_fields::{all_of, collect_all, is_about_fields, missing, within};

use lightpath_artifacts::Artifacts;
use lightpath_domain::origin::Origins;
use lightpath_store::{QueueLimits, Store};
use tokio_util::sync::CancellationToken;

/// Limits on what clients may use.
#[derive(Clone, Copy, Debug)]
pub struct ServiceLimits {
    /// Limits on the queue.
    pub queue: QueueLimits,
    /// Limits on jobs.
    pub jobs: JobLimits,
    /// Memory that computations for calls may use together \[bytes\]; one client may use half of it.
    pub computing_bytes: u64,
    /// How long manifests count, and how often devices ask.
    pub manifests: ManifestRules,
}

/// All use cases, by resource. Clones share what they remember.
#[derive(Clone, Debug)]
pub struct Service {
    /// Displays.
    pub displays: Displays,
    /// Datasets.
    pub datasets: Datasets,
    /// Jobs and their queue.
    pub jobs: Jobs,
    /// Kernels and their versions.
    pub kernels: Kernels,
    /// Which versions are active.
    pub promotions: Promotions,
    /// Versions on their way to devices.
    pub rollouts: Rollouts,
    /// Devices in the field.
    pub devices: Devices,
    /// What devices trust.
    pub manifests: Manifests,
    /// Photographs of pictures.
    pub photos: Photos,
    /// Addresses that learn of events.
    pub webhooks: Webhooks,
    /// Artifacts.
    pub files: Files,
}

impl Service {
    /// The service on a store and its artifacts. Webhooks may go to `webhook_origins`. Cancelling `stopping` ends what no
    /// call waits for.
    #[must_use]
    pub fn new(
        store: &Store,
        artifacts: &Artifacts,
        limits: &ServiceLimits,
        webhook_origins: Origins,
        stopping: CancellationToken,
    ) -> Self {
        let store = || store.clone();
        let artifacts = || artifacts.clone();
        let computing = Computing::new(limits.computing_bytes);
        let files = Files::new(store(), artifacts(), computing.clone(), limits.queue.stored_bytes_per_owner);
        let datasets = Datasets::new(store(), artifacts(), computing.clone(), files.clone());
        let kernels = Kernels::new(store(), artifacts(), computing.clone(), files.clone(), stopping);
        let promotions = Promotions::new(store(), kernels.clone());
        let used = (files.clone(), datasets.clone(), kernels.clone());
        Self {
            displays: Displays::new(store()),
            jobs: Jobs::new(store(), artifacts(), used, (limits.jobs, limits.queue)),
            rollouts: Rollouts::new(store(), promotions.clone()),
            devices: Devices::new(store(), kernels.clone()),
            manifests: Manifests::new(store(), kernels.clone(), limits.manifests),
            photos: Photos::new(artifacts(), computing, files.clone()),
            webhooks: Webhooks::new(store(), webhook_origins),
            datasets,
            kernels,
            promotions,
            files,
        }
    }
}
