//! Measures a kernel on photographs of new holograms. Only simulated displays can be photographed for this.

use super::display_setup::{DisplaySetup, finite, simulated_display};
use super::{JobContext, TaskError};
use lightpath_bench::{SimulatedDisplay, TestCard};
use lightpath_domain::job::Progress;
use lightpath_domain::job::estimate::CAPTURED_ITERATIONS;
use lightpath_domain::kernel::CapturedQuality;
use lightpath_media::captures::Captures;
use lightpath_optics::hologram::{HologramMethod, HologramOptions, HologramProblem, ImagePlane, Loss, initial_phase};
use lightpath_optics::metrics::{Gain, psnr_db};
use lightpath_optics::{Detector, DisplayModel, Engine, Optimization, Plane, RegionOfInterest};

/// Two different pictures, which are enough to tell a better kernel from a worse one.
const TARGETS: [TestCard; 2] = [TestCard::Portrait, TestCard::Leaf];
/// Range of the random initial phases \[rad\]: a narrow range suits holograms of pictures.
const INITIAL_PHASE_RAD: f64 = 1.0;
/// Seed of the pictures, the initial phases and the noise. It differs from the seeds that users choose for datasets.
const SEED: u64 = 0xca97;

/// PSNR of photographs of new holograms, computed with the kernel and with the ideal kernel. `None` for displays that
/// are not simulated or are too small for pictures.
pub(super) fn compare(
    context: &JobContext,
    display: &DisplaySetup,
    captures: &Captures,
    model: &DisplayModel,
    detector: Detector,
    region: RegionOfInterest,
) -> Result<Option<CapturedQuality>, TaskError> {
    let smallest = display.height_px().min(display.width_px());
    let Some(bench) = simulated_display(display)?.filter(|_| smallest >= TestCard::SIDE_PX_MIN) else {
        return Ok(None);
    };
    let ideal = DisplayModel::ideal(display.setup);
    let mut step = 0;
    let mut mean = |model: &DisplayModel| -> Result<f64, TaskError> {
        let engine = context.engines().engine(model, detector, display.carrier)?;
        let mut sum = 0.0;
        for card in TARGETS {
            let target = card.render(display.height_px(), display.width_px(), SEED)?;
            let phase = hologram(context, &engine, &target, region)?;
            sum += photographed_db(display, captures, &bench, &phase, &target, region)? / TARGETS.len() as f64;
            step += 1;
            let stage = "photograph new holograms".to_owned();
            let steps_total = 2 * TARGETS.len() as u32;
            context.report(Progress { stage, step, steps_total, loss: None, eta_s: None })?;
        }
        finite("the PSNR of photographs", sum)
    };
    Ok(Some(CapturedQuality { psnr_db: mean(model)?, ideal_psnr_db: mean(&ideal)? }))
}

fn hologram(
    context: &JobContext,
    engine: &Engine,
    target: &Plane<f32>,
    region: RegionOfInterest,
) -> Result<Plane<f32>, TaskError> {
    let (height_px, width_px) = (target.height_px(), target.width_px());
    let plane = ImagePlane { engine: engine.clone(), target: target.clone(), weight: None, share: 1.0 };
    let problem = HologramProblem::with_planes(vec![plane], 1, region, Loss::default())?;
    let start = initial_phase(height_px, width_px, INITIAL_PHASE_RAD, SEED)?.into_vec();
    let mut optimization =
        Optimization::start(problem, HologramOptions::new(HologramMethod::Lbfgs, CAPTURED_ITERATIONS), start)?;
    while optimization.step().is_some() {
        if context.should_stop().is_some() {
            return Err(TaskError::Stopped);
        }
    }
    Ok(Plane::try_from_vec(height_px, width_px, optimization.phases().to_vec())?)
}

fn photographed_db(
    display: &DisplaySetup,
    captures: &Captures,
    bench: &SimulatedDisplay,
    phase: &Plane<f32>,
    target: &Plane<f32>,
    region: RegionOfInterest,
) -> Result<f64, TaskError> {
    let displayed = display.response.dequantize(&display.levels_of(phase)?)?;
    // Uses the alignment of the dataset. Without it, photographs would be compared with a displaced target.
    let photo = captures.on_grid(bench.capture(&displayed, SEED)?.map(|level| f32::from(level) / 255.0))?;
    Ok(psnr_db(&photo, target, region, Gain::Fitted)?)
}
