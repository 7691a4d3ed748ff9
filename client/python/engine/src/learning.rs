//! Learning a display from photographs of its holograms.

use crate::arrays::planes;
use crate::display::DisplayModel;
use crate::error::Refused;
use crate::optics::{self, Optics};
use crate::threads::{self, Progress};
use lightpath_optics::learning::{BoxError, LearnOptions, Learner, LearningPairs, Pair, PairSource, compare};
use lightpath_optics::{Detector, KernelModel};
use numpy::PyReadonlyArray3;
use pyo3::prelude::*;
use serde::Deserialize;
use std::sync::mpsc::Sender;

/// Options of learning. `None`: the default of the model.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Options {
    optics: Optics,
    model: KernelModel,
    degree: Option<usize>,
    epochs: Option<u32>,
    learning_rate: Option<f64>,
    refinement_evaluations: Option<u32>,
    seed: u64,
    region: Option<[usize; 4]>,
    detector: Detector,
    /// Indices of the pairs that the model is fitted to.
    training: Vec<usize>,
    /// Indices of the pairs that choose the model's parts and decide when learning ends.
    validation: Vec<usize>,
}

/// Some of all pairs.
struct Chosen<'a> {
    pairs: &'a [Pair],
    indices: &'a [usize],
}

impl PairSource for Chosen<'_> {
    fn len(&self) -> usize {
        self.indices.len()
    }

    fn pair(&self, index: usize) -> Result<Pair, BoxError> {
        Ok(self.pairs[self.indices[index]].clone())
    }
}

/// Learns a display. Returns the model, the training losses, and the indices of the training pairs in use.
#[pyfunction]
pub(crate) fn learn(
    py: Python<'_>,
    options: &str,
    phases: PyReadonlyArray3<'_, f32>,
    captures: PyReadonlyArray3<'_, f32>,
    start: Option<&DisplayModel>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(DisplayModel, Vec<f64>, Vec<usize>)> {
    let pairs = pairs(&phases, &captures)?;
    let options: Options = serde_json::from_str(options).map_err(Refused::from)?;
    let work = |sender: &Sender<Progress>| {
        let (setup, validity) = options.optics.convolution()?;
        let defaults = LearnOptions::new(options.model, optics::region(setup.grid(), options.region)?);
        let learn_options = LearnOptions {
            degree: options.degree,
            epochs: options.epochs.unwrap_or(defaults.epochs),
            learning_rate: options.learning_rate.unwrap_or(defaults.learning_rate),
            refinement_evaluations: options.refinement_evaluations.unwrap_or(defaults.refinement_evaluations),
            seed: options.seed,
            detector: options.detector,
            warm_start: start.map(|start| start.model.clone()),
            ..defaults
        };
        let training = Chosen { pairs: &pairs, indices: &options.training };
        let validation = Chosen { pairs: &pairs, indices: &options.validation };
        let both = LearningPairs { training: &training, validation: &validation };
        let mut learner = Learner::start(setup, learn_options, &training)?;
        while let Some(done) = learner.step(both)? {
            let (step, steps_total, loss) = (done.step, done.steps_total, done.loss);
            // Nobody listens any more after an exception, which also ends this loop.
            let _ = sender.send(Progress { step, steps_total, loss });
        }
        let kept = learner.kept_pairs(training.len()).iter().map(|&index| options.training[index]).collect();
        let (model, history) = (learner.model(), learner.loss_history().to_vec());
        let kind = match options.model {
            KernelModel::Varying if model.variation.is_none() => KernelModel::Display,
            kind => kind,
        };
        Ok((DisplayModel::learned(model, kind, validity), history, kept))
    };
    threads::compute_long(py, progress, work)
}

/// The loss of each pair, at the gain and offset that fit it best.
#[pyfunction]
pub(crate) fn losses(
    py: Python<'_>,
    display: &DisplayModel,
    phases: PyReadonlyArray3<'_, f32>,
    captures: PyReadonlyArray3<'_, f32>,
    region: Option<[usize; 4]>,
    detector: &str,
) -> PyResult<Vec<f64>> {
    let pairs = pairs(&phases, &captures)?;
    let work = || -> Result<_, Refused> {
        let region = optics::region(display.grid(), region)?;
        let engine = display.engine(serde_json::from_value(detector.into())?)?;
        pairs.iter().map(|pair| Ok(compare(&engine, pair, region)?.fitted_loss())).collect()
    };
    Ok(threads::compute(py, work)??)
}

fn pairs(phases: &PyReadonlyArray3<'_, f32>, captures: &PyReadonlyArray3<'_, f32>) -> Result<Vec<Pair>, Refused> {
    let (phases, captures) = (planes("phases", phases)?, planes("captures", captures)?);
    if phases.len() != captures.len() {
        let message = format!(
            "there are {} phases and {} captures; give one capture for each phase",
            phases.len(),
            captures.len()
        );
        return Err(Refused::new("captures", "SIZE_MISMATCH", message));
    }
    Ok(phases.into_iter().zip(captures).map(|(phase, photo)| Pair { phase, photo }).collect())
}
