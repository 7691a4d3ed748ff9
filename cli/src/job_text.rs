//! Jobs as text.

use super::failure::Failure;
use super::table::{Facts, Table};
use super::{dataset, propagation_text, quality_text, show, strengths_text};
use lightpath::v1::prepare_dataset::{Step, align::Source};
use lightpath::v1::{self, Job, job::State, job_result, job_spec};
use lightpath::{Words as _, names, units};
use std::collections::BTreeSet;

/// The kind of a job, for example `optimize hologram`.
pub(crate) fn kind(job: &Job) -> &'static str {
    match spec(job) {
        Some(job_spec::Kind::OptimizeHologram(_)) => "optimize hologram",
        Some(job_spec::Kind::LearnKernel(_)) => "learn kernel",
        Some(job_spec::Kind::SimulateCapture(_)) => "simulate capture",
        Some(job_spec::Kind::EvaluateKernel(_)) => "evaluate kernel",
        Some(job_spec::Kind::PrepareDataset(spec)) => match spec.step {
            Some(Step::Finalize(_)) => "finalize dataset",
            Some(Step::Align(_)) | None => "align dataset",
        },
        Some(job_spec::Kind::ReportKernel(_)) => "report kernel",
        Some(job_spec::Kind::SuggestHolograms(_)) => "suggest holograms",
        Some(job_spec::Kind::VerifyHologram(_)) => "verify hologram",
        None => "unknown",
    }
}

/// The display, dataset, kernel version or verified job of a job.
pub(crate) fn subject(job: &Job) -> &str {
    match spec(job) {
        Some(job_spec::Kind::OptimizeHologram(spec)) => names::id(&spec.display),
        Some(job_spec::Kind::LearnKernel(spec)) => spec.datasets.first().map_or("–", |name| names::id(name)),
        Some(job_spec::Kind::SimulateCapture(spec)) => names::id(&spec.display),
        Some(job_spec::Kind::EvaluateKernel(spec)) => names::id(&spec.dataset),
        Some(job_spec::Kind::PrepareDataset(spec)) => names::id(&spec.dataset),
        Some(job_spec::Kind::ReportKernel(spec)) => spec.kernel_version.trim_start_matches("displays/"),
        Some(job_spec::Kind::SuggestHolograms(spec)) => spec.kernel_version.trim_start_matches("displays/"),
        Some(job_spec::Kind::VerifyHologram(spec)) => names::id(&spec.job),
        None => "–",
    }
}

/// True for jobs that optimize holograms.
pub(crate) fn is_hologram(job: &Job) -> bool {
    matches!(spec(job), Some(job_spec::Kind::OptimizeHologram(_)))
}

/// The PSNR of a hologram for the detector `pixel`, of several wavelengths or planes the lowest, for example `31.2 dB`.
/// `–` for other jobs.
pub(crate) fn psnr(job: &Job) -> String {
    let Some(job_result::Kind::Hologram(result)) = job.result.as_ref().and_then(|result| result.kind.as_ref()) else {
        return "–".to_owned();
    };
    let planes = result.wavelengths.iter().flat_map(|wavelength| &wavelength.planes);
    let found = planes.filter_map(|plane| Some(plane.quality.as_ref()?.pixel.as_ref()?.psnr_db));
    found.min_by(f64::total_cmp).map_or_else(|| "–".to_owned(), show::decibel)
}

/// The label of a job's progress bar if the job has no target, for example `learn kernel bench-1`.
pub(crate) fn label(job: &Job) -> String {
    format!("{} {}", kind(job), subject(job))
}

/// The state of a job, for example `running`.
pub(crate) fn state(job: &Job) -> String {
    job.state().word().to_owned()
}

