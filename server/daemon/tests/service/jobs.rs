//! Tests of jobs: refusals, defaults, progress, results and restarts.

use crate::preparing::{assert_refused, finalize, prepare};
use crate::serving::{Serving, expect, sized_display};
use lightpath_artifacts::digest_of;
use lightpath_media::pictures;
use lightpath_optics::{Detector, DisplayModel, Engine, Grid, OpticalSetup, Plane};
use lightpath_proto::v1::dataset_service_client::DatasetServiceClient;
use lightpath_proto::v1::kernel_service_client::KernelServiceClient;
use lightpath_proto::v1::prepare_dataset::align::{NoAlignment, Source};
use lightpath_proto::v1::prepare_dataset::{Align, Finalize, Step};
use lightpath_proto::v1::waiting::Reason;
use lightpath_proto::v1::{self, job_spec};
use std::time::Duration;
use tonic::{Code, Status};
use tonic_types::StatusExt as _;

pub(crate) fn picture() -> Vec<u8> {
    let plane = lightpath_optics::Plane::from_fn(40, 30, |y, x| (y + x) as f32 / 70.0);
    pictures::grey_png_srgb(&plane).unwrap()
}

pub(crate) fn optimize(target: &str) -> v1::OptimizeHologram {
    v1::OptimizeHologram {
        display: "displays/lab".into(),
        planes: vec![v1::optimize_hologram::ImagePlane {
            place: Some(v1::Place::at_m(0.05)),
            target: target.to_owned(),
            weight: None,
        }],
        iterations: Some(10_000),
        ..Default::default()
    }
}

fn random_phase(range_rad: f64) -> v1::optimize_hologram::InitialPhase {
    use v1::optimize_hologram::{
        InitialPhase,
        initial_phase::{Kind, Random},
    };
    InitialPhase { kind: Some(Kind::Random(Random { range_rad: Some(range_rad) })) }
}

pub(crate) async fn submit(serving: &Serving, kind: job_spec::Kind, request_id: &str) -> Result<v1::Job, Status> {
    let spec = Some(v1::JobSpec { kind: Some(kind) });
    let request = v1::SubmitJobRequest { spec, request_id: request_id.to_owned(), ..Default::default() };
    Ok(serving.jobs().submit_job(request).await?.into_inner())
}

/// Submits a job on `displays/lab` that takes long enough to be watched while it runs.
pub(crate) async fn submit_long(serving: &Serving) -> v1::Job {
    serving.display("lab").await;
    let target = serving.upload(&picture()).await;
    submit(serving, job_spec::Kind::OptimizeHologram(optimize(&target)), "").await.unwrap()
}

#[tokio::test]
async fn defaults_are_filled_in_and_a_repeated_request_returns_the_same_job() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let target = serving.upload(&picture()).await;
    let kind = || job_spec::Kind::OptimizeHologram(optimize(&target));
    let job = submit(&serving, kind(), "mine-1").await.unwrap();
    let Some(job_spec::Kind::OptimizeHologram(spec)) = job.spec.clone().unwrap().kind else { panic!("{job:?}") };
    assert_eq!(
        (spec.kernel.as_ref(), spec.wavelengths_m.as_slice()),
        (Some(&v1::KernelChoice::ideal()), [515e-9].as_slice())
    );
    assert_eq!(job.kernels.len(), 1);
    assert_eq!((job.kernels[0].place, job.kernels[0].kernel_version.as_str()), (Some(v1::Place::at_m(0.05)), ""));
    assert_eq!((spec.method(), spec.subframes, spec.learning_rate), (v1::HologramMethod::Lbfgs, Some(1), None));
    assert_eq!(spec.region, Some(v1::Region { x_px: 6, y_px: 5, width_px: 52, height_px: 38 }));
    assert_eq!((job.attempts_max, job.request_id.as_str()), (3, "mine-1"));
    assert_eq!(submit(&serving, kind(), "mine-1").await.unwrap().name, job.name);
    let other = job_spec::Kind::OptimizeHologram(v1::OptimizeHologram { seed: 1, ..optimize(&target) });
    expect(submit(&serving, other, "mine-1").await, Code::AlreadyExists, "");
}

