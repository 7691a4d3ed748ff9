//! Stored JSON: jobs, their results, displays, metrics and lineages of kernels, exactly as the database stores them.
//!
//! A change of the files in `stored/` is a change of stored data. After the first release it needs a migration.
#![allow(clippy::unwrap_used)]

use lightpath_bench::SimulatedBench;
use lightpath_camera::alignment::PointPair;
use lightpath_domain::dataset::{
    Alignment, AlignmentMethod, CameraMap, Encoding, Finalization, Finding, FindingKind, LargestValue, PairChecks,
    Split, SplitCounts,
};
use lightpath_domain::display::Display;
use lightpath_domain::expected_psnr::ExpectedPsnr;
use lightpath_domain::job::{
    AlignBy, Area, CapturePhotos, CapturePhotosResult, CaptureResult, CapturedPhoto, EvaluateKernel, EvaluateResult,
    FailureReason, Fit, HologramResult, ImagePlane, JobError, JobResult, JobSpec, JudgedBy, Judging, LearnKernel,
    LearnResult, LearnedKernel, NamedPattern, OptimizeHologram, PairLoss, PlaneOpinion, PlaneResult, PrepareDataset,
    PrepareResult, PrepareStep, Progress, ReportFigure, ReportKernel, ReportResult, Retaken, SimulateCapture, Subframe,
    SuggestHolograms, SuggestResult, SuggestedHologram, VerifyHologram, VerifyResult, WavelengthResult,
};
use lightpath_domain::kernel::{CapturedQuality, KernelKey, KernelMetrics};
use lightpath_domain::kernel_format::KernelFormat;
use lightpath_domain::lineage::{
    Import, KernelLineage, KernelOrigin, LearnedDataset, Learning, LearningParameters, Made, OriginalVersion,
};
use lightpath_domain::planning;
use lightpath_domain::units::{Distance, Wavelength};
use lightpath_optics::engine::photometry::Quantity;
use lightpath_optics::hologram::{DetectorQuality, Loss, Quality};
use lightpath_optics::learning::{Measure, ModelPart, PartCost, PartStrength, Unit};
use lightpath_optics::second_opinion::SecondOpinion;
use lightpath_optics::{
    Carrier, ConvolutionMethod, Detector, Grid, HologramMethod, InitialPhase, KernelModel, Orders, RegionOfInterest,
    ValidityReport,
};
use serde::{Serialize, de::DeserializeOwned};
use std::fmt::Debug;
use std::path::Path;

const GREEN: Wavelength = Wavelength { pm: 515_000 };
const NEAR: Distance = Distance { nm: 4_000_000 };
const FAR: Distance = Distance { nm: 5_000_000 };

/// Checks a request as `check_stored` does, and the word for its kind.
fn check_job(name: &str, spec: &JobSpec) {
    assert_eq!(serde_json::to_value(spec).unwrap()["kind"], spec.kind());
    check_stored(name, spec);
}

/// Checks that `value` is written exactly as in the file `stored/{name}.json`, and that reading the file gives `value`.
fn check_stored<T: Serialize + DeserializeOwned + PartialEq + Debug>(name: &str, value: &T) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/stored").join(format!("{name}.json"));
    let written = serde_json::to_string_pretty(value).unwrap() + "\n";
    let expected = std::fs::read_to_string(&path).unwrap_or_default();
    assert_eq!(written, expected, "{name}.json should be\n{written}");
    assert_eq!(&serde_json::from_str::<T>(&expected).unwrap(), value);
}

const OPINION: SecondOpinion = SecondOpinion { rows: 8, engine_psnr_db: 30.5, independent_psnr_db: 30.25 };

fn digest(n: u32) -> String {
    format!("sha256-{n:064x}")
}

fn display() -> Display {
    Display {
        id: "lab".to_owned(),
        width_px: 64,
        height_px: 48,
        pixel_pitch_m: 8e-6,
        bit_depth: 1,
        wavelengths: vec![GREEN, Wavelength { pm: 632_816 }],
        phase_response_rad: Some(vec![0.0, 3.5]),
        carrier: Some(Carrier::HalfOrderX),
        orders: Orders::All { fill_factor_x: 0.875, fill_factor_y: 1.0 },
        camera_fill_factor: 0.75,
        notes: "by the window".to_owned(),
        simulated_bench: Some(SimulatedBench { seed: u64::MAX, blur_px: 0.2, ..SimulatedBench::FAIR }),
    }
}