/// The state of a job with its most important details, in one line.
pub(crate) fn one_line(job: &Job) -> String {
    let elapsed = show::elapsed(job.start_time.as_ref(), job.finish_time.as_ref());
    match job.state() {
        State::Queued if job.waiting_for > 0 => format!("queued, waits for {} other jobs", job.waiting_for),
        State::Queued if !job.waits_for.is_empty() => format!("queued; {}", show::plain(&job.waits_for)),
        State::Queued if job.attempt > 0 => format!("queued again after attempt {}{}", job.attempt, error_text(job)),
        State::Running if job.cancel_requested => "running, will be cancelled".to_owned(),
        State::Running if job.attempt > 1 => format!("running, attempt {}", job.attempt),
        State::Succeeded => format!("succeeded{}", elapsed.map(|elapsed| format!(" in {elapsed}")).unwrap_or_default()),
        State::Failed => format!("failed{}", error_text(job)),
        State::Unspecified | State::Queued | State::Running | State::Cancelled => state(job),
    }
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
    if job.estimated_memory_bytes > 0 {
        let memory = show::bytes(job.estimated_memory_bytes);
        facts.add("estimate", format!("{memory} of memory, {}", show::duration(job.estimated_time_s)));
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
    facts.add("kind", kind(job));
    if !job.label.is_empty() {
        facts.add("about", show::plain(&job.label));
    }
    if !job.owner.is_empty() {
        facts.add("owner", show::plain(&job.owner));
    }
    spec_facts(job, &mut facts);
    facts.add("state", one_line(job));
    if let (State::Running, Some(progress)) = (job.state(), &job.progress) {
        let left = progress.eta_s.map(|eta_s| format!(", {} left", show::duration(eta_s))).unwrap_or_default();
        facts.add("progress", format!("{} {}/{}{left}", progress.stage, progress.step, progress.steps_total));
    }
    queue_facts(job, &mut facts);
    facts.add_some("created", job.create_time.as_ref().map(show::time));
    facts.add_some("started", job.start_time.as_ref().map(show::time));
    facts.add_some("ended", job.finish_time.as_ref().map(show::time));
    let mut text = String::new();
    match job.result.as_ref().and_then(|result| result.kind.as_ref()) {
        Some(job_result::Kind::Hologram(result)) => {
            facts
                .add("speed", format!("{:.1} ms per iteration, {} iterations", result.iteration_ms, result.iterations));
            text = holograms(result);
        }
        Some(job_result::Kind::Learn(result)) => {
            learn_facts(result, &mut facts);
            let parts = result.kernels.iter().filter_map(|kernel| kernel.metrics.as_ref()).map(quality_text::parts);
            text = parts.filter(|table| !table.is_empty()).map(|table| format!("\n{table}")).collect();
        }
        Some(job_result::Kind::Capture(result)) => {
            propagation_facts(result.propagation.as_ref(), &mut facts);
            facts.add("photograph", &result.photo);
        }
        Some(job_result::Kind::Evaluate(result)) => {
            propagation_facts(result.propagation.as_ref(), &mut facts);
            text = format!("\n{}", evaluation(result));
        }
        Some(job_result::Kind::Prepare(result)) => {
            prepare_facts(result, &mut facts);
            text = dataset::findings(&result.findings);
        }
        Some(job_result::Kind::Report(result)) => {
            facts.add("report", &result.html);
            facts.add("arrays", &result.arrays);
            facts.add("pictures", result.figures.len().to_string());
        }
        Some(job_result::Kind::Suggest(result)) => text = format!("\n{}", quality_text::suggestions(result)),
        Some(job_result::Kind::Verify(result)) => text = format!("\n{}", quality_text::opinions(result)),
        None => {}
    }
    facts.text() + &text
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
            facts.add("wavelength", lengths(spec.wavelengths_m.iter().copied()));
            facts.add("distance", lengths(spec.planes.iter().map(|plane| plane.distance_m)));
            facts.add("kernel", show::kernel_versions(&job.kernel_versions));
            let targets: BTreeSet<&str> = spec.planes.iter().map(|plane| plane.target.as_str()).collect();
            targets.into_iter().for_each(|target| facts.add("target", target));
            let detector = spec.detector().word();
            facts.add("work", format!("{} iterations, {detector} detector, seed {}", spec.iterations, spec.seed));
        }
        Some(job_spec::Kind::LearnKernel(spec)) => {
            let datasets: Vec<&str> = spec.datasets.iter().map(|name| names::id(name)).collect();
            facts.add("dataset", datasets.join(", "));
            facts.add("model", spec.model().word());
        }
        Some(job_spec::Kind::SimulateCapture(spec)) => {
            facts.add("display", names::id(&spec.display));
            facts.add("optics", optics(spec.wavelength_m, spec.distance_m));
            facts.add("hologram", &spec.phase);
        }
        Some(job_spec::Kind::EvaluateKernel(spec)) => {
            facts.add("dataset", names::id(&spec.dataset));
            facts.add("kernel", show::kernel_versions(&job.kernel_versions));
        }
        Some(job_spec::Kind::PrepareDataset(spec)) => {
            facts.add("dataset", names::id(&spec.dataset));
            facts.add("work", preparation(spec));
        }
        Some(job_spec::Kind::ReportKernel(spec)) => facts.add("kernel", &spec.kernel_version),
        Some(job_spec::Kind::SuggestHolograms(spec)) => facts.add("kernel", &spec.kernel_version),
        Some(job_spec::Kind::VerifyHologram(spec)) => facts.add("hologram job", names::id(&spec.job)),
        None => {}
    }
}

