//! Tests of the whole loop on a small simulated display: ideal holograms, photographs, learning, and better holograms.
//! Interruptions and the number of threads must not change any byte of the results.

use super::super::*;
use super::bench::{Bench, DISTANCE};
use lightpath_artifacts::digest_of;
use lightpath_bench::SimulatedBench;
use lightpath_domain::dataset::{self, Dataset, Encoding, Finalization, Pair, PreparedDataset};
use lightpath_domain::display::Display;
use lightpath_domain::job::{
    Area, EvaluateKernel, FailureReason, Fit, HologramResult, ImagePlane, JobEffect, JobResult, JobSpec, JobState,
    Judging, LearnKernel, OptimizeHologram, PlaneResult, PrepareDataset, PrepareResult, PrepareStep, ReportKernel,
    SimulateCapture,
};
use lightpath_domain::kernel::{KernelKey, KernelModel};
use lightpath_domain::lineage::LearningParameters;
use lightpath_fixtures::{WAVELENGTH, display};
use lightpath_media::pictures::{self, Placement};
use lightpath_optics::hologram::Loss;
use lightpath_optics::{Carrier, Detector, Grid, HologramMethod, InitialPhase, Plane, RegionOfInterest};
use std::collections::BTreeMap;

/// Options of a split that holds out a quarter of the pairs for testing.
const QUARTER: Finalization =
    Finalization { validation_fraction: 0.0, test_fraction: 0.25, seed: 1, keep_alignment: true };

pub(super) struct Lab {
    pub(super) bench: Bench,
    pub(super) height_px: usize,
    pub(super) width_px: usize,
}

impl Lab {
    pub(super) async fn new() -> Self {
        let simulated_bench =
            SimulatedBench { seed: 3, camera_noise: 0.002, misalignment_px: 0.3, ..SimulatedBench::FAIR };
        let carrier = Some(Carrier::HalfOrderX);
        let display = Display { carrier, simulated_bench: Some(simulated_bench), ..display("lab") };
        let (height_px, width_px) = (display.height_px as usize, display.width_px as usize);
        Self { bench: Bench::new(display).await, height_px, width_px }
    }

    async fn put(&self, bytes: Vec<u8>) -> String {
        let size_bytes = bytes.len() as u64;
        let digest = self.bench.artifacts.put_bytes(bytes).await.unwrap();
        self.bench.store.record_artifact(&digest, size_bytes, "", None, 1).await.unwrap().unwrap();
        digest
    }

    /// Stores a picture of bars and a blob, which depends on `n`.
    async fn target(&self, n: usize) -> String {
        let picture = Plane::from_fn(self.height_px, self.width_px, |y, x| {
            let bars = ((x / (4 + n % 5) + y / (6 + n % 3)) % 2) as f32;
            let (dy, dx) = (y as f32 - 20.0 - n as f32, x as f32 - 30.0 + 2.0 * n as f32);
            0.15 + 0.35 * bars + 0.5 * (-(dy * dy + dx * dx) / 150.0).exp()
        });
        self.put(pictures::grey_png_srgb(&picture).unwrap()).await
    }

    /// Runs workers until the condition holds for the job.
    pub(super) async fn run_until(&self, config: WorkerConfig, id: &str, condition: impl Fn(&Job) -> bool) -> Job {
        let working = self.bench.start(config, OpticsTask);
        self.bench.until(id, condition).await;
        working.stop().await;
        self.bench.store.job(id).await.unwrap()
    }

    /// Runs a job to its end, checks that it succeeded, and returns its result.
    pub(super) async fn run_job(&self, request_id: &str, spec: JobSpec) -> JobResult {
        let id = self.bench.submit(request_id, spec, 1).await;
        let job = self.run_until(threads(2), &id, |job| job.state.has_ended()).await;
        assert_eq!(job.state, JobState::Succeeded, "{:?}", job.error);
        job.result.unwrap()
    }

    /// Interrupts the job after its first checkpoint, resumes it and returns its result.
    async fn interrupted(&self, request_id: &str, spec: JobSpec) -> JobResult {
        let id = self.bench.submit(request_id, spec, 1).await;
        let every_step = WorkerConfig { checkpoint_interval: Duration::ZERO, ..threads(2) };
        let job = self.run_until(every_step, &id, |job| job.checkpoint.is_some()).await;
        assert_eq!((job.state, job.attempt), (JobState::Queued, 1));
        let job = self.run_until(threads(1), &id, |job| job.state.has_ended()).await;
        assert_eq!((job.state, job.attempt), (JobState::Succeeded, 2), "{:?}", job.error);
        job.result.unwrap()
    }

