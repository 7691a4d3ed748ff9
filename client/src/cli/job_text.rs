//! Jobs in words.

use super::failure::Failure;
use super::table::{Facts, Table};
use super::{propagation_text, quality_text, show};
use lightpath::v1::{self, Job, job::State, job_result, job_spec};
use lightpath::{names, units};

/// `optimize hologram`.
pub(crate) fn kind(job: &Job) -> &'static str {
    match spec(job) {
        Some(job_spec::Kind::OptimizeHologram(_)) => "optimize hologram",
        Some(job_spec::Kind::LearnKernel(_)) => "learn kernel",
        Some(job_spec::Kind::SimulateCapture(_)) => "simulate capture",
        Some(job_spec::Kind::EvaluateKernel(_)) => "evaluate kernel",
        None => "unknown",
    }
}

/// The display or dataset that the job works on.
pub(crate) fn subject(job: &Job) -> &str {
    match spec(job) {
        Some(job_spec::Kind::OptimizeHologram(spec)) => names::id(&spec.display),
        Some(job_spec::Kind::LearnKernel(spec)) => names::id(&spec.dataset),
        Some(job_spec::Kind::SimulateCapture(spec)) => names::id(&spec.display),
        Some(job_spec::Kind::EvaluateKernel(spec)) => names::id(&spec.dataset),
        None => "–",
    }
}

/// What a bar calls a job that has no target's name: `learn kernel bench-1`.
pub(crate) fn label(job: &Job) -> String {
    format!("{} {}", kind(job), subject(job))
}

/// `running`.
pub(crate) fn state(job: &Job) -> String {
    show::word("STATE_", job.state().as_str_name())
}

/// State and what matters about it.
pub(crate) fn one_line(job: &Job) -> String {
    let took = show::took(job.start_time.as_ref(), job.finish_time.as_ref());
    match job.state() {
        State::Queued if job.waiting_for > 0 => format!("queued, after {} other jobs", job.waiting_for),
        State::Queued if job.attempt > 0 => format!("queued again after attempt {}{}", job.attempt, error_text(job)),
        State::Running if job.cancel_requested => "running, will be cancelled".to_owned(),
        State::Running if job.attempt > 1 => format!("running, attempt {}", job.attempt),
        State::Succeeded => format!("succeeded{}", took.map(|took| format!(" in {took}")).unwrap_or_default()),
        State::Failed => format!("failed{}", error_text(job)),
        State::Unspecified | State::Queued | State::Running | State::Cancelled => state(job),
    }
}

/// Fails where a job did not succeed.
pub(crate) fn check_success(jobs: &[Job]) -> Result<(), Failure> {
    let unsuccessful = jobs.iter().filter(|job| job.state() != State::Succeeded);
    let endings: Vec<String> = unsuccessful.map(|job| format!("{} {}", job.name, one_line(job))).collect();
    if endings.is_empty() { Ok(()) } else { Err(Failure::Jobs(endings)) }
}

/// Everything about one job.
pub(crate) fn facts(job: &Job) -> String {
    let mut facts = Facts::default();
    facts.add("job", names::id(&job.name));
    facts.add("kind", kind(job));
    spec_facts(job, &mut facts);
    facts.add("state", one_line(job));
    if let (State::Running, Some(progress)) = (job.state(), &job.progress) {
        let left = progress.eta_s.map(|eta_s| format!(", {} left", show::duration(eta_s))).unwrap_or_default();
        facts.add("progress", format!("{} {}/{}{left}", progress.stage, progress.step, progress.steps_total));
    }
    facts.add("attempt", format!("{} (at most {} may fail)", job.attempt, job.attempts_max));
    facts.add("priority", job.priority.to_string());
    facts.add("request id", &job.request_id);
    facts.add_some("created", job.create_time.as_ref().map(show::time));
    facts.add_some("started", job.start_time.as_ref().map(show::time));
    facts.add_some("ended", job.finish_time.as_ref().map(show::time));
    if let Some(report) = propagation(job) {
        propagation_text::add(report, &mut facts);
    }
    let mut text = String::new();
    match job.result.as_ref().and_then(|result| result.kind.as_ref()) {
        Some(job_result::Kind::Hologram(result)) => {
            hologram_facts(result, &mut facts);
            text = format!("\n{}", quality_text::table(result));
        }
        Some(job_result::Kind::Learn(result)) => learn_facts(result, &mut facts),
        Some(job_result::Kind::Capture(result)) => facts.add("photograph", &result.photo),
        Some(job_result::Kind::Evaluate(result)) => text = format!("\n{}", evaluation(result)),
        None => {}
    }
    facts.text() + &text
}