fn preparation(spec: &v1::PrepareDataset) -> String {
    match &spec.step {
        Some(Step::Align(align)) => match &align.source {
            Some(Source::Points(points)) => format!("align with {} points", points.points.len()),
            Some(Source::DotsPhoto(photo)) => format!("align with the photograph of the dots {photo}"),
            Some(Source::Pairs(_)) => "align with the pairs".to_owned(),
            Some(Source::None(_)) | None => "remove the alignment".to_owned(),
        },
        Some(Step::Finalize(finalize)) => {
            let v1::prepare_dataset::Finalize { validation_fraction, test_fraction, seed, keep_alignment } = finalize;
            let validation_fraction = validation_fraction.unwrap_or_default();
            let kept = if *keep_alignment { ", alignment kept" } else { "" };
            format!("finalize: {validation_fraction} for validation, {test_fraction} for the test, seed {seed}{kept}")
        }
        None => String::new(),
    }
}

/// Wavelength and distance, for example `515 nm, 150 mm`.
pub(crate) fn optics(wavelength_m: f64, distance_m: f64) -> String {
    format!("{}, {}", units::show_m(wavelength_m), units::show_m(distance_m))
}

/// Lengths separated by commas, for example `450 nm, 520 nm`.
fn lengths(metres: impl Iterator<Item = f64>) -> String {
    metres.map(units::show_m).collect::<Vec<_>>().join(", ")
}

fn propagation_facts(report: Option<&v1::ValidityReport>, facts: &mut Facts) {
    if let Some(report) = report {
        propagation_text::add(report, facts);
    }
}

/// Files and quality of each hologram, plane by plane.
fn holograms(result: &v1::HologramResult) -> String {
    let mut text = String::new();
    for wavelength in &result.wavelengths {
        let mut facts = Facts::default();
        facts.add("wavelength", units::show_m(wavelength.wavelength_m));
        for frame in &wavelength.frames {
            facts.add("phase", &frame.phase);
            facts.add("phase npy", &frame.phase_npy);
        }
        text += &format!("\n{}", facts.text());
        for plane in &wavelength.planes {
            let mut facts = Facts::default();
            facts.add("distance", units::show_m(plane.distance_m));
            propagation_facts(plane.propagation.as_ref(), &mut facts);
            facts.add("reconstruction", &plane.reconstruction);
            facts.add_some("other optics", quality_text::other_orders(plane));
            facts.add_some("second opinion", quality_text::second_opinion(plane));
            text += &format!("\n{}\n{}", facts.text(), quality_text::table(plane));
        }
    }
    text
}

fn learn_facts(result: &v1::LearnResult, facts: &mut Facts) {
    for kernel in &result.kernels {
        facts.add("kernel", &kernel.kernel_version);
        propagation_facts(kernel.propagation.as_ref(), facts);
        if let Some(metrics) = &kernel.metrics {
            facts.add("held-out loss", held_out(metrics));
            facts.add("training loss", show::loss(metrics.train_loss));
            let pairs = (metrics.train_pairs, metrics.validation_pairs, metrics.test_pairs);
            facts.add("pairs", format!("{} train, {} validation, {} test", pairs.0, pairs.1, pairs.2));
            quality_text::verdict(metrics, facts);
        }
        if !kernel.left_out_pairs.is_empty() {
            let ids = kernel.left_out_pairs.join(", ");
            facts.add("left out", format!("{ids}: the photographs do not match their holograms"));
        }
    }
    if result.order > 0 {
        facts.add("order", result.order.to_string());
    }
    strengths_text::add(result, facts);
}

fn prepare_facts(result: &v1::PrepareResult, facts: &mut Facts) {
    if let Some(alignment) = &result.alignment {
        facts.add("alignment", dataset::alignment(alignment));
        if !alignment.explanation.is_empty() {
            facts.add("alignment by pairs", &alignment.explanation);
        }
        for (name, picture) in [("before", &alignment.before), ("after", &alignment.after)] {
            if !picture.is_empty() {
                facts.add(name, picture);
            }
        }
    }
    if !result.digest.is_empty() {
        let v1::PrepareResult { train_pairs, validation_pairs, test_pairs, left_out_pairs, .. } = result;
        facts.add("digest", &result.digest);
        let counts = format!("{train_pairs} train, {validation_pairs} validation, {test_pairs} test");
        let left_out = if *left_out_pairs > 0 { format!(", {left_out_pairs} left out") } else { String::new() };
        facts.add("pairs", counts + &left_out);
    }
}

fn held_out(metrics: &v1::KernelMetrics) -> String {
    format!("{} (ideal kernel {})", show::loss(metrics.test_loss), show::loss(metrics.ideal_test_loss))
}

fn evaluation(result: &v1::EvaluateResult) -> String {
    let mut table = Table::new(&["pair", "split", ">loss", ">full frame?"]);
    for pair in &result.pairs {
        let split = pair.split().word();
        table.row([pair.pair.clone(), split.to_owned(), show::loss(pair.loss), show::loss(pair.loss_full_frame)]);
    }
    table.text()
}
