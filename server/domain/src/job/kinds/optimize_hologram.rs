//! Hologram jobs: request, result, memory and time.

use super::Kind;
use crate::dataset::Encoding;
use crate::expected_psnr::ExpectedPsnr;
use crate::job::estimate::{FILE_STAGES, KernelSize, Need, REAL, STEP_FACTOR};
use crate::kernel::KernelKey;
use crate::units::{Distance, Wavelength};
use lightpath_optics::hologram::{HologramMethod, InitialPhase, Loss, Quality};
use lightpath_optics::memory::{EngineSize, HologramSize};
use lightpath_optics::propagation::ConvolutionMethod;
use lightpath_optics::second_opinion::{Effort, SecondOpinion};
use lightpath_optics::{Detector, RegionOfInterest, ValidityReport};
use serde::{Deserialize, Serialize};

/// Request to compute holograms. The result has one hologram for each wavelength, and each hologram shows the pictures
/// of all planes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OptimizeHologram {
    /// Id of the display.
    pub display: String,
    /// Wavelengths of the display, at least one, each once.
    pub wavelengths: Vec<Wavelength>,
    /// Pictures to show, at least one, at different distances.
    pub planes: Vec<ImagePlane>,
    /// Artifact digest of a picture of depths. Each pixel then counts only in the plane nearest to its depth. `None`:
    /// every plane shows its whole target.
    pub depth_map: Option<String>,
    /// Encoding of light in the values of the targets.
    pub target_encoding: Encoding,
    /// Rule for a target whose size differs from its area's.
    pub target_fit: Fit,
    /// The area of the display that targets fill.
    pub target_area: Area,
    /// Kernel versions: for each wavelength one version for each plane; `None`: the ideal kernel.
    pub kernel_versions: Vec<Vec<Option<u32>>>,
    /// Kernel versions that judge the holograms of other kernels, because they are the best models of the display: for
    /// each wavelength one for each plane; `None`: the kernel of the hologram judges it.
    pub judging_versions: Vec<Vec<Option<u32>>>,
    /// Propagation method; `None`: the method of the learned kernel, or the planner's choice for an ideal kernel.
    pub propagation: Option<ConvolutionMethod>,
    /// Method that computes the phases.
    pub method: HologramMethod,
    /// Number of iterations for each hologram.
    pub iterations: u32,
    /// Number of patterns of each hologram, shown one after another.
    pub subframes: u32,
    /// Initial phase of the optimization. Given phases are artifact digests of arrays, one for each wavelength.
    pub initial_phase: InitialPhase<Vec<String>>,
    /// Seed of a random initial phase.
    pub seed: u64,
    /// Loss function that compares the reconstruction with the target.
    pub loss: Loss,
    /// Rule that defines the light of a pixel.
    pub detector: Detector,
    /// Region in which the reconstruction is compared with the target.
    pub region_of_interest: RegionOfInterest,
    /// Artifact digest of a picture with the weight of each pixel; `None`: all pixels have the same weight.
    pub weight_mask: Option<String>,
    /// Whether the last part of the optimization takes the limited levels of the display into account.
    pub quantization_aware: bool,
    /// How thoroughly the holograms are judged.
    #[serde(default)]
    pub judge: Judging,
}

/// How thoroughly holograms are judged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Judging {
    /// Not at all.
    None,
    /// By the engine alone: without the other kind of optics and without the second opinion, which take most of the
    /// time.
    Quick,
    /// By everything that there is.
    #[default]
    Full,
}

/// A picture to show at a distance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImagePlane {
    /// Distance from the SLM.
    pub distance: Distance,
    /// Artifact digest of the target picture.
    pub target: String,
    /// Weight of the plane relative to the other planes.
    pub weight: f64,
}

/// What a target fills, with black around it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Area {
    /// The region of interest.
    Region,
    /// The whole display, of which only the region of interest is compared.
    Display,
}

impl Area {
    /// The area where none is chosen. A picture that must not be resampled usually has the display's own pixels.
    #[must_use]
    pub fn recommended(fit: Fit) -> Self {
        if fit == Fit::Exact { Self::Display } else { Self::Region }
    }
}

