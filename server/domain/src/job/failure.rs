//! Why attempts at jobs fail.

use serde::{Deserialize, Serialize};

/// Why an attempt ended without success.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JobError {
    /// For programs.
    pub reason: FailureReason,
    /// For people.
    pub message: String,
    /// The job will be tried again by itself.
    pub retryable: bool,
}

crate::reasons! {
    /// Why an attempt failed, for programs.
    pub enum FailureReason {
        /// The dataset's photographs have another size than those of the alignment.
        AlignmentSize = "ALIGNMENT_SIZE",
        /// An artifact that the job names is gone.
        ArtifactNotFound = "ARTIFACT_NOT_FOUND",
        /// The job's state could not be written as a checkpoint.
        Checkpoint = "CHECKPOINT",
        /// A stored file no longer matches its digest.
        DataLoss = "DATA_LOSS",
        /// The dataset was changed while the job prepared it.
        DatasetChanged = "DATASET_CHANGED",
        /// The dataset is finalized, and does not change any more.
        DatasetFinalized = "DATASET_FINALIZED",
        /// The dataset is not finalized.
        DatasetOpen = "DATASET_OPEN",
        /// A part of the dataset's split has no pairs.
        DatasetSplitEmpty = "DATASET_SPLIT_EMPTY",
        /// A file of the dataset cannot be read.
        DatasetUnreadable = "DATASET_UNREADABLE",
        /// Most of the dataset's pairs cannot be learned from.
        DatasetUnusable = "DATASET_UNUSABLE",
        /// A job that this one comes after did not succeed.
        DependencyFailed = "DEPENDENCY_FAILED",
        /// No space is left on the disk.
        DiskFull = "DISK_FULL",
        /// A number became infinite or NaN.
        Diverged = "DIVERGED",
        /// The engine refuses what the job asks for.
        InvalidInput = "INVALID_INPUT",
        /// A kernel's file cannot be read.
        InvalidKernel = "INVALID_KERNEL",
        /// A picture cannot be read or cannot be used.
        InvalidPicture = "INVALID_PICTURE",
        /// A file could not be read or written.
        Io = "IO",
        /// The kernel was learned for another setup.
        KernelMismatch = "KERNEL_MISMATCH",
        /// The worker was not heard of until its lease ended.
        LeaseExpired = "LEASE_EXPIRED",
        /// Learning failed.
        Learning = "LEARNING",
        /// The parameters of a learned kernel cannot be written down.
        Lineage = "LINEAGE",
        /// A report could not be drawn or written.
        NoReport = "NO_REPORT",
        /// The dataset's pairs tell too little about their alignment.
        NotAlignable = "NOT_ALIGNABLE",
        /// Something that the job names is gone.
        NotFound = "NOT_FOUND",
        /// The display has no simulated bench.
        NotSimulated = "NOT_SIMULATED",
        /// The task panicked.
        Panic = "PANIC",
        /// The server died while the job ran, as often as the job may be tried.
        ServerDied = "SERVER_DIED",
        /// The database failed.
        Store = "STORE",
        /// No thread could be had for the computation.
        Thread = "THREAD",
        /// The attempt took longer than it may.
        Timeout = "TIMEOUT",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_is_stored_as_its_word() {
        let error = JobError { reason: FailureReason::DiskFull, message: "no room".to_owned(), retryable: true };
        let json = serde_json::to_string(&error).unwrap();
        assert_eq!(json, r#"{"reason":"DISK_FULL","message":"no room","retryable":true}"#);
        assert_eq!(serde_json::from_str::<JobError>(&json).unwrap(), error);
    }
}