async fn estimate(serving: &Serving, hologram: v1::OptimizeHologram) -> Result<v1::JobEstimate, Status> {
    let spec = Some(v1::JobSpec { kind: Some(job_spec::Kind::OptimizeHologram(hologram)) });
    Ok(serving.jobs().estimate_job(v1::EstimateJobRequest { spec }).await?.into_inner())
}

/// A job on a display of 2048×2048 px.
async fn large_job(serving: &Serving) -> v1::OptimizeHologram {
    let display = sized_display("large", 2048, 2048);
    let request = v1::CreateDisplayRequest { display: Some(display) };
    serving.displays().create_display(request).await.unwrap();
    v1::OptimizeHologram { display: "displays/large".into(), ..optimize(&serving.upload(&picture()).await) }
}

fn assert_too_large(refused: &Status, signs: &[&str]) {
    assert_eq!(refused.code(), Code::FailedPrecondition, "{refused:?}");
    assert_eq!(refused.get_error_details().error_info().unwrap().reason, "JOB_TOO_LARGE");
    for sign in signs {
        assert!(refused.message().contains(sign), "{sign:?} is not in {refused:?}");
    }
}

#[tokio::test]
async fn job_beyond_the_memory_limit_is_refused_with_the_numbers() {
    let serving = Serving::start_with(|config| config.job_memory_mib_max = 512.0).await;
    let large = large_job(&serving).await;
    let refused = submit(&serving, job_spec::Kind::OptimizeHologram(large.clone()), "").await.unwrap_err();
    // An eighth of the limit is for the cache.
    assert_too_large(
        &refused,
        &["at most 448 MiB (job_memory_mib_max)", "MiB of memory and", "fewer subframes, planes"],
    );
    assert_eq!(estimate(&serving, large.clone()).await.unwrap_err().message(), refused.message());
    let small = v1::OptimizeHologram { display: "displays/lab".into(), ..large };
    serving.display("lab").await;
    let estimated = estimate(&serving, small.clone()).await.unwrap();
    let job = submit(&serving, job_spec::Kind::OptimizeHologram(small), "").await.unwrap();
    assert_eq!((&estimated.spec, &estimated.kernels), (&job.spec, &job.kernels));
    assert_eq!(estimated.memory_bytes, job.estimated_memory_bytes);
    // The queue keeps milliseconds.
    assert!((estimated.time_s() - job.estimated_time_s()).abs() < 1e-3, "{estimated:?} {job:?}");
    let listed = serving.jobs().list_jobs(v1::ListJobsRequest::default()).await.unwrap().into_inner();
    assert_eq!(listed.jobs.len(), 1, "an estimate submits nothing");
    let mib = job.estimated_memory_bytes() >> 20;
    assert!((8..64).contains(&mib), "{mib} MiB");
    assert!(job.estimated_time_s() > 0.0, "{job:?}");
    serving.stop().await.unwrap();
}

#[tokio::test]
async fn job_beyond_the_time_limit_is_refused_with_the_numbers() {
    let serving = Serving::start_with(|config| config.job_time_s_max = 1.0).await;
    let large = large_job(&serving).await;
    let refused = submit(&serving, job_spec::Kind::OptimizeHologram(large), "").await.unwrap_err();
    assert_too_large(&refused, &["and 1 s (job_time_s_max)", "fewer subframes, planes or iterations"]);
    serving.stop().await.unwrap();
}