/// How light's way was computed, of a job that succeeded.
pub(crate) fn propagation(job: &Job) -> Option<&v1::ValidityReport> {
    job.result.as_ref()?.propagation.as_ref()
}

fn spec(job: &Job) -> Option<&job_spec::Kind> {
    job.spec.as_ref()?.kind.as_ref()
}

fn error_text(job: &Job) -> String {
    job.error.as_ref().map(|error| format!(": {} ({})", error.message, error.reason)).unwrap_or_default()
}

fn spec_facts(job: &Job, facts: &mut Facts) {
    match spec(job) {
        Some(job_spec::Kind::OptimizeHologram(spec)) => {
            facts.add("display", names::id(&spec.display));
            facts.add("optics", optics(spec.wavelength_m, spec.distance_m));
            facts.add("kernel", show::kernel_version(spec.kernel_version));
            facts.add("target", &spec.target);
            let detector = show::word("DETECTOR_", spec.detector().as_str_name());
            facts.add("work", format!("{} iterations, {detector} detector, seed {}", spec.iterations, spec.seed));
        }
        Some(job_spec::Kind::LearnKernel(spec)) => {
            let datasets = std::iter::once(&spec.dataset).chain(&spec.joint_datasets);
            facts.add("dataset", datasets.map(|name| names::id(name)).collect::<Vec<_>>().join(", "));
            facts.add("model", show::word("KERNEL_MODEL_", spec.model().as_str_name()));
        }
        Some(job_spec::Kind::SimulateCapture(spec)) => {
            facts.add("display", names::id(&spec.display));
            facts.add("optics", optics(spec.wavelength_m, spec.distance_m));
            facts.add("hologram", &spec.phase);
        }
        Some(job_spec::Kind::EvaluateKernel(spec)) => {
            facts.add("dataset", names::id(&spec.dataset));
            facts.add("kernel", show::kernel_version(spec.kernel_version));
        }
        None => {}
    }
}

/// `515 nm, 150 mm`.
pub(crate) fn optics(wavelength_m: f64, distance_m: f64) -> String {
    format!("{}, {}", units::show_m(wavelength_m), units::show_m(distance_m))
}

fn hologram_facts(result: &v1::HologramResult, facts: &mut Facts) {
    facts.add("speed", format!("{:.1} ms an iteration, {} iterations", result.iteration_ms, result.iterations));
    facts.add("phase", &result.phase);
    facts.add("phase npy", &result.phase_npy);
    facts.add("reconstruction", &result.reconstruction);
}

fn learn_facts(result: &v1::LearnResult, facts: &mut Facts) {
    facts.add("kernel", &result.kernel_version);
    if let Some(metrics) = &result.metrics {
        facts.add("held-out loss", held_out(metrics));
        facts.add("training loss", show::loss(metrics.train_loss));
        let pairs = (metrics.train_pairs, metrics.validation_pairs, metrics.test_pairs);
        facts.add("pairs", format!("{} train, {} validation, {} test", pairs.0, pairs.1, pairs.2));
        quality_text::verdict(metrics, facts);
    }
    for other in &result.joint {
        facts.add("kernel", &other.kernel_version);
        if let Some(metrics) = &other.metrics {
            facts.add("held-out loss", held_out(metrics));
        }
    }
    if !result.left_out_pairs.is_empty() {
        let ids = result.left_out_pairs.join(", ");
        facts.add("left out", format!("{ids}: the photographs are not of their holograms"));
    }
    if result.order > 0 {
        facts.add("order", result.order.to_string());
    }
}

fn held_out(metrics: &v1::KernelMetrics) -> String {
    format!("{} (ideal kernel {})", show::loss(metrics.test_loss), show::loss(metrics.ideal_test_loss))
}

fn evaluation(result: &v1::EvaluateResult) -> String {
    let mut table = Table::new(&["pair", "split", ">loss", ">full frame"]);
    for pair in &result.pairs {
        let split = show::word("SPLIT_", pair.split().as_str_name());
        table.row([pair.pair.clone(), split, show::loss(pair.loss), show::loss(pair.loss_full_frame)]);
    }
    table.text()
}