    async fn hologram(&self, request_id: &str, spec: JobSpec) -> HologramResult {
        match self.run_job(request_id, spec).await {
            JobResult::OptimizeHologram(result) => *result,
            other => panic!("{other:?}"),
        }
    }

    pub(super) async fn photograph(&self, request_id: &str, pattern: &str) -> String {
        let (display, pattern) = ("lab".to_owned(), pattern.to_owned());
        let spec =
            SimulateCapture { display, wavelength: WAVELENGTH, distance: DISTANCE, pattern, seed: 1, elapsed_s: 0.0 };
        match self.run_job(request_id, JobSpec::SimulateCapture(spec)).await {
            JobResult::SimulateCapture(result) => result.photo,
            other => panic!("{other:?}"),
        }
    }

    /// Creates a dataset of ideal holograms and their photographs on the simulated bench.
    pub(super) async fn dataset(&self, pairs: usize) {
        let pairs = self.photographed(pairs).await;
        self.create_finalized(pairs).await;
    }

    /// Computes ideal holograms and photographs them on the simulated bench.
    async fn photographed(&self, pairs: usize) -> Vec<Pair> {
        let mut photographed = Vec::new();
        for n in 0..pairs {
            let ideal = self.hologram(&format!("ideal{n}"), optimize(self.target(n).await, None, 40)).await;
            let photo = self.photograph(&format!("photo{n}"), pattern(&ideal)).await;
            let pattern = pattern(&ideal).to_owned();
            photographed.push(Pair { id: format!("p{n}"), pattern, photo, ..Pair::default() });
        }
        photographed
    }

    /// Computes ideal holograms, and their photographs on an ideal display with a camera that saturates at half the
    /// largest light.
    async fn overexposed(&self, pairs: usize) -> Vec<Pair> {
        let mut photographed = Vec::new();
        for n in 0..pairs {
            let ideal = self.hologram(&format!("ideal{n}"), optimize(self.target(n).await, None, 40)).await;
            let file = self.bench.artifacts.read_all(&plane(&ideal).reconstruction).await.unwrap();
            let clipped = pictures::photograph(&file, Encoding::Srgb).unwrap().map(|light| (2.0 * light).min(1.0));
            let photo = self.put(pictures::grey_png_linear(&clipped).unwrap()).await;
            let pattern = pattern(&ideal).to_owned();
            photographed.push(Pair { id: format!("p{n}"), pattern, photo, ..Pair::default() });
        }
        photographed
    }

    /// Creates an open dataset of these pairs.
    async fn create_open(&self, id: &str, pairs: &[Pair]) {
        let dataset = Dataset::empty(id.to_owned(), "lab".to_owned(), WAVELENGTH, DISTANCE, Encoding::Linear);
        self.bench.store.create_dataset(&dataset, 1).await.unwrap();
        for pair in pairs {
            self.bench.store.add_pairs(id, std::slice::from_ref(pair), &[]).await.unwrap();
        }
    }

    /// Creates the finalized dataset `photos` of these pairs, with a quarter of them held out for testing.
    async fn create_finalized(&self, pairs: Vec<Pair>) {
        self.create_open("photos", &pairs).await;
        // The real task would exclude pairs that some of the tests need, so a simple task finalizes the dataset.
        let close = |_: &Job, context: &JobContext| {
            let open = context.wait(context.store().dataset("photos"))?;
            let splits = dataset::draw_split(&open.pairs, QUARTER.validation_fraction, QUARTER.test_fraction, 1);
            let prepared = PreparedDataset {
                dataset: open.id,
                revision: open.revision,
                alignment: None,
                checks: BTreeMap::new(),
                findings: Vec::new(),
                closing: Some((QUARTER, splits.into_iter().map(|(id, split)| (id, Some(split))).collect())),
            };
            let result = JobResult::PrepareDataset(PrepareResult::default());
            Ok(TaskOutput { result, effect: JobEffect::Dataset(Box::new(prepared)) })
        };
        let id = self.bench.submit("close", prepare("photos"), 1).await;
        let working = self.bench.start(threads(1), close);
        assert_eq!(self.bench.ended(&id).await.state, JobState::Succeeded);
        working.stop().await;
    }