#[tokio::test]
async fn repeated_request_returns_its_job_after_the_limits_were_lowered() {
    let serving = Serving::start_with(|config| config.job_memory_mib_max = 8192.0).await;
    serving.display("lab").await;
    let kind = job_spec::Kind::OptimizeHologram(optimize(&serving.upload(&picture()).await));
    let job = submit(&serving, kind.clone(), "mine").await.unwrap();
    let request = v1::CancelJobRequest { name: job.name.clone() };
    serving.jobs().cancel_job(request).await.unwrap();
    watch_to_end(&serving, &job.name).await;
    let serving = serving.restart_with(|config| config.job_time_s_max = 1e-9).await;
    let again = submit(&serving, kind.clone(), "mine").await.unwrap();
    assert_eq!((again.name, again.estimated_memory_bytes), (job.name, job.estimated_memory_bytes));
    assert_too_large(&submit(&serving, kind, "other").await.unwrap_err(), &["job_time_s_max"]);
    serving.stop().await.unwrap();
}

#[tokio::test]
#[expect(clippy::too_many_lines, reason = "a table of requests")]
async fn refusals_name_the_field_and_the_allowed_values() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let whole = picture();
    let target = serving.upload(&whole).await;
    let truncated = serving.upload(&whole[..whole.len() / 2]).await;
    let text = serving.upload(b"this is no picture").await;
    let black = pictures::grey_png_srgb(&lightpath_optics::Plane::filled(48, 64, 0.0)).unwrap();
    let black = serving.upload(&black).await;
    let dot = pictures::grey_png_srgb(&lightpath_optics::Plane::filled(1, 1, 1.0)).unwrap();
    let dot = serving.upload(&dot).await;
    let missing = digest_of(b"missing");
    type Change<'a> = Box<dyn Fn(&mut v1::OptimizeHologram) + 'a>;
    let cases: Vec<(Change<'_>, Code, &str)> = vec![
        (
            Box::new(|s| s.planes[0].place = Some(v1::Place::at_m(f64::NAN))),
            Code::InvalidArgument,
            "planes[0].place.distance_m is NaN, but must be within ±10 m",
        ),
        (
            Box::new(|s| s.planes[0].place = Some(v1::Place::at_m(0.0))),
            Code::InvalidArgument,
            "planes[0].place.distance_m is 0",
        ),
        (
            Box::new(|s| s.planes[0].place = Some(v1::Place::at_m(5.0))),
            Code::InvalidArgument,
            "planes[0].place.distance_m is 5: the Rayleigh–Sommerfeld impulse",
        ),
        (
            Box::new(|s| s.propagation = v1::PropagationMethod::AngularSpectrum.into()),
            Code::InvalidArgument,
            "propagation cannot be used: the angular spectrum cannot",
        ),
        (
            Box::new(|s| s.propagation = v1::PropagationMethod::Scaled.into()),
            Code::InvalidArgument,
            "propagation is the scaled angular spectrum, but",
        ),
        (Box::new(|s| s.propagation = 77), Code::InvalidArgument, "propagation is 77"),
        (Box::new(|s| s.display = "displays/none".into()), Code::NotFound, "display: displays/none does not exist"),
        (Box::new(|s| s.display = "none".into()), Code::InvalidArgument, "display is \"none\""),
        (
            Box::new(|s| s.wavelengths_m = vec![639e-9]),
            Code::InvalidArgument,
            "wavelengths_m[0] is 639nm, but must be one of 515nm",
        ),
        (Box::new(|s| s.planes[0].target = missing.clone()), Code::NotFound, "planes[0].target: artifact sha256-"),
        (Box::new(|s| s.planes[0].target.clear()), Code::InvalidArgument, "planes[0].target is empty"),
        (Box::new(|s| s.planes[0].target = truncated.clone()), Code::InvalidArgument, "planes[0].target (sha256-"),
        (Box::new(|s| s.planes[0].target = text.clone()), Code::InvalidArgument, "planes[0].target (sha256-"),
        (Box::new(|s| s.planes[0].target = black.clone()), Code::InvalidArgument, "planes[0].target (sha256-"),
        (Box::new(|s| s.planes[0].target = dot.clone()), Code::InvalidArgument, "planes[0].target (sha256-"),
        (Box::new(|s| s.target_fit = 4), Code::InvalidArgument, "planes[0].target (sha256-"),
        (Box::new(|s| s.target_fit = 9), Code::InvalidArgument, "target_fit is 9"),
        (
            Box::new(|s| s.kernel = Some(v1::KernelChoice::version("displays/lab/kernels/515nm-50mm/versions/7"))),
            Code::NotFound,
            "kernel.version: displays/lab/kernels/515nm-50mm/versions/7",
        ),
        (
            Box::new(|s| s.kernel = Some(v1::KernelChoice::version("displays/lab/kernels/515nm-60mm/versions/1"))),
            Code::InvalidArgument,
            "kernel.version is a version of displays/lab/kernels/515nm-60mm, but must be a version of \
             displays/lab/kernels/515nm-50mm, the kernel of this wavelength and place",
        ),
        (
            Box::new(|s| s.kernel = Some(v1::kernel_choice::Kind::Alias("best".into()).into())),
            Code::InvalidArgument,
            "kernel.alias is \"best\", but must be an alias of displays/lab/kernels/515nm-50mm: it has none",
        ),
        (
            Box::new(|s| s.kernel = Some(v1::KernelChoice::active())),
            Code::FailedPrecondition,
            "kernel: no version of displays/lab/kernels/515nm-50mm is active",
        ),
        (Box::new(|s| s.kernel = Some(v1::KernelChoice::default())), Code::InvalidArgument, "kernel"),
        (
            Box::new(|s| s.iterations = Some(10_001)),
            Code::InvalidArgument,
            "iterations is 10001, but must be 1 to 10000",
        ),
        (Box::new(|s| s.learning_rate = Some(-1.0)), Code::InvalidArgument, "learning_rate is -1"),
        (
            Box::new(|s| s.initial_phase = Some(random_phase(7.0))),
            Code::InvalidArgument,
            "initial_phase.random.range_rad is 7",
        ),
        (Box::new(|s| s.planes.clear()), Code::InvalidArgument, "planes is empty"),
        (Box::new(|s| s.planes.push(s.planes[0].clone())), Code::InvalidArgument, "planes[1].place is 50mm again"),
        (
            Box::new(|s| s.depth_map = target.clone()),
            Code::InvalidArgument,
            "depth_map is given, but there is one plane",
        ),
        (
            Box::new(|s| s.region = Some(v1::Region { x_px: 60, width_px: 5, height_px: 1, y_px: 0 })),
            Code::InvalidArgument,
            "region is 5×1 px at (60, 0)",
        ),
    ];
    for (change, code, start) in cases {
        let mut spec = optimize(&target);
        change(&mut spec);
        let answer = submit(&serving, job_spec::Kind::OptimizeHologram(spec), "").await;
        expect(answer, code, &format!("spec.optimize_hologram.{start}"));
    }
    let listed = serving.jobs().list_jobs(v1::ListJobsRequest::default()).await.unwrap().into_inner();
    assert_eq!(listed.jobs, [], "a refused request leaves no job");
    let answer = serving.jobs().submit_job(v1::SubmitJobRequest::default()).await;
    expect(answer, Code::InvalidArgument, "spec is not set");
}