fn region() -> RegionOfInterest {
    RegionOfInterest::middle(&Grid::try_new(48, 64, 8e-6).unwrap())
}

fn propagation() -> ValidityReport {
    let setup = planning::setup(&display(), GREEN, NEAR).unwrap();
    // Round numbers: the values of the engine have their own tests.
    ValidityReport {
        explanation: "4 mm is within the critical distance".to_owned(),
        critical_distance_x_m: 0.0625,
        critical_distance_y_m: 0.03125,
        band_kept_x: 1.0,
        band_kept_y: 0.5,
        band_kept_area: 0.5,
        fresnel_number: 32.0,
        diffraction_angle_rad: 0.03125,
        spread_m: None,
        full_cone_x_m: 0.25,
        full_cone_y_m: 0.125,
        ..planning::assessed(&setup, "")
    }
}

#[test]
fn displays_are_stored_as_before() {
    check_stored("display", &display());
}

#[test]
fn hologram_jobs_are_stored_as_before() {
    let plane = |distance, weight| ImagePlane { distance, target: digest(1), weight };
    let mut spec = OptimizeHologram {
        display: "lab".to_owned(),
        wavelengths: vec![GREEN, Wavelength { pm: 632_816 }],
        planes: vec![plane(NEAR, 1.0), plane(FAR, 2.5)],
        depth_map: Some(digest(2)),
        target_encoding: Encoding::Srgb,
        target_fit: Fit::Contain,
        target_area: Area::Region,
        kernel_versions: vec![vec![None, Some(3)], vec![None, None]],
        judging_versions: vec![vec![Some(2), None], vec![None, None]],
        propagation: Some(ConvolutionMethod::BandLimited),
        method: HologramMethod::Adam { learning_rate: 0.1 },
        iterations: 200,
        subframes: 1,
        initial_phase: InitialPhase::Given(vec![digest(3), digest(4)]),
        seed: 7,
        loss: Loss { quantity: Quantity::Amplitude, speckle: 0.01, ..Loss::default() },
        detector: Detector::Supersampled,
        region_of_interest: region(),
        weight_mask: Some(digest(5)),
        quantization_aware: true,
        judge: Judging::Quick,
    };
    check_job("optimize_hologram_full", &JobSpec::OptimizeHologram(Box::new(spec.clone())));
    spec.wavelengths.truncate(1);
    spec.planes.truncate(1);
    spec.kernel_versions = vec![vec![None]];
    spec.judging_versions = vec![vec![None]];
    spec.method = HologramMethod::Lbfgs;
    spec.initial_phase = InitialPhase::Random { range_rad: 1.0 };
    spec.loss = Loss::default();
    (spec.depth_map, spec.propagation, spec.weight_mask, spec.quantization_aware) = (None, None, None, false);
    check_job("optimize_hologram", &JobSpec::OptimizeHologram(Box::new(spec)));
}

fn learning_parameters() -> LearningParameters {
    LearningParameters {
        model: KernelModel::Varying,
        degree: Some(8),
        epochs: Some(4),
        learning_rate: Some(0.05),
        refinement_evaluations: None,
        seed: 1,
        detector: Detector::Pixel,
        region_of_interest: region(),
    }
}

#[test]
fn learning_capture_and_evaluation_jobs_are_stored_as_before() {
    let (display, kernel_version) = ("lab".to_owned(), Some(3));
    let kernel = KernelKey { display: display.clone(), wavelength: GREEN, distance: Distance { nm: 4_000_000 } };
    let learn = LearnKernel {
        datasets: vec!["near".to_owned(), "far".to_owned()],
        display: display.clone(),
        start_version: Some((kernel.clone(), 2)),
        parameters: learning_parameters(),
    };
    check_job("learn_kernel", &JobSpec::LearnKernel(learn));
    let (pattern, dataset) = (digest(1), "near".to_owned());
    let capture = SimulateCapture {
        display: display.clone(),
        wavelength: GREEN,
        distance: Distance { nm: -12_500_000 },
        pattern,
        seed: 1,
        elapsed_s: 3600.0,
    };
    check_job("simulate_capture", &JobSpec::SimulateCapture(capture));
    let evaluate = EvaluateKernel { dataset, kernel, kernel_version, region_of_interest: region() };
    check_job("evaluate_kernel", &JobSpec::EvaluateKernel(evaluate));
}