    /// Mean squared error between the target and a photograph of the hologram, with fitted gain.
    async fn captured_error(&self, request_id: &str, hologram: &HologramResult, target: &str) -> f64 {
        let photo = self.photograph(request_id, pattern(hologram)).await;
        let photo =
            pictures::photograph(&self.bench.artifacts.read_all(&photo).await.unwrap(), Encoding::Linear).unwrap();
        let target = self.bench.artifacts.read_all(target).await.unwrap();
        let target = pictures::target_intensity(
            &target,
            Encoding::Srgb,
            &Placement::whole(Fit::Exact, self.height_px, self.width_px),
        )
        .unwrap();
        let region = RegionOfInterest::middle(&Grid::try_new(self.height_px, self.width_px, 8e-6).unwrap());
        let gain = lightpath_optics::metrics::Gain::Fitted;
        lightpath_optics::metrics::mse(&photo, &target, region, gain).unwrap()
    }
}

/// The first pattern of the hologram.
fn pattern(hologram: &HologramResult) -> &str {
    &hologram.wavelengths[0].subframes[0].pattern
}

/// The first plane of the hologram.
fn plane(hologram: &HologramResult) -> &PlaneResult {
    &hologram.wavelengths[0].planes[0]
}

fn region() -> RegionOfInterest {
    RegionOfInterest::try_new(&Grid::try_new(48, 64, 8e-6).unwrap(), 6, 5, 52, 38).unwrap()
}

pub(super) fn threads(compute_threads: usize) -> WorkerConfig {
    WorkerConfig { compute_threads, ..WorkerConfig::default() }
}

fn optimize(target: String, kernel_version: Option<u32>, iterations: u32) -> JobSpec {
    JobSpec::OptimizeHologram(Box::new(OptimizeHologram {
        display: "lab".to_owned(),
        wavelengths: vec![WAVELENGTH],
        planes: vec![ImagePlane { distance: DISTANCE, target, weight: 1.0 }],
        depth_map: None,
        target_encoding: Encoding::Srgb,
        target_fit: Fit::Contain,
        target_area: Area::Display,
        kernel_versions: vec![vec![kernel_version]],
        judging_versions: Vec::new(),
        propagation: None,
        method: HologramMethod::Lbfgs,
        iterations,
        subframes: 1,
        initial_phase: InitialPhase::Random { range_rad: 1.0 },
        seed: 7,
        loss: Loss::default(),
        detector: Detector::Pixel,
        region_of_interest: region(),
        weight_mask: None,
        quantization_aware: false,
        judge: Judging::Full,
    }))
}

/// A hologram job whose holograms a version of the kernel judges.
fn judged_by(version: u32, spec: JobSpec) -> JobSpec {
    let JobSpec::OptimizeHologram(spec) = spec else { panic!("{spec:?}") };
    JobSpec::OptimizeHologram(Box::new(OptimizeHologram { judging_versions: vec![vec![Some(version)]], ..*spec }))
}

pub(super) fn learn(model: KernelModel, epochs: u32, refinement_evaluations: u32) -> JobSpec {
    JobSpec::LearnKernel(LearnKernel {
        datasets: vec!["photos".to_owned()],
        display: "lab".to_owned(),
        start_version: None,
        parameters: LearningParameters {
            model,
            degree: Some(4),
            epochs: Some(epochs),
            learning_rate: None,
            refinement_evaluations: Some(refinement_evaluations),
            seed: 1,
            detector: Detector::Pixel,
            region_of_interest: region(),
        },
    })
}

fn evaluate(kernel_version: Option<u32>) -> JobSpec {
    JobSpec::EvaluateKernel(EvaluateKernel {
        dataset: "photos".to_owned(),
        kernel: KernelKey { display: "lab".to_owned(), wavelength: WAVELENGTH, distance: DISTANCE },
        kernel_version,
        region_of_interest: region(),
    })
}