/// The hologram of a lens [levels of 256]. Its light forms a bright spot at x = x0.
fn lens(height_px: usize, width_px: usize, x0: f64) -> Plane<u16> {
    Plane::from_fn(height_px, width_px, |y, x| {
        let squared = ((x as f64 - x0).powi(2) + (y as f64 - 24.0).powi(2)) * 64e-12;
        (squared / (2.0 * 0.05 * 515e-9) * 256.0).round().rem_euclid(256.0) as u16
    })
}

/// The photograph of a hologram on an ideal display.
fn photo(hologram: &Plane<u16>) -> Vec<u8> {
    let grid = Grid::try_new(48, 64, 8e-6).unwrap();
    let (setup, _) = OpticalSetup::try_new(grid, 515e-9, 0.05).unwrap().planned().unwrap();
    let engine: Engine = Engine::new(&DisplayModel::ideal(setup), Detector::Pixel, None).unwrap();
    let light = engine.light(&hologram.map(|level| f32::from(level) * std::f32::consts::TAU / 256.0)).unwrap();
    let brightest = light.values().iter().copied().fold(0.0, f32::max);
    pictures::grey_png_linear(&light.map(|light| 0.9 * light / brightest)).unwrap()
}

#[tokio::test]
async fn datasets_accept_only_pairs_that_fit() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let mut datasets = DatasetServiceClient::new(serving.channel.clone());
    let dataset = v1::Dataset {
        name: "datasets/first".into(),
        display: "displays/lab".into(),
        place: Some(v1::Place::at_m(0.05)),
        ..Default::default()
    };
    datasets.create_dataset(v1::CreateDatasetRequest { dataset: Some(dataset) }).await.unwrap();
    let refused = async |kind, code, start: &str| expect(submit(&serving, kind, "").await, code, start);
    let learn = v1::LearnKernel { datasets: vec!["datasets/first".into()], ..Default::default() };
    refused(
        job_spec::Kind::LearnKernel(learn.clone()),
        Code::FailedPrecondition,
        "spec.learn_kernel.datasets[0]: datasets/first is empty",
    )
    .await;

    let levels = |plane: &Plane<u16>| pictures::levels_png(plane, 8).unwrap();
    let (small, first) = (serving.upload(&levels(&lens(48, 63, 32.0))).await, lens(48, 64, 24.0));
    let (phase, good_photo) = (serving.upload(&levels(&first)).await, serving.upload(&photo(&first)).await);
    let add = |id: &str, phase: &str, photo: &str| v1::AddPairsRequest {
        dataset: "datasets/first".into(),
        pairs: vec![v1::Pair { id: id.into(), pattern: phase.into(), photo: photo.into(), ..Default::default() }],
    };
    expect(datasets.add_pairs(add("a", &small, &good_photo)).await, Code::InvalidArgument, "pairs[0].pattern (sha256-");
    expect(datasets.add_pairs(add("a", &phase, &small)).await, Code::InvalidArgument, "pairs[0].photo (sha256-");
    expect(datasets.add_pairs(add("a", "", &good_photo)).await, Code::InvalidArgument, "pairs[0].pattern is empty");
    expect(datasets.add_pairs(add("a/b", &phase, &good_photo)).await, Code::InvalidArgument, "pairs[0].id is");
    datasets.add_pairs(add("a", &phase, &good_photo)).await.unwrap();
    refused(
        job_spec::Kind::LearnKernel(learn.clone()),
        Code::FailedPrecondition,
        "spec.learn_kernel.datasets[0]: datasets/first is still open",
    )
    .await;

    assert_refused(finalize(&serving, "datasets/first").await, "DATASET_SPLIT_EMPTY: datasets/first has no ");
    let second = lens(48, 64, 40.0);
    let (phase, other_photo) = (serving.upload(&levels(&second)).await, serving.upload(&photo(&second)).await);
    datasets.add_pairs(add("b", &phase, &other_photo)).await.unwrap();
    let dataset = finalize(&serving, "datasets/first").await.unwrap();
    assert!(dataset.digest.starts_with("sha256-") && dataset.pair_count == 2);
    assert_eq!(finalize(&serving, "datasets/first").await.unwrap(), dataset, "finalizing again changes nothing");
    for step in [
        Step::Finalize(Finalize { validation_fraction: Some(0.3), ..Default::default() }),
        Step::Finalize(Finalize { seed: 1, ..Default::default() }),
        Step::Finalize(Finalize { keep_alignment: true, ..Default::default() }),
        Step::Align(Align { source: Some(Source::None(NoAlignment {})) }),
    ] {
        let answer = prepare(&serving, "datasets/first", step).await;
        assert_refused(answer, "spec.prepare_dataset.dataset: datasets/first is finalized");
    }

    refuses_impossible_jobs(&serving, learn, &phase).await;
}

