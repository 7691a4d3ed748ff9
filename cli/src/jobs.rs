//! Jobs as text. Each kind of job has a file, with the command that submits it, what people read of its jobs, and what it saves. `submission`
//! and `progress` submit jobs of all kinds and wait for them.

pub(crate) mod capture_photos;
pub(crate) mod evaluate_kernel;
pub(crate) mod learn_kernel;
pub(crate) mod optimize_hologram;
pub(crate) mod prepare_dataset;
pub(crate) mod progress;
pub(crate) mod report_kernel;
pub(crate) mod simulate_capture;
pub(crate) mod submission;
pub(crate) mod suggest_holograms;
pub(crate) mod verify_hologram;

use super::failure::Failure;
use super::show;
use super::table::Facts;
use lightpath::v1::{self, Job, Progress, job::State, job_spec, waiting::Reason};
use lightpath::{Words as _, names};

/// What people read of a kind of job. The request of each kind in the API is one.
pub(crate) trait JobKind {
    /// Name of the kind, for example `optimize hologram`, and the display, dataset, kernel version or job that the job is about.
    fn title(&self) -> (&'static str, &str);

    /// Adds what the job is asked for.
    fn spec_facts(&self, job: &Job, facts: &mut Facts);

    /// Adds what the job found, and returns the text below the facts. An error: it has no result.
    fn result_facts(&self, job: &Job, facts: &mut Facts) -> lightpath::Result<String>;
}

/// The kind of a job. `None`: the server is newer than this program, which does not know the kind.
fn known_kind(job: &Job) -> Option<&dyn JobKind> {
    Some(match job.spec.as_ref()?.kind.as_ref()? {
        job_spec::Kind::OptimizeHologram(spec) => spec,
        job_spec::Kind::LearnKernel(spec) => spec,
        job_spec::Kind::SimulateCapture(spec) => spec,
        job_spec::Kind::EvaluateKernel(spec) => spec,
        job_spec::Kind::PrepareDataset(spec) => spec,
        job_spec::Kind::ReportKernel(spec) => spec,
        job_spec::Kind::VerifyHologram(spec) => spec,
        job_spec::Kind::SuggestHolograms(spec) => spec,
        job_spec::Kind::CapturePhotos(spec) => spec,
    })
}

/// The name of a job's kind, for example `optimize hologram`, and the display, dataset, kernel version or job that it is about.
pub(crate) fn title(job: &Job) -> (&'static str, &str) {
    known_kind(job).map_or(("unknown", "–"), JobKind::title)
}

/// True for jobs that optimize holograms.
pub(crate) fn is_hologram(job: &Job) -> bool {
    matches!(job.spec.as_ref().and_then(|spec| spec.kind.as_ref()), Some(job_spec::Kind::OptimizeHologram(_)))
}

/// The state of a job with its most important details, in one line.
pub(crate) fn one_line(job: &Job) -> String {
    let elapsed = show::elapsed(job.start_time.as_ref(), job.end_time.as_ref());
    match job.state() {
        State::Queued if job.waiting_for > 0 => format!("queued, waits for {} other jobs", job.waiting_for),
        State::Queued if !job.waits_for.is_empty() => format!("queued; {}", waits(job)),
        State::Queued if job.attempt > 0 => format!("queued again after attempt {}{}", job.attempt, error_text(job)),
        State::Running if job.cancel_requested => "running, will be cancelled".to_owned(),
        State::Running if job.attempt > 1 => format!("running, attempt {}", job.attempt),
        State::Succeeded => format!("succeeded{}", elapsed.map(|elapsed| format!(" in {elapsed}")).unwrap_or_default()),
        State::Failed => format!("failed{}", error_text(job)),
        State::Unspecified | State::Queued | State::Running | State::Cancelled => job.state().word().to_owned(),
    }
}

/// What a queued job waits for and when it starts, for example `behind learn kernel bench-1, about 3 min`; empty: nothing is
/// known.
pub(crate) fn waits(job: &Job) -> String {
    let start = job.waiting.as_ref().and_then(|waiting| waiting.expected_start_time.as_ref());
    let left = start.map(|start| format!(", about {}", show::about((start.seconds - show::now_s()) as f64)));
    if job.waits_for.is_empty() { String::new() } else { show::plain(&job.waits_for) + &left.unwrap_or_default() }
}

/// Why a queued job does not run.
pub(crate) fn wait_reason(job: &Job) -> Reason {
    job.waiting.as_ref().map_or(Reason::Unspecified, v1::Waiting::reason)
}

/// The progress of a running job, for example `iterate 40/200, loss 0.0123, 12.3 s left`.
pub(crate) fn progress_text(progress: &Progress) -> String {
    let steps = (progress.steps_total > 0).then(|| format!(" {}/{}", progress.step, progress.steps_total));
    let loss = progress.loss.map(|loss| format!(", loss {}", show::loss(loss)));
    let left = progress.eta_s.map(|eta_s| format!(", {} left", show::duration(eta_s)));
    let parts = [steps, loss, left].map(Option::unwrap_or_default);
    format!("{}{}", show::plain(&progress.stage), parts.concat())
}

/// Returns an error if any of the jobs did not succeed.
pub(crate) fn check_success(jobs: &[Job]) -> Result<(), Failure> {
    let unsuccessful = jobs.iter().filter(|job| job.state() != State::Succeeded);
    let endings: Vec<String> = unsuccessful.map(|job| format!("{} {}", job.name, one_line(job))).collect();
    if endings.is_empty() { Ok(()) } else { Err(Failure::Jobs(endings)) }
}

/// Adds what concerns the place of a job in the queue.
fn queue_facts(job: &Job, facts: &mut Facts) {
    facts.add("attempt", format!("{} (the job fails after {} failed attempts)", job.attempt, job.attempts_max));
    facts.add("priority", job.priority.to_string());
    if !job.needs.is_empty() {
        facts.add("needs", show::plain(&job.needs.join(", ")));
    }
    if let (Some(memory), Some(time_s)) = (job.estimated_memory_bytes, job.estimated_time_s) {
        facts.add("estimate", format!("{} of memory, {}", show::bytes(memory), show::duration(time_s)));
    }
    if !job.computer.is_empty() {
        facts.add("computed by", show::plain(&job.computer));
    }
    facts.add("request id", &job.request_id);
}

/// Text with all facts about a job.
pub(crate) fn facts(job: &Job) -> String {
    let mut facts = Facts::default();
    facts.add("job", names::id(&job.name));
    facts.add("kind", title(job).0);
    if !job.label.is_empty() {
        facts.add("about", show::plain(&job.label));
    }
    if !job.owner.is_empty() {
        facts.add("owner", show::plain(&job.owner));
    }
    let kind = known_kind(job);
    if let Some(kind) = kind {
        kind.spec_facts(job, &mut facts);
    }
    facts.add("state", one_line(job));
    if let (State::Running, Some(progress)) = (job.state(), &job.progress) {
        facts.add("progress", progress_text(progress));
    }
    queue_facts(job, &mut facts);
    facts.add_some("created", job.create_time.as_ref().map(show::time));
    facts.add_some("started", job.start_time.as_ref().map(show::time));
    facts.add_some("ended", job.end_time.as_ref().map(show::time));
    let text = kind.and_then(|kind| kind.result_facts(job, &mut facts).ok()).unwrap_or_default();
    facts.text() + &text
}

fn error_text(job: &Job) -> String {
    job.error.as_ref().map(|error| format!(": {} ({})", error.message, error.reason)).unwrap_or_default()
}