fn prepare(dataset: &str) -> JobSpec {
    let (dataset, display) = (dataset.to_owned(), "lab".to_owned());
    JobSpec::PrepareDataset(PrepareDataset { dataset, display, step: PrepareStep::Finalize(QUARTER) })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn learned_kernel_gives_better_holograms() {
    let lab = Lab::new().await;
    lab.dataset(8).await;
    let JobResult::LearnKernel(learned) = lab.run_job("learn", learn(KernelModel::Display, 3, 60)).await else {
        panic!()
    };
    let [kernel] = &learned.kernels[..] else { panic!("{learned:?}") };
    assert_eq!(kernel.kernel_version, "displays/lab/kernels/515nm-4mm/versions/1");
    let metrics = &kernel.metrics;
    assert_eq!((metrics.train_pairs, metrics.test_pairs), (6, 2));
    assert!(metrics.test_loss < 0.3 * metrics.ideal_test_loss, "{metrics:?}");
    let captured = metrics.captured.unwrap();
    assert!(captured.psnr_db > captured.ideal_psnr_db + 3.0, "{captured:?}");
    assert!(!metrics.no_better_than_ideal());
    assert_eq!((learned.degree, kernel.left_out_pairs.as_slice()), (4, [].as_slice()));

    for (request_id, version, expected) in
        [("learned", Some(1), metrics.test_loss), ("ideal", None, metrics.ideal_test_loss)]
    {
        let JobResult::EvaluateKernel(found) = lab.run_job(request_id, evaluate(version)).await else { panic!() };
        let test: Vec<f64> =
            found.pairs.iter().filter(|pair| pair.split == dataset::Split::Test).map(|pair| pair.loss).collect();
        assert_eq!((found.pairs.len(), test.len()), (8, 2));
        assert!((test.iter().sum::<f64>() / 2.0 - expected).abs() < 1e-12, "{request_id}");
    }

    let target = lab.target(20).await;
    let ideal = lab.hologram("new ideal", judged_by(1, optimize(target.clone(), None, 100))).await;
    let better = lab.hologram("new learned", optimize(target.clone(), Some(1), 100)).await;
    let subframe = &better.wavelengths[0].subframes[0];
    let photos = [lab.photograph("levels", &subframe.pattern).await, lab.photograph("phase", &subframe.phase).await];
    assert_eq!(photos[0], photos[1], "response, carrier and quantization are applied to a phase");
    assert!(plane(&ideal).quality.unwrap().pixel.psnr_db > 20.0, "{ideal:?}");
    let (before, after) = (
        lab.captured_error("see ideal", &ideal, &target).await,
        lab.captured_error("see learned", &better, &target).await,
    );
    assert!(after < 0.5 * before, "captured error {before} through the ideal kernel, {after} through the learned one");
    // The learned kernel knows what the photograph of the ideal hologram shows, which its own kernel does not.
    let (own, photo_db) = (plane(&ideal), -10.0 * before.log10());
    let expected_db = own.judged_by.as_ref().unwrap().quality.pixel.psnr_db;
    assert!((expected_db - photo_db).abs() < 1.0, "{expected_db} dB expected, {photo_db} dB in the photograph");
    assert!(own.quantized_quality.unwrap().pixel.psnr_db > photo_db + 5.0, "{own:?}, {photo_db} dB in the photograph");
    // The learned kernel promises too much of its own hologram, unless its error on test photographs counts.
    let (own, photo_db) = (plane(&better), -10.0 * after.log10());
    let expected = own.in_photograph.unwrap();
    assert!((expected.psnr_db - photo_db).abs() < 2.0, "{expected:?}, {photo_db} dB in the photograph");
    assert!(own.quantized_quality.unwrap().pixel.psnr_db > photo_db + 2.0, "{own:?}, {photo_db} dB in the photograph");
    assert_eq!(own.judged_by, None);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn saturated_pixels_do_not_count_in_losses() {
    let lab = Lab::new().await;
    lab.create_finalized(lab.overexposed(4).await).await;
    // The photographs are the prediction of the ideal kernel, rounded to 8-bit sRGB and doubled: (2 · 2.3 / 255)² / 12.
    let rounding = 3e-5;
    let JobResult::EvaluateKernel(found) = lab.run_job("evaluate", evaluate(None)).await else { panic!() };
    assert_eq!(found.pairs.len(), 4);
    for pair in &found.pairs {
        assert!(pair.loss < rounding && pair.loss_full_frame < rounding, "{pair:?}");
    }
    let JobResult::LearnKernel(learned) = lab.run_job("learn", learn(KernelModel::Smooth, 1, 2)).await else {
        panic!()
    };
    let metrics = &learned.kernels[0].metrics;
    for loss in [metrics.ideal_test_loss, metrics.ideal_test_loss_full_frame] {
        assert!(loss > 0.0 && loss < rounding, "{metrics:?}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn fully_saturated_photograph_is_refused_before_learning() {
    let lab = Lab::new().await;
    let mut pairs = lab.overexposed(3).await;
    let white = Plane::filled(lab.height_px, lab.width_px, 1.0);
    pairs[1].photo = lab.put(pictures::grey_png_linear(&white).unwrap()).await;
    pairs[1].split = Some(dataset::Split::Test);
    lab.create_finalized(pairs).await;
    for (request_id, spec) in [("learn", learn(KernelModel::Smooth, 1, 2)), ("evaluate", evaluate(None))] {
        let id = lab.bench.submit(request_id, spec, 1).await;
        let job = lab.run_until(threads(2), &id, |job| job.state.has_ended()).await;
        let error = job.error.unwrap();
        assert_eq!((job.state, error.reason.as_str()), (JobState::Failed, "INVALID_INPUT"));
        assert!(error.message.starts_with("pair \"p1\": photo is saturated at every pixel"), "{}", error.message);
        let stage = job.progress.map(|progress| progress.stage).unwrap_or_default();
        assert!(!["learn", "refine"].contains(&stage.as_str()), "{stage}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn interruptions_and_thread_count_do_not_change_results() {
    let lab = Lab::new().await;
    let spec = optimize(lab.target(1).await, None, 60);
    let whole = lab.hologram("whole", spec.clone()).await;
    let JobResult::OptimizeHologram(resumed) = lab.interrupted("interrupted", spec).await else { panic!() };
    // Only the measured times may differ.
    assert_eq!(HologramResult { iteration_time_s: whole.iteration_time_s, ..*resumed }, whole);

    lab.dataset(4).await;
    let key = KernelKey { display: "lab".to_owned(), wavelength: WAVELENGTH, distance: DISTANCE };
    let mut version = 0;
    for (name, spec) in [
        ("smooth", learn(KernelModel::Smooth, 2, 6)),
        ("display", learn(KernelModel::Display, 2, 12)),
        ("varying", learn(KernelModel::Varying, 2, 6)),
        ("dense", learn(KernelModel::Dense, 3, 0)),
        ("paper", learn(KernelModel::Paper, 3, 0)),
    ] {
        let JobResult::LearnKernel(whole) = lab.run_job(name, spec.clone()).await else { panic!() };
        let JobResult::LearnKernel(resumed) = lab.interrupted(&format!("{name} interrupted"), spec).await else {
            panic!()
        };
        assert_eq!(whole.loss_history, resumed.loss_history, "{name}");
        assert_eq!(whole.kernels[0].metrics, resumed.kernels[0].metrics, "{name}");
        version += 2;
        let [first, second] = [
            lab.bench.store.kernel_version(&key, version - 1).await.unwrap().content,
            lab.bench.store.kernel_version(&key, version).await.unwrap().content,
        ];
        assert_eq!(first.artifact, second.artifact, "{name}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn interrupted_preparation_resumes_and_gives_the_same_dataset() {
    let lab = Lab::new().await;
    let pairs = lab.photographed(4).await;
    lab.create_open("whole", &pairs).await;
    let JobResult::PrepareDataset(whole) = lab.run_job("whole", prepare("whole")).await else { panic!() };
    let counts = whole.split_counts.unwrap();
    assert_eq!((counts.train, counts.test, counts.excluded), (3, 1, 0), "{:?}", whole.findings);

    // The file of the last photograph is missing during the first attempt.
    let last = lab.bench.artifacts.read_all(&pairs[3].photo).await.unwrap();
    lab.bench.artifacts.delete(&pairs[3].photo).await.unwrap();
    lab.create_open("interrupted", &pairs).await;
    let id = lab.bench.submit("interrupted", prepare("interrupted"), 1).await;
    let every_step = WorkerConfig { checkpoint_interval: Duration::ZERO, ..threads(2) };
    let job = lab.run_until(every_step, &id, |job| job.state.has_ended()).await;
    assert_eq!(job.error.unwrap().reason, FailureReason::ArtifactNotFound);
    let open = lab.bench.store.dataset("interrupted").await.unwrap();
    assert!(open.digest.is_none() && open.pairs.iter().all(|pair| pair.checks.is_none()), "{open:?}");

    assert_eq!(lab.put(last.clone()).await, digest_of(&last));
    lab.bench.store.retry(&id, 3).await.unwrap();
    let job = lab.run_until(threads(1), &id, |job| job.state.has_ended()).await;
    assert_eq!(job.progress.unwrap().steps_total, 1, "three of the four pairs were checked by the first attempt");
    assert_eq!(job.result, Some(JobResult::PrepareDataset(whole)));
    let closed = lab.bench.store.dataset("interrupted").await.unwrap();
    assert_eq!(closed.digest, Some(dataset::digest(&closed)));
    assert!(closed.pairs.iter().all(|pair| pair.checks.is_some()));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn preparation_fails_if_its_dataset_was_changed() {
    let lab = Lab::new().await;
    let mut pairs = lab.photographed(4).await;
    let late = pairs.pop().unwrap();
    lab.create_open("d", &pairs).await;
    let id = lab.bench.submit("prepare", prepare("d"), 3).await;
    let add = late.clone();
    let task = move |job: &Job, context: &JobContext| {
        let output = OpticsTask.run(job, context)?;
        if job.attempt == 1 {
            context.wait(context.store().add_pairs("d", std::slice::from_ref(&add), &[]))?;
        }
        Ok(output)
    };
    let working = lab.bench.start(threads(2), task);
    let job = lab.bench.ended(&id).await;
    let error = job.error.unwrap();
    assert_eq!((job.state, job.attempt, error.reason), (JobState::Failed, 1, FailureReason::DatasetChanged));
    let open = lab.bench.store.dataset("d").await.unwrap();
    assert!(open.digest.is_none() && open.pairs.len() == 4 && open.pairs.iter().all(|pair| pair.split.is_none()));
    lab.bench.store.retry(&id, 3).await.unwrap();
    let job = lab.bench.ended(&id).await;
    let Some(JobResult::PrepareDataset(result)) = job.result else { panic!("{:?}", job.error) };
    let counts = result.split_counts.unwrap();
    assert_eq!(counts.train + counts.test, 4);
    working.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn cancelled_preparation_and_report_stop_without_effect() {
    let lab = Lab::new().await;
    lab.dataset(4).await;
    let JobResult::LearnKernel(_) = lab.run_job("learn", learn(KernelModel::Smooth, 1, 2)).await else { panic!() };
    let open: Vec<Pair> = lab.bench.store.dataset("photos").await.unwrap().pairs;
    lab.create_open("open", &open.into_iter().map(|pair| Pair { split: None, ..pair }).collect::<Vec<_>>()).await;
    let kernel = KernelKey { display: "lab".to_owned(), wavelength: WAVELENGTH, distance: DISTANCE };
    let report = JobSpec::ReportKernel(ReportKernel { kernel, version: 1 });
    let id = lab.bench.submit("whole report", report.clone(), 1).await;
    let whole = lab.run_until(threads(2), &id, |job| job.state.has_ended()).await;
    let progress = whole.progress.expect("a report has progress");
    assert!(progress.steps_total > 0 && progress.step == progress.steps_total, "{progress:?}");
    let Some(JobResult::ReportKernel(made)) = whole.result else { panic!("{:?}", whole.error) };
    assert!(made.figures.iter().any(|figure| figure.name.starts_with("residual-p")), "{made:?}");

    // The job is cancelled before its work begins, so that the first check stops it.
    let wait = |job: &Job, context: &JobContext| {
        while context.should_stop().is_none() {
            std::thread::yield_now();
        }
        OpticsTask.run(job, context)
    };
    let working = lab.bench.start(threads(2), wait);
    for (request_id, spec) in [("report", report), ("prepare", prepare("open"))] {
        let id = lab.bench.submit(request_id, spec, 3).await;
        lab.bench.until(&id, |job| job.state == JobState::Running).await;
        lab.bench.store.cancel(&id, 4).await.unwrap();
        let job = lab.bench.ended(&id).await;
        assert_eq!((job.state, job.result), (JobState::Cancelled, None), "{request_id}");
    }
    working.stop().await;
    assert!(lab.bench.store.dataset("open").await.unwrap().digest.is_none());
}