/// Refuses jobs on the dataset `first` and on the display `lab`, which has no kernel and no simulated bench.
async fn refuses_impossible_jobs(serving: &Serving, learn: v1::LearnKernel, phase: &str) {
    let refused = async |kind, code, start: &str| expect(submit(serving, kind, "").await, code, start);
    let zero = Some(0);
    let bad = v1::LearnKernel { degree: zero, epochs: zero, learning_rate: Some(0.0), ..learn.clone() };
    let message = submit(serving, job_spec::Kind::LearnKernel(bad), "").await.unwrap_err().message().to_owned();
    for wrong in ["degree is 0", "epochs is 0", "learning_rate is 0"] {
        let line = message.lines().find(|line| line.contains(wrong));
        assert!(line.is_some_and(|line| line.contains("; leave it out for ")), "{message}");
    }
    let start_version = "displays/lab/kernels/515nm-60mm/versions/1".to_owned();
    let bad = v1::LearnKernel { start_version, ..learn.clone() };
    refused(
        job_spec::Kind::LearnKernel(bad),
        Code::InvalidArgument,
        "spec.learn_kernel.start_version is displays/lab/",
    )
    .await;
    let bad = v1::LearnKernel { detector: v1::Detector::Supersampled.into(), ..learn.clone() };
    refused(job_spec::Kind::LearnKernel(bad), Code::InvalidArgument, "spec.learn_kernel.detector is supersampled")
        .await;
    let bad = v1::LearnKernel { learning_rate: Some(f64::INFINITY), ..learn };
    refused(job_spec::Kind::LearnKernel(bad), Code::InvalidArgument, "spec.learn_kernel.learning_rate is inf").await;
    let evaluate = v1::EvaluateKernel { dataset: "datasets/first".into(), ..Default::default() };
    refused(
        job_spec::Kind::EvaluateKernel(evaluate),
        Code::FailedPrecondition,
        "spec.evaluate_kernel.kernel: no version of",
    )
    .await;
    let simulate = v1::SimulateCapture {
        display: "displays/lab".into(),
        place: Some(v1::Place::at_m(0.05)),
        pattern: phase.to_owned(),
        ..Default::default()
    };
    refused(
        job_spec::Kind::SimulateCapture(simulate),
        Code::FailedPrecondition,
        "spec.simulate_capture.display: displays/lab has no simulated bench",
    )
    .await;
    let mut kernels = KernelServiceClient::new(serving.channel.clone());
    let name = "displays/lab/kernels/515nm-50mm".to_owned();
    expect(kernels.get_kernel(v1::GetKernelRequest { name }).await, Code::NotFound, "displays/lab/kernels/515nm-50mm");
}

