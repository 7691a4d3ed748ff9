//! Enumerations that are words for people, programs and the database; and the reasons of errors and refusals, as codes in
//! capitals for programs. A word or code is the same in every version.

/// Declares an enum whose variants are words for people, programs and the database. Each variant has a description and a
/// word, which is also the text that serde writes.
#[macro_export]
macro_rules! words {
    (
        $(#[$about:meta])*
        pub enum $name:ident { $($(#[$means:meta])+ $variant:ident = $word:literal,)+ }
    ) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
        pub enum $name {
            $($(#[$means])+ #[serde(rename = $word)] $variant,)+
        }

        impl $name {
            /// All values.
            pub const ALL: [Self; [$($word),+].len()] = [$(Self::$variant),+];

            /// The word for the value.
            #[must_use]
            pub fn as_str(self) -> &'static str {
                match self {
                    $(Self::$variant => $word,)+
                }
            }
        }
    };
}

/// Declares an enum of reasons: [`words!`](crate::words), which are codes, and their
/// [`Display`](std::fmt::Display).
#[macro_export]
macro_rules! reasons {
    ($(#[$about:meta])* pub enum $name:ident { $($variants:tt)+ }) => {
        $crate::words! {
            $(#[$about])*
            pub enum $name { $($variants)+ }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.as_str())
            }
        }
    };
}

reasons! {
    /// Why the present state does not allow a request, as a code for programs.
    pub enum PreconditionReason {
        /// The version is active already.
        AlreadyActive = "ALREADY_ACTIVE",
        /// The dataset from which the kernel version was learned was deleted.
        DatasetDeleted = "DATASET_DELETED",
        /// The dataset has no pairs.
        DatasetEmpty = "DATASET_EMPTY",
        /// The dataset is finalized and can no longer change.
        DatasetFinalized = "DATASET_FINALIZED",
        /// The dataset has reached its limit of pairs.
        DatasetFull = "DATASET_FULL",
        /// A waiting or running job reads or prepares the dataset.
        DatasetInUse = "DATASET_IN_USE",
        /// The dataset is not finalized.
        DatasetOpen = "DATASET_OPEN",
        /// The training or test part of the dataset has no pairs.
        DatasetSplitEmpty = "DATASET_SPLIT_EMPTY",
        /// A job that this job waits for has failed or was cancelled.
        DependencyEnded = "DEPENDENCY_ENDED",
        /// The display has reached its limit of devices.
        DevicesFull = "DEVICES_FULL",
        /// The display has reached its limit of datasets.
        DisplayFull = "DISPLAY_FULL",
        /// Jobs, datasets or kernels refer to the display.
        DisplayInUse = "DISPLAY_IN_USE",
        /// The job has ended.
        JobEnded = "JOB_ENDED",
        /// The job needs more memory or time than the server gives a job.
        JobTooLarge = "JOB_TOO_LARGE",
        /// The job has neither failed nor been cancelled.
        JobNotRetryable = "JOB_NOT_RETRYABLE",
        /// The kernel has reached its limit of versions.
        KernelFull = "KERNEL_FULL",
        /// The stored kernel file cannot be read.
        KernelUnreadable = "KERNEL_UNREADABLE",
        /// The kernel has no active version.
        NoActiveKernel = "NO_ACTIVE_KERNEL",
        /// The kernel has no earlier active version.
        NoEarlierVersion = "NO_EARLIER_VERSION",
        /// No kernels of the display were learned together at several distances.
        NoJointFit = "NO_JOINT_FIT",
        /// The server has no key that may sign manifests.
        NoSigningKey = "NO_SIGNING_KEY",
        /// The kernel cannot be written in this format.
        NoSuchForm = "NO_SUCH_FORM",
        /// The queue is not paused.
        NotPaused = "NOT_PAUSED",
        /// The dataset has no alignment.
        DatasetNotAligned = "DATASET_NOT_ALIGNED",
        /// The display has no simulated bench.
        NotSimulated = "NOT_SIMULATED",
        /// The server runs no jobs.
        NoJobsHere = "NO_JOBS_HERE",
        /// The rig of another token serves the display.
        RigBusy = "RIG_BUSY",
        /// Another connection of the same token serves the display now.
        RigReplaced = "RIG_REPLACED",
        /// A waiting or running job of the same owner has the same unique key.
        NotUnique = "NOT_UNIQUE",
        /// The version does not pass the promotion gate of the display.
        PromotionGateFailed = "PROMOTION_GATE_FAILED",
        /// The rollout has ended.
        RolloutEnded = "ROLLOUT_ENDED",
        /// A rollout of the kernel is running.
        RolloutRunning = "ROLLOUT_RUNNING",
        /// The version is deprecated.
        VersionDeprecated = "VERSION_DEPRECATED",
        /// The setting `webhook_origins` does not allow the address.
        WebhookOriginNotAllowed = "WEBHOOK_ORIGIN_NOT_ALLOWED",
        /// The server has reached its limit of webhooks.
        WebhooksFull = "WEBHOOKS_FULL",
    }
}
