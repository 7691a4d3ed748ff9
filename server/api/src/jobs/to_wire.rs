//! Conversion of jobs into messages.

use super::kinds;
use crate::enumerations::OnWire as _;
use crate::optics::to_wire::place;
use crate::time::timestamp;
use lightpath_domain::job::{Estimate, Job, JobError, JobEvent, JobSpec, JobState, JobSummary, Progress};
use lightpath_domain::kernel::KernelKey;
use lightpath_proto::v1;
use lightpath_service::{Outlook, Waiting};

/// Begin of the names of [`v1::job::Kind`]. The rest is a word of `JobSpec::KINDS` in capitals.
const KIND_PREFIX: &str = "KIND_";
/// Limit on the message of an error in a summary \[characters\].
const SUMMARY_MESSAGE_MAX: usize = 200;

/// Converts a job into its message.
pub(crate) fn job(outlook: &Outlook, job: Job) -> v1::Job {
    let (waiting, waits_for) = waiting(outlook.of(&job));
    let scheduling = job.scheduling;
    v1::Job {
        name: format!("jobs/{}", job.id),
        request_id: job.request_id,
        kernels: job.spec.kernels().into_iter().map(used_kernel).collect(),
        spec: Some(kinds::to_wire(job.spec)),
        owner: scheduling.owner,
        batch: scheduling.batch.unwrap_or_default(),
        unique_key: scheduling.unique_key.unwrap_or_default(),
        priority: job.priority,
        timeout_s: scheduling.timeout_ms.map(|ms| ms as f64 / 1e3),
        after: scheduling.after.iter().map(|id| format!("jobs/{id}")).collect(),
        waiting_for: job.waiting_for,
        state: job.state.to_wire(),
        cancel_requested: job.cancel_requested,
        attempt: job.attempt,
        attempts_max: job.attempts_max,
        create_time: Some(timestamp(job.create_time_ms)),
        run_time: Some(timestamp(job.run_time_ms)),
        start_time: job.start_time_ms.map(timestamp),
        end_time: job.finish_time_ms.map(timestamp),
        progress: job.progress.map(progress),
        error: job.error.map(error),
        result: job.result.map(kinds::result),
        revision: job.revision,
        estimated_memory_bytes: (job.estimate.memory_bytes > 0).then_some(job.estimate.memory_bytes),
        estimated_time_s: (job.estimate.time_s > 0.0).then_some(job.estimate.time_s),
        label: scheduling.label.unwrap_or_default(),
        needs: scheduling.needs.iter().map(str::to_owned).collect(),
        waits_for,
        computer: job.computer.unwrap_or_default(),
        waiting,
    }
}

/// Converts a checked request with its estimate into its message.
pub(crate) fn estimate(spec: JobSpec, estimate: Estimate) -> v1::JobEstimate {
    v1::JobEstimate {
        kernels: spec.kernels().into_iter().map(used_kernel).collect(),
        spec: Some(kinds::to_wire(spec)),
        memory_bytes: (estimate.memory_bytes > 0).then_some(estimate.memory_bytes),
        time_s: (estimate.time_s > 0.0).then_some(estimate.time_s),
    }
}

/// Converts what a list shows of a job into its message.
pub(crate) fn summary(outlook: &Outlook, job: JobSummary) -> v1::JobSummary {
    let (waiting, waits_for) = waiting(outlook.of_summary(&job));
    let has_succeeded = job.state == JobState::Succeeded;
    v1::JobSummary {
        name: format!("jobs/{}", job.id),
        kind: kind_of(&job.kind).into(),
        display: format!("displays/{}", job.display),
        owner: job.owner,
        batch: job.batch.unwrap_or_default(),
        state: job.state.to_wire(),
        cancel_requested: job.cancel_requested,
        priority: job.priority,
        attempt: job.attempt,
        create_time: Some(timestamp(job.create_time_ms)),
        start_time: job.start_time_ms.map(timestamp),
        end_time: job.finish_time_ms.map(timestamp),
        progress: job.progress.filter(|_| !has_succeeded).map(progress),
        error: job.error.map(|error| JobError { message: beginning(error.message), ..error }).map(self::error),
        revision: job.revision,
        label: job.label.unwrap_or_default(),
        needs: job.needs.iter().map(str::to_owned).collect(),
        waits_for,
        waiting,
    }
}

/// Converts what a job waits for into its message, and the text for people.
fn waiting(waiting: Option<Waiting>) -> (Option<v1::Waiting>, String) {
    let Some(Waiting { reason, place, text }) = waiting else { return (None, String::new()) };
    let behind = place.as_ref().and_then(|place| place.behind.as_deref()).map(|job| v1::waiting::RunningJob {
        name: format!("jobs/{}", job.id),
        kind: kind_of(&job.kind).into(),
        subject: job.subject.clone(),
    });
    let message = v1::Waiting {
        reason: reason.to_wire(),
        jobs_before: place.as_ref().map(|place| place.jobs_before),
        others_before: place.as_ref().map(|place| place.others_before),
        behind,
        expected_start_time: place.and_then(|place| place.start_ms).map(timestamp),
    };
    (Some(message), text)
}

/// The value of the enumeration for a word of `JobSpec::KINDS`.
fn kind_of(word: &str) -> v1::job::Kind {
    v1::job::Kind::from_str_name(&format!("{KIND_PREFIX}{}", word.to_ascii_uppercase())).unwrap_or_default()
}

/// The word of `JobSpec::KINDS` for a value of the enumeration; `None`: unspecified.
pub(crate) fn kind_word(kind: v1::job::Kind) -> Option<String> {
    let name = kind.as_str_name().strip_prefix(KIND_PREFIX).unwrap_or_default();
    (kind != v1::job::Kind::Unspecified).then(|| name.to_ascii_lowercase())
}

fn beginning(message: String) -> String {
    if message.chars().count() <= SUMMARY_MESSAGE_MAX {
        return message;
    }
    message.chars().take(SUMMARY_MESSAGE_MAX - 1).chain(['…']).collect()
}

fn used_kernel((key, version): (KernelKey, Option<u32>)) -> v1::UsedKernel {
    v1::UsedKernel {
        wavelength_m: key.wavelength.m(),
        place: place(key.distance),
        kernel_version: version.map_or_else(String::new, |version| format!("{key}/versions/{version}")),
    }
}

/// Converts an event into its message.
pub(crate) fn event(event: JobEvent) -> v1::JobEvent {
    let attempt = (event.attempt > 0).then_some(event.attempt);
    v1::JobEvent { time: Some(timestamp(event.time_ms)), attempt, message: event.message }
}

fn progress(progress: Progress) -> v1::Progress {
    let Progress { stage, step, steps_total, loss, eta_s } = progress;
    v1::Progress { stage, step, steps_total, loss, eta_s }
}

fn error(error: JobError) -> v1::JobError {
    let JobError { reason, message, retryable } = error;
    v1::JobError { reason: reason.to_string(), message, retryable }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_domain::job::JobSpec;

    #[test]
    fn each_kind_of_job_has_a_value_of_the_enumeration() {
        for word in JobSpec::KINDS {
            assert_eq!(kind_word(kind_of(word)).as_deref(), Some(word));
        }
        assert_eq!(kind_word(v1::job::Kind::Unspecified), None);
    }

    #[test]
    fn long_errors_are_shortened_in_summaries() {
        assert_eq!(beginning("no".to_owned()), "no");
        let shortened = beginning("ä".repeat(SUMMARY_MESSAGE_MAX + 1));
        assert_eq!((shortened.chars().count(), shortened.ends_with("ä…")), (SUMMARY_MESSAGE_MAX, true));
    }
}