#[tokio::test]
async fn watcher_sees_the_end_of_a_job() {
    let serving = Serving::start().await;
    let job = submit_long(&serving).await;
    let request = v1::WatchJobRequest { name: job.name.clone() };
    let mut stream = serving.jobs().watch_job(request).await.unwrap().into_inner();
    let first = stream.message().await.unwrap().unwrap();
    assert_eq!(first.name, job.name);
    serving.jobs().cancel_job(v1::CancelJobRequest { name: job.name.clone() }).await.unwrap();
    let mut last = first;
    while let Some(job) = stream.message().await.unwrap() {
        // The place in the queue changes without a change of the job.
        assert!(job.revision >= last.revision);
        last = job;
    }
    assert_eq!(last.state(), v1::job::State::Cancelled);
    let again = serving.jobs().cancel_job(v1::CancelJobRequest { name: job.name.clone() }).await;
    expect(again, Code::FailedPrecondition, "");
    let events = v1::ListJobEventsRequest { name: job.name, ..Default::default() };
    assert!(!serving.jobs().list_job_events(events).await.unwrap().into_inner().events.is_empty());
    let missing = v1::WatchJobRequest { name: "jobs/none".into() };
    expect(serving.jobs().watch_job(missing).await.map(drop), Code::NotFound, "jobs/none does not exist");
}