/// Rule for a picture whose size differs from that of the area that it fills.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Fit {
    /// Scale the whole picture to fit inside, with black borders.
    #[default]
    Contain,
    /// Scale the picture to cover the area and crop the rest.
    Cover,
    /// Scale height and width independently.
    Stretch,
    /// Refuse a picture of another size.
    Exact,
}

/// Result of a hologram job: holograms and their quality.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HologramResult {
    /// One hologram for each wavelength.
    pub wavelengths: Vec<WavelengthResult>,
    /// Artifact digests of colour pictures, one for each plane; empty if the number of wavelengths is not three.
    pub colour_reconstructions: Vec<String>,
    /// Detector of the job, for which the second opinions are.
    pub detector: Detector,
    /// Number of iterations of each hologram.
    pub iterations: u32,
    /// Mean time of an iteration \[s\].
    pub iteration_time_s: f64,
    /// How thoroughly the holograms were judged.
    #[serde(default)]
    pub judged: Judging,
    /// The graphics card that computed the holograms, with its driver, and why the processor computed a part or all of
    /// them although there was one; `None`: the processor, without a card.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub computed_by: Option<String>,
}

/// The hologram of one wavelength.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WavelengthResult {
    /// Wavelength of the hologram.
    pub wavelength: Wavelength,
    /// Patterns of the hologram, in the order in which they are shown.
    pub subframes: Vec<Subframe>,
    /// Reconstructions of the hologram, one for each plane.
    pub planes: Vec<PlaneResult>,
    /// Fitted gain: factor from the computed intensity to the target intensity.
    pub intensity_scale: f64,
    /// Loss of the last iteration.
    pub loss: f64,
    /// Amplitude by which the double-phase method divided the field; `None` for other methods.
    pub largest_amplitude: Option<f64>,
    /// Why the figures may say less than they seem to, as sentences.
    pub notes: Vec<String>,
}

/// What the display shows at one time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Subframe {
    /// Artifact digest of the pattern: the phase as grey levels of the display (PNG).
    pub pattern: String,
    /// Artifact digest of the phase in radians (float32, `.npy`).
    pub phase: String,
}

/// Reconstruction of a hologram at a distance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlaneResult {
    /// Distance from the SLM.
    pub distance: Distance,
    /// Artifact digest of the reconstruction that the kernel predicts (sRGB PNG).
    pub reconstruction: String,
    /// Quality of the phases as optimized. With a depth map, PSNR is that of the pixels that belong to the plane. `None`:
    /// not judged.
    pub quality: Option<Quality>,
    /// Quality of the phases as the display shows them, in its limited levels; `None`: not judged.
    pub quantized_quality: Option<Quality>,
    /// The same by the model of another version of the display's kernel, which is the best model of the display; `None`:
    /// the kernel of the hologram is.
    pub judged_by: Option<JudgedBy>,
    /// What a photograph is expected to show, by that best model; `None`: its error on test photographs is not known.
    pub in_photograph: Option<ExpectedPsnr>,
    /// Propagation method of the reconstruction, and its limits.
    pub propagation: ValidityReport,
    /// PSNR of the phases as the display shows them, on a display that shows the other diffraction orders \[dB\];
    /// `None`: not computed, or left out by a quick judging.
    pub other_orders_psnr_db: Option<f64>,
    /// Second opinion on the phases as the display shows them, for the job's detector; `None`: the independent model
    /// does not have this kernel, or would take much longer than the job, or a quick judging left it out.
    pub second_opinion: Option<SecondOpinion>,
}

/// Quality of displayed phases by the model of a kernel version.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JudgedBy {
    /// Kernel of the display.
    pub key: KernelKey,
    /// Number of its version.
    pub version: u32,
    /// Quality of the phases as the display shows them.
    pub quality: Quality,
}

impl OptimizeHologram {
    /// The part of the display that targets fill; `None`: all of it.
    #[must_use]
    pub fn filled(&self) -> Option<RegionOfInterest> {
        match self.target_area {
            Area::Region => Some(self.region_of_interest),
            Area::Display => None,
        }
    }

