//! What to do about a refusal that is not about a field: a text for people, by the reason. The message of a refusal says
//! the same about the case at hand.

use lightpath_domain::reason::PreconditionReason;
use lightpath_service::LimitReason;
use lightpath_store::AbortReason;

pub(crate) const AGAIN: &str = "try again";
pub(crate) const RETRY: &str = "try again after the delay";
pub(crate) const TOKEN: &str = "send a token that is valid: `authorization: Bearer …`, or --token-file FILE";
pub(crate) const ROLE: &str = "use a token whose role and displays allow this, or ask an admin for one";
pub(crate) const NAME: &str = "check the name";
pub(crate) const OTHER_NAME: &str = "choose another name, or use what exists";
pub(crate) const PLAIN_TEXT: &str = "leave out the character NUL";
pub(crate) const MEMORY: &str = "send a smaller picture, or ask the operator for a larger computing_mib_max";
pub(crate) const DIGEST: &str = "give sha256- and 64 lower-case hexadecimal digits";
pub(crate) const OFFSET: &str = "begin inside the artifact";
pub(crate) const CONTINUE: &str = "continue at the offset that GetUpload returns";
pub(crate) const WHOLE_FILE: &str = "send the whole file again, with its own size and digest";
pub(crate) const REPAIR: &str = "upload the same bytes again, or run `lightpathd check` on the server";
pub(crate) const VERSIONS: &str = "use a client and a server of the same version";
pub(crate) const HOST: &str = "call it by its IP address or localhost, or add the name to its setting host_names";
pub(crate) const ORIGIN: &str = "if that page may call it, add its origin to the setting cors_origins";
pub(crate) const REPORT: &str = "report the id in the message to the operator";

/// The fix for a present state that does not allow a request.
pub(crate) fn of_precondition(reason: PreconditionReason) -> &'static str {
    match reason {
        PreconditionReason::AlreadyActive => "leave the version as it is, or name another one",
        PreconditionReason::DatasetDeleted => "name a version whose dataset exists",
        PreconditionReason::DatasetEmpty => "add pairs to the dataset",
        PreconditionReason::DatasetFinalized => "create another dataset",
        PreconditionReason::DatasetFull => "add the pairs to another dataset",
        PreconditionReason::DatasetInUse => "wait until the jobs on the dataset have ended, or cancel them",
        PreconditionReason::DatasetOpen => "finalize the dataset first",
        PreconditionReason::DatasetSplitEmpty => "add more pairs, or choose other fractions",
        PreconditionReason::DependencyEnded => "retry the job that it waits for, or submit it without that job",
        PreconditionReason::DevicesFull => "delete devices that no longer exist",
        PreconditionReason::DisplayFull => "delete datasets that nobody needs",
        PreconditionReason::DisplayInUse => "delete what refers to the display first",
        PreconditionReason::JobEnded => "submit another job, or retry this one",
        PreconditionReason::JobTooLarge => "ask for less, or let the operator raise the limit",
        PreconditionReason::JobNotRetryable => "retry only jobs that failed or were cancelled",
        PreconditionReason::KernelFull => "use a display of another name for more versions",
        PreconditionReason::KernelUnreadable => "name another version, or import the kernel again",
        PreconditionReason::NoActiveKernel => "promote a version first, or name one",
        PreconditionReason::NoEarlierVersion => "promote the version that shall be active",
        PreconditionReason::NoJointFit => "learn several distances together first",
        PreconditionReason::NoSigningKey => "let the operator add a signing key",
        PreconditionReason::NoSuchForm => "ask for another form",
        PreconditionReason::NotPaused => "leave the queue as it is",
        PreconditionReason::DatasetNotAligned => "align the dataset",
        PreconditionReason::NoJobsHere => "connect to a server that runs jobs",
        PreconditionReason::RigBusy => "stop the other rig",
        PreconditionReason::RigReplaced => "run one rig for each display",
        PreconditionReason::NotSimulated => "name a display with a simulated bench",
        PreconditionReason::NotUnique => "wait for the other job with this key, or cancel it",
        PreconditionReason::PromotionGateFailed => "name a version that passes, or force it with a reason",
        PreconditionReason::RolloutEnded => "start another rollout",
        PreconditionReason::RolloutRunning => "complete or halt the rollout first",
        PreconditionReason::VersionDeprecated => "undo the deprecation, or name another version",
        PreconditionReason::WebhookOriginNotAllowed => "let the operator add the origin to webhook_origins",
        PreconditionReason::WebhooksFull => "delete a webhook that nobody needs",
    }
}

/// The fix for a change by somebody else.
pub(crate) fn of_change(reason: AbortReason) -> &'static str {
    match reason {
        AbortReason::ActiveVersionChanged => "read the kernel again, and decide again",
        AbortReason::AliasChanged => "read the kernel's aliases again, and decide again",
        AbortReason::RolloutChanged => "read the rollout again, and decide again",
        AbortReason::DatasetChanged => "read the dataset again, and try again",
        AbortReason::DisplayChanged => "read the display again, and decide again",
        AbortReason::WebhookChanged => "read the webhook again, and decide again",
        AbortReason::KeyringChanged => "read the keyring again, and try again",
    }
}

/// The fix for a limit of the server.
pub(crate) fn of_limit(reason: LimitReason) -> &'static str {
    match reason {
        LimitReason::RateLimited => "make fewer calls; try again after the delay",
        LimitReason::TooManyWatchers => "close streams that nobody needs",
        LimitReason::TooManyDownloads => "wait until other downloads have ended",
        LimitReason::TooManyConnections => "close connections that nobody needs",
        LimitReason::TooManyUploads => "wait until other uploads have ended",
        LimitReason::TooMuchUnderWay => "wait until other calls have ended, and send fewer at once",
    }
}
