//! Suggests holograms to photograph, from which a kernel would be learned best.

use crate::display_setup::finite;
use crate::learned_from::{LearnedFrom, learn_result};
use crate::version_model::model_of;
use crate::{JobContext, TaskError, TaskOutput};
use lightpath_bench::TestCard;
use lightpath_domain::dataset::Split;
use lightpath_domain::job::estimate::{SAMPLED_PAIRS_MAX, SUGGESTED_ITERATIONS};
use lightpath_domain::job::kinds::suggest_holograms::{self, PHASE_RANGES_RAD};
use lightpath_domain::job::{
    FailureReason, JobEffect, JobResult, Progress, SuggestHolograms, SuggestResult, SuggestedHologram,
};
use lightpath_media::pictures;
use lightpath_optics::hologram::{HologramMethod, HologramOptions, HologramProblem, initial_phase};
use lightpath_optics::learning::{HologramChoice, Suggestion};
use lightpath_optics::{DisplayModel, Engine, Optimization, Plane};

/// A hologram that could be photographed.
struct Candidate {
    card: TestCard,
    phase_range_rad: f64,
    /// The levels as a PNG.
    levels: Vec<u8>,
}

/// Progress over all holograms.
struct SuggestionProgress<'a> {
    context: &'a JobContext,
    step: u32,
    steps_total: u32,
}

pub(super) fn run(context: &JobContext, spec: &SuggestHolograms) -> Result<TaskOutput, TaskError> {
    let version = context.wait(context.store().kernel_version(&spec.kernel, spec.version))?;
    let model = model_of(context, &version)?;
    let learned = learn_result(context, &version)?.map_or_else(Vec::new, |result| result.kernels);
    let from = LearnedFrom::read(context, &version, &learned)?.ok_or_else(|| {
        let message = format!("the dataset of {}/versions/{} was deleted", spec.kernel, spec.version);
        TaskError::permanent(FailureReason::DatasetDeleted, message)
    })?;
    let choice = HologramChoice::of(&model, from.detector, from.display.carrier, from.region)?;
    let mut choice = choice.ok_or_else(|| {
        let message = format!("the model of {}/versions/{} has no learned modulator", spec.kernel, spec.version);
        TaskError::permanent(FailureReason::NoSuggestion, message)
    })?;
    let photographed = from.pairs(Split::Train, usize::MAX).count();
    let steps_total = photographed.min(SAMPLED_PAIRS_MAX) as u32 + suggest_holograms::candidates(spec.holograms);
    let mut progress = SuggestionProgress { context, step: 0, steps_total };
    for pair in from.pairs(Split::Train, SAMPLED_PAIRS_MAX) {
        choice.add_photographed(from.captures.phase(&context.read_artifact(&pair.pattern)?)?)?;
        progress.report("weigh photographed holograms")?;
    }
    let candidates = progress.candidates(spec, &from, &model, &mut choice)?;
    let found = choice.best(photographed, spec.holograms as usize);
    let error_db = found.last().map_or(0.0, |last| last.error_db);
    let worth_photographs = finite("the worth", photographed as f64 * (10f64.powf(-error_db / 10.0) - 1.0))?;
    let holograms = found.iter().map(|suggestion| stored(context, suggestion, &candidates[suggestion.candidate]));
    let result = SuggestResult { holograms: holograms.collect::<Result<_, TaskError>>()?, worth_photographs };
    Ok(TaskOutput { result: JobResult::SuggestHolograms(result), effect: JobEffect::None })
}

impl SuggestionProgress<'_> {
    /// Optimizes holograms of test pictures, and adds them to the choice.
    fn candidates(
        &mut self,
        spec: &SuggestHolograms,
        from: &LearnedFrom,
        model: &DisplayModel,
        choice: &mut HologramChoice,
    ) -> Result<Vec<Candidate>, TaskError> {
        let LearnedFrom { display, detector, .. } = from;
        let engine = self.context.engines().engine(model, *detector, display.carrier)?;
        let mut candidates = Vec::new();
        for index in 0..suggest_holograms::candidates(spec.holograms) as usize {
            let ranges = PHASE_RANGES_RAD.len();
            let (card, phase_range_rad) =
                (TestCard::ALL[index / ranges % TestCard::ALL.len()], PHASE_RANGES_RAD[index % ranges]);
            let seed = spec.seed.wrapping_add(index as u64);
            let phase = self.hologram(&engine, from, card, phase_range_rad, seed)?;
            let levels = display.levels_of(&phase)?;
            choice.add_candidate(display.without_carrier(display.response.dequantize(&levels)?))?;
            let levels = pictures::levels_png(&levels, display.declared.bit_depth)?;
            candidates.push(Candidate { card, phase_range_rad, levels });
            self.report("make holograms and weigh them")?;
        }
        Ok(candidates)
    }

    /// Phase of a hologram of a test picture \[rad\].
    fn hologram(
        &self,
        engine: &Engine,
        LearnedFrom { display, region, .. }: &LearnedFrom,
        card: TestCard,
        phase_range_rad: f64,
        seed: u64,
    ) -> Result<Plane<f32>, TaskError> {
        let (height_px, width_px) = (display.height_px(), display.width_px());
        let target = card.render(height_px, width_px, seed)?;
        let problem = HologramProblem::new(engine.clone(), target, *region)?;
        let start = initial_phase(height_px, width_px, phase_range_rad, seed)?.into_vec();
        let options = HologramOptions::new(HologramMethod::Lbfgs, SUGGESTED_ITERATIONS);
        let mut optimization = Optimization::start(problem, options, start)?;
        while optimization.step().is_some() {
            if self.context.should_stop().is_some() {
                return Err(TaskError::Stopped);
            }
        }
        Ok(Plane::try_from_vec(height_px, width_px, optimization.phases().to_vec())?)
    }

    fn report(&mut self, stage: &str) -> Result<(), TaskError> {
        self.step += 1;
        let Self { step, steps_total, .. } = *self;
        self.context.report(Progress { stage: stage.to_owned(), step, steps_total, loss: None, eta_s: None })
    }
}

/// Stores a suggested hologram.
fn stored(
    context: &JobContext,
    suggestion: &Suggestion,
    candidate: &Candidate,
) -> Result<SuggestedHologram, TaskError> {
    Ok(SuggestedHologram {
        pattern: context.put_artifact(candidate.levels.clone())?,
        picture: candidate.card.name().to_owned(),
        phase_range_rad: candidate.phase_range_rad,
        error_db: finite("the error", suggestion.error_db)?,
        part: suggestion.part,
        part_db: finite("the error of a part", suggestion.part_db)?,
    })
}