    /// The kernel version that judges the hologram of a wavelength in a plane; `None`: the kernel of the hologram.
    #[must_use]
    pub fn judging_version(&self, wavelength: usize, plane: usize) -> Option<u32> {
        self.judging_versions.get(wavelength)?.get(plane).copied().flatten()
    }
}

impl Kind for OptimizeHologram {
    fn display(&self) -> &str {
        &self.display
    }

    fn kernels(&self) -> Vec<(KernelKey, Option<u32>)> {
        let of_wavelength = |(&wavelength, versions): (&Wavelength, &Vec<Option<u32>>)| {
            let key = |distance| KernelKey { display: self.display.clone(), wavelength, distance };
            let planes = self.planes.iter().zip(versions);
            planes.map(|(plane, &version)| (key(plane.distance), version)).collect::<Vec<_>>()
        };
        self.wavelengths.iter().zip(&self.kernel_versions).flat_map(of_wavelength).collect()
    }
}

/// What a hologram job needs, besides its specification.
#[derive(Clone, Debug, PartialEq)]
pub struct HologramInputs {
    /// Limit on the memory for transfer functions that are kept for later jobs \[bytes\].
    pub cache_bytes_max: u64,
    /// Kernels: for each wavelength one for each plane.
    pub kernels: Vec<Vec<KernelSize>>,
    /// Kernels that judge the holograms of other kernels: for each wavelength one for each plane that has one.
    pub judging_kernels: Vec<Vec<KernelSize>>,
    /// Largest memory for decoding one of its pictures \[bytes\].
    pub decoding_bytes: u64,
}

/// Need of a hologram job.
#[must_use]
pub fn need(spec: &OptimizeHologram, inputs: &HologramInputs) -> Need {
    let transfers = |kernels: &[KernelSize]| kernels.iter().map(KernelSize::cached_bytes).sum::<u64>();
    let all: u64 = inputs.kernels.iter().map(|kernels| transfers(kernels)).sum();
    let kept = |kernel: &KernelSize| match spec.judge {
        Judging::None => 0,
        judge => kernel.engine.kept_bytes(judge == Judging::Full),
    };
    let kept: u64 = inputs.kernels.iter().flatten().map(kept).sum();
    let each = inputs.kernels.iter().zip(&inputs.judging_kernels).map(|(kernels, judging)| {
        let (stage, work) = one_wavelength(spec, kernels, judging, inputs.decoding_bytes);
        // The cache keeps the transfer functions of the other wavelengths, and those with which holograms are judged.
        (stage + (all - transfers(kernels) + kept).min(inputs.cache_bytes_max), work)
    });
    let (stages, work): (Vec<u64>, Vec<f64>) = each.unzip();
    Need::new(stages, work.iter().sum())
}

