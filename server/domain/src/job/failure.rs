//! Errors that end attempts.

use serde::{Deserialize, Serialize};

/// Error that ended an attempt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JobError {
    /// Reason, for programs.
    pub reason: FailureReason,
    /// Message, for people.
    pub message: String,
    /// Whether another attempt may succeed. If attempts are left, the server then tries the job again.
    pub retryable: bool,
}

impl JobError {
    /// Whether the job did not cause the error: the place where files are stored is full or cannot be reached, the
    /// machine starts no more threads or processes, or the rig at the bench is gone.
    #[must_use]
    pub fn is_of_the_machine(&self) -> bool {
        matches!(
            self.reason,
            FailureReason::DiskFull | FailureReason::Remote | FailureReason::NotStarted | FailureReason::RigAbsent
        )
    }
}

crate::reasons! {
    /// Reason why an attempt failed, for programs.
    pub enum FailureReason {
        /// The dataset's photographs differ in size from the photographs of the alignment.
        AlignmentSize = "ALIGNMENT_SIZE",
        /// An artifact that the job names does not exist.
        ArtifactNotFound = "ARTIFACT_NOT_FOUND",
        /// The job's state could not be written as a checkpoint.
        Checkpoint = "CHECKPOINT",
        /// A stored file no longer matches its digest.
        DataLoss = "DATA_LOSS",
        /// The dataset was changed while the job prepared it.
        DatasetChanged = "DATASET_CHANGED",
        /// The dataset from which the kernel version was learned was deleted.
        DatasetDeleted = "DATASET_DELETED",
        /// The dataset is finalized, so it can no longer change.
        DatasetFinalized = "DATASET_FINALIZED",
        /// The dataset is not finalized.
        DatasetOpen = "DATASET_OPEN",
        /// The split of the dataset has no pairs for one of its uses.
        DatasetSplitEmpty = "DATASET_SPLIT_EMPTY",
        /// A file of the dataset cannot be read.
        DatasetUnreadable = "DATASET_UNREADABLE",
        /// Most pairs of the dataset are unusable for learning.
        DatasetUnusable = "DATASET_UNUSABLE",
        /// A job that had to succeed before this one did not succeed.
        DependencyFailed = "DEPENDENCY_FAILED",
        /// No space is left on the disk.
        DiskFull = "DISK_FULL",
        /// A number became infinite or NaN.
        Diverged = "DIVERGED",
        /// The optics engine refuses the input of the job.
        InvalidInput = "INVALID_INPUT",
        /// A kernel file cannot be read.
        InvalidKernel = "INVALID_KERNEL",
        /// A picture cannot be read or used.
        InvalidPicture = "INVALID_PICTURE",
        /// A file could not be read or written.
        Io = "IO",
        /// The kernel has reached its limit of versions.
        KernelFull = "KERNEL_FULL",
        /// The kernel was learned for another optical setup.
        KernelMismatch = "KERNEL_MISMATCH",
        /// The worker sent no heartbeat until its lease ended.
        LeaseExpired = "LEASE_EXPIRED",
        /// Learning failed.
        Learning = "LEARNING",
        /// A report could not be drawn or written.
        NoReport = "NO_REPORT",
        /// The pairs of the dataset do not improve its alignment: they have too little fine structure, or are aligned
        /// already.
        NotAlignable = "NOT_ALIGNABLE",
        /// A resource that the job names does not exist.
        NotFound = "NOT_FOUND",
        /// The kernel's model does not say what holograms can tell about it.
        NoSuggestion = "NO_SUGGESTION",
        /// The machine could not start the thread or the process of the computation, or killed the process although it
        /// took no more memory than was estimated.
        NotStarted = "NOT_STARTED",
        /// The independent model cannot judge the hologram.
        NotVerifiable = "NOT_VERIFIABLE",
        /// The display has no simulated bench.
        NotSimulated = "NOT_SIMULATED",
        /// The task panicked.
        Panic = "PANIC",
        /// The process that ran this job alone died in the job's last permitted attempt.
        ProcessDied = "PROCESS_DIED",
        /// Photographs at the bench were not of their pattern, however often they were taken.
        PhotoMismatch = "PHOTO_MISMATCH",
        /// The database or the bucket of the artifacts did not answer, or refused.
        Remote = "REMOTE",
        /// The rig at the bench was not connected any more.
        RigAbsent = "RIG_ABSENT",
        /// The rig at the bench could not take a photograph.
        RigFailed = "RIG_FAILED",
        /// The database failed.
        Store = "STORE",
        /// The thread of the computation ended unexpectedly.
        Thread = "THREAD",
        /// The attempt exceeded its time limit.
        Timeout = "TIMEOUT",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reason_is_stored_as_its_word() {
        let error = JobError { reason: FailureReason::DiskFull, message: "no room".to_owned(), retryable: true };
        let json = serde_json::to_string(&error).unwrap();
        assert_eq!(json, r#"{"reason":"DISK_FULL","message":"no room","retryable":true}"#);
        assert_eq!(serde_json::from_str::<JobError>(&json).unwrap(), error);
    }
}
