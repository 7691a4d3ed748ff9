//! The filters of job lists from messages.

use lightpath_domain::job::JobState;
use lightpath_proto::v1;

/// The state that a filter names; `None`: any.
pub(crate) fn state(value: i32) -> Option<Option<JobState>> {
    Some(match v1::job::State::try_from(value).ok()? {
        v1::job::State::Unspecified => None,
        v1::job::State::Queued => Some(JobState::Queued),
        v1::job::State::Running => Some(JobState::Running),
        v1::job::State::Succeeded => Some(JobState::Succeeded),
        v1::job::State::Failed => Some(JobState::Failed),
        v1::job::State::Cancelled => Some(JobState::Cancelled),
    })
}