#[test]
fn dataset_and_report_jobs_are_stored_as_before() {
    let prepare =
        |step| JobSpec::PrepareDataset(PrepareDataset { dataset: "near".to_owned(), display: "lab".to_owned(), step });
    let point = PointPair { display: [0.0, 1.5], camera: [412.25, 288.5] };
    let by_points = AlignBy::Points { photo_width_px: 4096, photo_height_px: 3000, points: vec![point] };
    check_job("align_by_points", &prepare(PrepareStep::Align(by_points)));
    check_job("align_by_dots", &prepare(PrepareStep::Align(AlignBy::Dots { photo: digest(1) })));
    check_job("align_by_pairs", &prepare(PrepareStep::Align(AlignBy::Pairs)));
    check_job("align_by_none", &prepare(PrepareStep::Align(AlignBy::None)));
    check_job("finalize_dataset", &prepare(PrepareStep::Finalize(finalization())));
    let kernel = KernelKey { display: "lab".to_owned(), wavelength: GREEN, distance: NEAR };
    let suggest = SuggestHolograms { kernel: kernel.clone(), version: 3, holograms: 4, seed: 7 };
    check_job("suggest_holograms", &JobSpec::SuggestHolograms(suggest));
    check_job("report_kernel", &JobSpec::ReportKernel(ReportKernel { kernel, version: 3 }));
    let verify = VerifyHologram { job: "0193".to_owned(), display: "lab".to_owned() };
    check_job("verify_hologram", &JobSpec::VerifyHologram(verify));
    let capture = CapturePhotos {
        display: "lab".to_owned(),
        wavelength: GREEN,
        distance: NEAR,
        patterns: vec![NamedPattern { id: "p01".to_owned(), pattern: digest(1) }],
        aligned_by: Some("bench-1".to_owned()),
        exposure_s: Some(0.0125),
        exposures: 4,
    };
    check_job("capture_photos", &JobSpec::CapturePhotos(capture));
}

fn finalization() -> Finalization {
    Finalization { validation_fraction: 0.125, test_fraction: 0.25, seed: u64::MAX, keep_alignment: true }
}

fn alignment() -> Alignment {
    Alignment {
        method: AlignmentMethod::Dots,
        map: CameraMap { homography: [1.0, 0.0, 2.5, 0.0, 1.0, -1.5, 0.0, 0.0, 1.0], distortion: [0.0; 4] },
        photo_height_px: 3000,
        photo_width_px: 4096,
        points: 24,
        residual_px: 0.125,
        corrected_px: 2.5,
        left_px: 0.75,
        explanation: "corrects a shift".to_owned(),
        photo: digest(1),
        before: digest(2),
        after: digest(3),
    }
}

fn finding() -> Finding {
    let (pair, message) = ("p01".to_owned(), "is black".to_owned());
    Finding { pair, kind: FindingKind::Black, excludes: true, message }
}

#[test]
fn datasets_are_stored_as_before() {
    check_stored("alignment", &alignment());
    let map = CameraMap { distortion: [0.0625, -0.125, 0.0, 0.25], ..alignment().map };
    check_stored("alignment_of_lens", &Alignment { map, ..alignment() });
    check_stored("finding", &finding());
    check_stored("finalization", &finalization());
    let checks = PairChecks {
        brightest: 0.75,
        correlation: Some(0.5),
        turn_px: Some(-0.25),
        largest: Some(LargestValue { value: 250.0, full_scale: 255.0, share: 0.5, share_below: 0.0 }),
        photo_px: [64, 48],
        map: Some(alignment().map),
        ..PairChecks::default()
    };
    check_stored("pair_checks", &checks);
}