/// Reads a job until its state is accepted.
async fn get_until(serving: &Serving, name: &str, wanted: impl Fn(&v1::Job) -> bool) -> v1::Job {
    loop {
        let job = serving.jobs().get_job(v1::GetJobRequest { name: name.to_owned() }).await.unwrap().into_inner();
        if wanted(&job) {
            return job;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test]
async fn a_queued_job_says_what_is_before_it_and_when_it_starts() {
    let serving = Serving::start().await;
    let display = v1::CreateDisplayRequest { display: Some(sized_display("slow", 512, 384)) };
    serving.displays().create_display(display).await.unwrap();
    let target = serving.upload(&picture()).await;
    let mut names = Vec::new();
    for _ in 0..3 {
        let spec = v1::OptimizeHologram { display: "displays/slow".into(), ..optimize(&target) };
        names.push(submit(&serving, job_spec::Kind::OptimizeHologram(spec), "").await.unwrap().name);
    }
    get_until(&serving, &names[0], |job| job.state() == v1::job::State::Running).await;
    let has_place = |job: &v1::Job| job.waiting.as_ref().is_some_and(|waiting| waiting.jobs_before.is_some());
    let job = get_until(&serving, &names[2], |job| has_place(job) && job.waits_for.contains("optimize")).await;
    let waiting = job.waiting.unwrap();
    assert_eq!(job.waits_for, "behind optimize hologram slow and another job");
    assert_eq!((waiting.reason(), waiting.jobs_before, waiting.others_before), (Reason::Turn, Some(1), Some(0)));
    let behind = waiting.behind.clone().unwrap();
    assert_eq!(
        (behind.name, behind.kind, behind.subject),
        (names[0].clone(), v1::job::Kind::OptimizeHologram.into(), "slow".into())
    );
    let [start_s, create_s] =
        [&waiting.expected_start_time, &job.create_time].map(|time| time.as_ref().unwrap().seconds);
    assert!(start_s >= create_s, "{waiting:?}");
    let list = v1::ListJobsRequest { view: v1::list_jobs_request::View::Basic.into(), ..Default::default() };
    let summary = serving.jobs().list_jobs(list).await.unwrap().into_inner().summaries.remove(0);
    assert_eq!(
        (summary.waits_for, summary.waiting.map(|waiting| waiting.reason)),
        (job.waits_for, Some(waiting.reason))
    );

    let request = v1::WatchJobRequest { name: names[2].clone() };
    let mut stream = serving.jobs().watch_job(request).await.unwrap().into_inner();
    let pause = v1::PauseQueueRequest { reason: "laser off".into(), ..Default::default() };
    serving.jobs().pause_queue(pause).await.unwrap();
    loop {
        // Nothing of the job changes, and a watcher learns of it all the same.
        let job = stream.message().await.unwrap().unwrap();
        if job.waits_for == "the queue is paused: laser off" {
            break assert_eq!(job.waiting.unwrap().reason(), Reason::Paused);
        }
    }
}

/// Waits until a job has ended, and returns it.
pub(crate) async fn watch_to_end(serving: &Serving, name: &str) -> v1::Job {
    let request = v1::WatchJobRequest { name: name.to_owned() };
    let mut stream = serving.jobs().watch_job(request).await.unwrap().into_inner();
    let mut last = None;
    while let Some(job) = stream.message().await.unwrap() {
        last = Some(job);
    }
    last.unwrap()
}

#[tokio::test]
async fn full_queue_refuses_with_a_retry_delay() {
    let serving = Serving::start_with(|config| config.queue_limit = 1).await;
    serving.display("lab").await;
    let target = serving.upload(&picture()).await;
    let kind = || job_spec::Kind::OptimizeHologram(optimize(&target));
    // One job runs and one waits. Which submit is refused depends on how soon the first job starts.
    let refused = loop {
        match submit(&serving, kind(), "").await {
            Ok(_) => {}
            Err(status) => break status,
        }
    };
    assert_eq!(refused.code(), Code::ResourceExhausted);
    assert!(refused.get_error_details().retry_info().unwrap().retry_delay.is_some());
}