/// Largest memory and work of the hologram of one wavelength.
fn one_wavelength(
    spec: &OptimizeHologram,
    kernels: &[KernelSize],
    judging_kernels: &[KernelSize],
    decoding_bytes: u64,
) -> (u64, f64) {
    let Some(first) = kernels.first() else { return (0, 0.0) };
    let engine = widest(kernels).with_detector(spec.detector);
    let size = HologramSize {
        planes: spec.planes.len(),
        frames: spec.subframes as usize,
        weighted: spec.weight_mask.is_some() || spec.depth_map.is_some(),
        rough: spec.loss.total_variation > 0.0 || spec.loss.speckle > 0.0,
        levels: spec.quantization_aware,
        ..HologramSize::new(engine, spec.method, spec.iterations)
    };
    let n = first.engine.pixels();
    let (phases, picture) = (size.phases_bytes(), REAL * n);
    let engines: u64 = kernels.iter().map(|kernel| kernel.engine.engine_bytes()).sum();
    // The plane of each pixel, and while a plane is judged, which pixels belong to it: a byte each.
    let depths = if spec.depth_map.is_some() { 2 * n } else { 0 };
    let setup = engines + size.pictures_bytes() + depths;
    let reading = kernels.iter().map(KernelSize::reading_bytes).max().unwrap_or(0);
    let masks = if size.weighted { 2 * picture } else { 0 };
    let given = matches!(spec.initial_phase, InitialPhase::Given(_));
    let propagates_back = matches!(spec.initial_phase, InitialPhase::BackPropagated { .. });
    // Given phases are read from a file into a plane.
    let started = setup + size.start_bytes(propagates_back) + if given { 2 * phases } else { 0 };
    let running = setup + size.problem_bytes() + size.state_bytes() + size.scratch_bytes();
    // The results: the wrapped and the displayed phases, the latter twice, a copy, and one of them as levels and files.
    let results = 4 * phases + 3 * picture;
    let stages = [
        setup + masks + decoding_bytes.max(reading),
        started,
        running + size.state_bytes().max(results),
        setup + 3 * phases + 2 * picture + judgement_bytes(&engine, spec.judge, size.frames),
        setup + 3 * phases + 2 * picture + judged_by_bytes(judging_kernels, spec.detector, size.frames),
    ];
    let steps = if spec.method == HologramMethod::DoublePhase { 1 } else { spec.iterations };
    let files = (size.planes + 3 * size.frames) as f64 * FILE_STAGES * n as f64;
    let sampling: u64 = kernels.iter().map(|kernel| kernel.engine.sampling_work).sum();
    let judging: f64 = kernels.iter().map(|kernel| judgement_work(&kernel.engine, spec, size.frames)).sum();
    let judged_by = judging_kernels.iter().map(|kernel| {
        let engine = kernel.engine.with_detector(spec.detector);
        engine.quality_work(size.frames) + engine.sampling_work as f64
    });
    let besides = judging + judged_by.sum::<f64>() + files + sampling as f64;
    let work = f64::from(steps) * STEP_FACTOR * size.step_work() + besides;
    (stages.into_iter().max().unwrap_or(0), work)
}

/// Memory for judging a hologram in one plane by its own kernel.
fn judgement_bytes(engine: &EngineSize, judge: Judging, frames: usize) -> u64 {
    match judge {
        // The light of the reconstruction.
        Judging::None => engine.light_bytes() + engine.scratch_bytes(),
        Judging::Quick => engine.quality_bytes(frames),
        Judging::Full => judging_bytes(engine, frames).max(engine.other_orders_bytes()),
    }
}

/// Work of judging a hologram in one plane by its own kernel.
fn judgement_work(engine: &EngineSize, spec: &OptimizeHologram, frames: usize) -> f64 {
    match spec.judge {
        Judging::None => 0.0,
        Judging::Quick => engine.quality_work(frames),
        Judging::Full => {
            let opinion = engine.opinion_work(frames, Effort::CHEAP.rows_max, &[spec.detector]);
            engine.quality_work(frames) + opinion + engine.with_detector(spec.detector).other_orders_work(frames)
        }
    }
}

/// Memory for reading kernels that judge the holograms of other kernels, one after the other, and for what they judge.
fn judged_by_bytes(kernels: &[KernelSize], detector: Detector, frames: usize) -> u64 {
    let each = kernels.iter().map(|kernel| {
        let engine = kernel.engine.with_detector(detector);
        kernel.reading_bytes().max(engine.engine_bytes() + engine.quality_bytes(frames))
    });
    each.max().unwrap_or(0)
}

/// Memory for measuring the quality of a hologram, and for the second opinion on it.
pub(super) fn judging_bytes(engine: &EngineSize, frames: usize) -> u64 {
    let light = 6 * REAL * engine.pixels();
    engine.quality_bytes(frames).max(light + engine.opinion_bytes())
}

/// An engine as large as the largest of the kernels.
pub(super) fn widest(kernels: &[KernelSize]) -> EngineSize {
    let first = kernels[0].engine;
    kernels.iter().fold(first, |widest, kernel| EngineSize {
        kernels_per_side: widest.kernels_per_side.max(kernel.engine.kernels_per_side),
        has_source: widest.has_source || kernel.engine.has_source,
        wraps_phase: widest.wraps_phase || kernel.engine.wraps_phase,
        blurs_light: widest.blurs_light || kernel.engine.blurs_light,
        ..widest
    })
}