#[test]
fn dataset_and_report_results_are_stored_as_before() {
    let prepared = PrepareResult {
        alignment: Some(alignment()),
        findings: vec![finding()],
        dataset_digest: Some(digest(4)),
        split_counts: Some(SplitCounts { train: 6, validation: 1, test: 2, excluded: 1 }),
    };
    check_stored("prepare_result", &JobResult::PrepareDataset(prepared));
    let figure = ReportFigure { name: "mtf.svg".to_owned(), title: "Contrast".to_owned(), artifact: digest(3) };
    let report = ReportResult { html: digest(1), arrays: digest(2), figures: vec![figure] };
    check_stored("report_result", &JobResult::ReportKernel(report));
    let suggested = SuggestedHologram {
        pattern: digest(4),
        picture: "portrait".to_owned(),
        phase_range_rad: 2.0,
        error_db: -1.5,
        part: ModelPart::Crosstalk,
        part_db: -3.0,
    };
    let suggestions = SuggestResult { holograms: vec![suggested], worth_photographs: 6.5 };
    check_stored("suggest_result", &JobResult::SuggestHolograms(suggestions));
    let plane = PlaneOpinion { wavelength: GREEN, distance: NEAR, opinions: [OPINION; 3] };
    let photo = CapturedPhoto {
        id: "p01".to_owned(),
        photo: digest(2),
        frame: 1234,
        exposure_time_ms: 1_800_000_000_000,
        exposure_s: 0.0125,
        correlation: Some(0.9375),
        other_correlation: Some(0.25),
        temperature_c: Some(23.5),
    };
    let captured = CapturePhotosResult {
        rig: "lightpath-rig 0.1.0".to_owned(),
        black_level: Some(0.0078125),
        photos: vec![photo],
        retaken: vec![Retaken { id: "p01".to_owned(), reason: "is black".to_owned() }],
    };
    check_stored("capture_photos_result", &JobResult::CapturePhotos(captured));
    check_stored("verify_result", &JobResult::VerifyHologram(VerifyResult { planes: vec![plane] }));
}

#[test]
fn hologram_capture_and_evaluation_results_are_stored_as_before() {
    let values = DetectorQuality {
        psnr_db: 30.5,
        ssim: Some(0.75),
        ms_ssim: None,
        diffraction_efficiency: 0.5,
        frame_efficiency: 0.625,
        speckle_contrast: Some(0.25),
    };
    let quality = Quality { point: values, pixel: values, supersampled: values };
    let plane = PlaneResult {
        distance: NEAR,
        reconstruction: digest(3),
        quality: Some(quality),
        quantized_quality: Some(quality),
        propagation: propagation(),
        judged_by: Some(JudgedBy {
            key: KernelKey { display: "lab".to_owned(), wavelength: GREEN, distance: NEAR },
            version: 2,
            quality,
        }),
        in_photograph: Some(ExpectedPsnr { psnr_db: 28.5, std_db: 0.75 }),
        other_orders_psnr_db: Some(21.5),
        second_opinion: Some(OPINION),
    };
    let hologram = WavelengthResult {
        wavelength: GREEN,
        subframes: vec![Subframe { pattern: digest(1), phase: digest(2) }],
        planes: vec![plane],
        intensity_scale: 1.5,
        loss: 0.125,
        largest_amplitude: None,
        notes: vec!["the target is dark".to_owned()],
    };
    let holograms = HologramResult {
        wavelengths: vec![hologram],
        colour_reconstructions: Vec::new(),
        detector: Detector::Pixel,
        iterations: 200,
        iteration_time_s: 0.0025,
        computed_by: None,
        judged: Judging::Full,
    };
    check_stored("hologram_result", &JobResult::OptimizeHologram(Box::new(holograms)));
    check_stored(
        "capture_result",
        &JobResult::SimulateCapture(CaptureResult { photo: digest(1), propagation: propagation() }),
    );
    let pair = PairLoss { pair: "p01".to_owned(), split: Split::Test, loss: 0.5, loss_full_frame: 0.25 };
    check_stored(
        "evaluate_result",
        &JobResult::EvaluateKernel(EvaluateResult { pairs: vec![pair], propagation: propagation() }),
    );
}

#[test]
fn learning_results_are_stored_as_before() {
    let kernel = LearnedKernel {
        kernel_version: "displays/lab/kernels/515nm-4mm/versions/1".to_owned(),
        dataset: "near".to_owned(),
        metrics: metrics(),
        left_out_pairs: vec!["p01".to_owned()],
        propagation: propagation(),
    };
    let measure = |name: &str, unit, value, std, hidden| Measure { name: name.to_owned(), unit, value, std, hidden };
    let sigma = |axis, value, std| measure(axis, Unit::Pixels, Some(value), Some(std), None);
    let strength = |part, kept, measures| PartStrength { part, kept, measures };
    let parts = vec![
        strength(ModelPart::Source, true, vec![measure("surface_rms", Unit::Radians, Some(1.5), None, None)]),
        strength(ModelPart::Crosstalk, true, vec![sigma("sigma_x", 0.5, 0.01), sigma("sigma_y", 0.25, 0.02)]),
        strength(ModelPart::UnevenResponse, false, vec![measure("rms", Unit::Fraction, None, None, Some(0.004))]),
        strength(ModelPart::VaryingTransferFunction, false, Vec::new()),
    ];
    check_stored(
        "learn_result",
        &JobResult::LearnKernel(LearnResult { kernels: vec![kernel], loss_history: vec![0.5], degree: 8, parts }),
    );
}

#[test]
fn progress_and_errors_of_jobs_are_stored_as_before() {
    let stage = "optimize".to_owned();
    check_stored("progress", &Progress { stage, step: 3, steps_total: 200, loss: Some(0.5), eta_s: Some(1.5) });
    let error =
        JobError { reason: FailureReason::Diverged, message: "the loss became NaN".to_owned(), retryable: false };
    check_stored("job_error", &error);
}

fn metrics() -> KernelMetrics {
    KernelMetrics {
        train_pairs: 6,
        validation_pairs: 1,
        test_pairs: 2,
        train_loss: 0.125,
        validation_loss: 0.25,
        test_loss: 0.25,
        ideal_test_loss: 0.5,
        test_loss_full_frame: 0.25,
        ideal_test_loss_full_frame: 0.5,
        captured: Some(CapturedQuality { psnr_db: 25.5, ideal_psnr_db: 20.5 }),
        parts: vec![PartCost { part: ModelPart::UnevenResponse, cost_db: 3.5, least_db: 2.5, most_db: 4.5 }],
    }
}

#[test]
fn kernels_are_stored_as_before() {
    check_stored("kernel_metrics", &metrics());
    let dataset = |distance, id: &str, n| LearnedDataset { distance, id: id.to_owned(), digest: digest(n) };
    let learning = Learning {
        job: "0193".to_owned(),
        datasets: vec![dataset(NEAR, "near", 1), dataset(FAR, "far", 2)],
        parent_version: Some("displays/lab/kernels/515nm-4mm/versions/2".to_owned()),
        parameters: Some(LearningParameters { seed: u64::MAX, ..learning_parameters() }),
    };
    let lineage = |origin| KernelLineage { origin, code_version: "0.1.0".to_owned() };
    check_stored("lineage_learned", &lineage(KernelOrigin::Learned(learning)));
    let distances = vec![dataset(NEAR, "", 1), dataset(FAR, "", 2)];
    let interpolated = Learning { datasets: distances, ..Learning::default() };
    check_stored("lineage_interpolated", &lineage(KernelOrigin::Interpolated(interpolated.clone())));
    let version = OriginalVersion { name: "displays/lab/kernels/515nm-5mm/versions/1".to_owned(), create_time_ms: 5 };
    let import = Import {
        format: KernelFormat::Bundle,
        artifact: digest(3),
        note: Some("the file does not hold dust".to_owned()),
        version: Some(version),
        made: Some(Made::Interpolated(interpolated)),
    };
    check_stored("lineage_imported", &lineage(KernelOrigin::Imported(import)));
}
