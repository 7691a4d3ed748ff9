//! A problem that begins on a card, and goes on on the processor when the card fails.
//!
//! Every call of [`Evaluate`] depends on its arguments only. So a call that fails on the card is answered by the
//! processor with the same arguments, and the method that called notices nothing: no step is lost, and none is wrong.

use crate::adam::AdamRun;
use crate::fault::Fault;
use crate::problem::CardProblem;
use crate::projection::Projection;
use crate::record::Record;
use crate::task::{OwnedPicture, Task};
use lightpath_optics::Plane;
use lightpath_optics::engine::Slm;
use lightpath_optics::hologram::{AdamState, Evaluate, Evaluation, ProblemSize, Project};
use lightpath_optics::metrics::Gain;
use num_complex::Complex32;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Largest relative error of a tested result. The card and the processor both compute in f32 and differ by 1e-6.
const ERROR_MAX: f64 = 1e-5;
/// Largest relative error of tested steps of Adam. A step has one length wherever the gradient is not exactly 0, so some
/// pixels with nearly no gradient go the other way.
const STEPS_ERROR_MAX: f64 = 1e-3;
/// Number of tested steps, and their learning rate \[rad\].
const TESTED_STEPS: (u32, f64) = (3, 0.1);

/// A problem with what the processor needs to go on with it.
#[derive(Debug)]
pub(crate) struct Handover {
    /// `None` once the card has failed.
    card: Option<CardProblem>,
    projection: Mutex<Option<Projection>>,
    adam: Mutex<Option<AdamRun>>,
    size: ProblemSize,
    on_processor: OnceLock<Box<dyn Project>>,
    slm: OnceLock<Slm<f32>>,
    task: Task,
    record: Arc<Record>,
}

impl Handover {
    /// A problem on a card, or on the processor where the card has failed already. Its shaders are compared with the
    /// processor unless they were before.
    pub(crate) fn new(card: Result<CardProblem, Fault>, size: ProblemSize, task: Task, record: Arc<Record>) -> Self {
        let (card, fault) = match card {
            Ok(card) => (Some(card), None),
            Err(fault) => (None, Some(fault)),
        };
        let (projection, adam) = (Mutex::default(), Mutex::default());
        let (on_processor, slm) = (OnceLock::new(), OnceLock::new());
        let mut made = Self { card, projection, adam, size, on_processor, slm, task, record };
        match fault {
            Some(fault) => made.record.hand_over(&fault),
            None => made.test(),
        }
        made.card.iter().for_each(|problem| made.record.took(problem.card.info()));
        made
    }

    fn processor(&mut self) -> &mut dyn Project {
        self.on_processor.get_or_init(|| self.task.on_processor());
        &mut **self.on_processor.get_mut().unwrap_or_else(|| unreachable!("it has just been made"))
    }

    /// Puts the card aside.
    fn give_up(&mut self, fault: &Fault) {
        if let Some(problem) = self.card.take() {
            if !fault.is_of_one_problem() {
                problem.card.faults.note(fault.clone());
            }
            self.record.hand_over(fault);
        }
    }

    /// Answers a call on the card, or where that fails or looks wrong, on the processor. Both write to `out`.
    fn answer<R, S: ?Sized>(
        &mut self,
        out: &mut S,
        on_card: impl FnOnce(&Self, &CardProblem, &mut S) -> Result<R, Fault>,
        is_plausible: impl Fn(&R, &S) -> bool,
        on_processor: impl FnOnce(&mut dyn Project, &mut S) -> R,
    ) -> R {
        let Some(problem) = &self.card else { return on_processor(self.processor(), out) };
        match on_card(self, problem, out) {
            Ok(result) if is_plausible(&result, out) => result,
            Ok(_) => {
                let result = on_processor(self.processor(), out);
                // What is odd on both is the problem's own: light that is nowhere, or a gradient that is 0.
                if is_plausible(&result, out) {
                    self.give_up(&Fault::Wrong("zeros, or numbers that are not finite".to_owned()));
                }
                result
            }
            Err(fault) => {
                self.give_up(&fault);
                on_processor(self.processor(), out)
            }
        }
    }

    /// Compares light, loss and gradient with the processor's, at a phase that nobody chose, unless all shaders of the
    /// problem were compared before.
    fn test(&mut self) {
        let Some(problem) = self.card.as_ref().filter(|problem| !problem.is_tested()) else { return };
        let phase = pseudorandom_phase(self.size.parameters());
        let gains = [Gain::Given(0.7), Gain::Fitted];
        let on_card = || -> Result<_, Fault> {
            let light = problem.light(&phase)?;
            let evaluated = gains.map(|gain| {
                let mut gradient = vec![f32::NAN; phase.len()];
                problem.evaluate(&phase, gain, &mut gradient).map(|evaluation| (evaluation, gradient))
            });
            Ok((light, evaluated.into_iter().collect::<Result<Vec<_>, _>>()?))
        };
        let (light, evaluated) = match on_card() {
            Ok(results) => results,
            Err(fault) => return self.give_up(&fault),
        };
        let processor = self.processor();
        let mut errors = vec![("light", difference(&light, &processor.light(&phase)))];
        for ((evaluation, gradient), gain) in evaluated.iter().zip(gains) {
            let mut wanted = vec![0.0; phase.len()];
            let told = processor.evaluate(&phase, gain, &mut wanted);
            errors.push(("loss", (evaluation.loss / told.loss - 1.0).abs()));
            errors.push(("gain", (evaluation.best_gain / told.best_gain - 1.0).abs()));
            errors.push(("gradient", difference(gradient, &wanted)));
        }
        // What was made for the comparison takes as much memory as a hologram on the processor.
        self.on_processor = OnceLock::new();
        match errors.iter().find(|(_, error)| error.is_nan() || *error > ERROR_MAX) {
            Some((what, error)) => self.give_up(&Fault::Wrong(format!("the {what} is off by {error:.1e}"))),
            None => self.card.iter().for_each(CardProblem::mark_tested),
        }
    }

    /// Runs a projection on the card, whose programs are made when the first method needs them.
    fn projected<R>(
        problem: &CardProblem,
        projection: &Mutex<Option<Projection>>,
        run: impl FnOnce(&Projection) -> Result<R, Fault>,
    ) -> Result<R, Fault> {
        let mut projection = projection.lock().unwrap_or_else(PoisonError::into_inner);
        let projection = match &mut *projection {
            Some(projection) => projection,
            none => none.insert(Projection::new(problem)?),
        };
        run(projection)
    }

    /// Takes steps of Adam on the card. Its program is made, and compared with the processor, when the method needs it.
    fn steps_on_card(
        &self,
        problem: &CardProblem,
        state: &AdamState,
        learning_rate: f64,
        steps: u32,
    ) -> Result<(AdamState, Vec<Evaluation>), Fault> {
        let mut adam = self.adam.lock().unwrap_or_else(PoisonError::into_inner);
        let run = match &mut *adam {
            Some(run) => run,
            none => none.insert(AdamRun::new(problem)?),
        };
        if !run.is_tested() {
            let mut processor = self.task.on_processor();
            let phase = pseudorandom_phase(self.size.parameters());
            let gain = processor.measure(&phase, 1.0).best_gain;
            let mut wanted = AdamState::new(phase, gain);
            let (count, rate) = TESTED_STEPS;
            let (found, _) = problem.adam_steps(run, &wanted, rate, count)?;
            let (begin, mut gradient) = (wanted.phase.clone(), vec![0.0; wanted.phase.len()]);
            processor.adam_steps(&mut wanted, rate, count, &mut gradient, &mut |_| {});
            let moved = |end: &[f32]| -> Vec<f32> { end.iter().zip(&begin).map(|(end, begin)| end - begin).collect() };
            let error = difference(&moved(&found.phase), &moved(&wanted.phase));
            if error.is_nan() || error > STEPS_ERROR_MAX {
                return Err(Fault::Wrong(format!("steps are off by {error:.1e}")));
            }
            run.mark_tested();
        }
        problem.adam_steps(run, state, learning_rate, steps)
    }

    /// The field that targets send back, from the card; `None` where it failed.
    fn back_propagated_on_card(&self, image_phase: &[f32]) -> Option<Vec<Complex32>> {
        let problem = self.card.as_ref()?;
        let field = Self::projected(problem, &self.projection, |projection| {
            let field = problem.back_propagated(projection, image_phase)?;
            if !projection.is_tested() {
                let flat = |field: &[Complex32]| -> Vec<f32> { field.iter().flat_map(|c| [c.re, c.im]).collect() };
                let error = difference(&flat(&field), &flat(&self.task.on_processor().back_propagated(image_phase)));
                if error.is_nan() || error > ERROR_MAX {
                    return Err(Fault::Wrong(format!("the field is off by {error:.1e}")));
                }
                projection.mark_tested();
            }
            Ok(field)
        });
        match field {
            Ok(field) if field.iter().all(|c| c.is_finite()) && field.iter().any(|c| *c != Complex32::ZERO) => {
                Some(field)
            }
            Ok(_) => None,
            Err(fault) => {
                // The next call that may change the problem finds the card's fault, too, and hands over.
                if !fault.is_of_one_problem() {
                    problem.card.faults.note(fault.clone());
                }
                self.record.hand_over(&fault);
                None
            }
        }
    }
}

/// Whether an evaluation may be right: finite, and with light.
fn is_plausible(evaluation: &Evaluation) -> bool {
    let Evaluation { loss, best_gain, best_loss } = evaluation;
    [loss, best_gain, best_loss].iter().all(|value| value.is_finite()) && *best_gain > 0.0
}

/// Whether all values are finite, and some are not 0.
fn is_something(values: &[f32]) -> bool {
    values.iter().all(|value| value.is_finite()) && values.iter().any(|value| *value != 0.0)
}

/// Relative L2 difference.
fn difference(found: &[f32], expected: &[f32]) -> f64 {
    let square = |of: &dyn Fn(usize) -> f32| (0..expected.len()).map(|i| f64::from(of(i)).powi(2)).sum::<f64>();
    (square(&|i| found[i] - expected[i]) / square(&|i| expected[i])).sqrt()
}

/// Phases between 0 and 2π \[rad\], the same in every run. D. Knuth, The Art of Computer Programming 2 (1997), §3.3.4.
fn pseudorandom_phase(len: usize) -> Vec<f32> {
    let mut state = 1_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1_u64 << 24) as f32 * std::f32::consts::TAU
    };
    (0..len).map(|_| next()).collect()
}

impl Evaluate for Handover {
    fn size(&self) -> ProblemSize {
        self.size
    }

    fn evaluate(&mut self, phase: &[f32], gain: Gain, gradient: &mut [f32]) -> Evaluation {
        self.answer(
            gradient,
            |_, problem, gradient| problem.evaluate(phase, gain, gradient),
            |evaluation, gradient| is_plausible(evaluation) && is_something(gradient),
            |processor, gradient| processor.evaluate(phase, gain, gradient),
        )
    }

    fn adam_steps(
        &mut self,
        state: &mut AdamState,
        learning_rate: f64,
        steps: u32,
        gradient: &mut [f32],
        each: &mut dyn FnMut(Evaluation),
    ) {
        let evaluations = self.answer(
            state,
            |body, problem, state| {
                let (next, evaluations) = body.steps_on_card(problem, state, learning_rate, steps)?;
                // The processor begins at the same state if this one is wrong.
                if is_something(&next.phase) && evaluations.iter().all(is_plausible) {
                    *state = next;
                    return Ok(evaluations);
                }
                Ok(Vec::new())
            },
            |evaluations, _| !evaluations.is_empty() && evaluations.iter().all(is_plausible),
            |processor, state| {
                let mut evaluations = Vec::new();
                let mut keep = |evaluation| evaluations.push(evaluation);
                processor.adam_steps(state, learning_rate, steps, gradient, &mut keep);
                evaluations
            },
        );
        evaluations.into_iter().for_each(each);
    }

    fn measure(&mut self, phase: &[f32], gain: f64) -> Evaluation {
        self.answer(
            &mut (),
            |_, problem, ()| problem.measure(phase, gain),
            |evaluation, ()| is_plausible(evaluation),
            |processor, ()| processor.measure(phase, gain),
        )
    }

    fn light(&mut self, phase: &[f32]) -> Vec<f32> {
        self.answer(
            &mut (),
            |_, problem, ()| problem.light(phase),
            |light, ()| is_something(light),
            |processor, ()| processor.light(phase),
        )
    }
}

impl Project for Handover {
    fn slm(&self) -> &Slm<f32> {
        self.slm.get_or_init(|| Slm::of(&self.task.pictures[0].display().modulator()))
    }

    fn target_amplitudes(&self) -> Vec<Plane<f32>> {
        self.task.pictures.iter().map(OwnedPicture::target_amplitudes).collect()
    }

    fn back_propagated(&self, image_phase: &[f32]) -> Vec<Complex32> {
        self.back_propagated_on_card(image_phase)
            .unwrap_or_else(|| self.on_processor.get_or_init(|| self.task.on_processor()).back_propagated(image_phase))
    }

    fn project(&mut self, phase: &mut [f32], wanted: &mut [Plane<f32>], weighted: bool) -> Evaluation {
        self.answer(
            &mut (phase, wanted),
            |problem, card, (phase, wanted)| {
                let round = Self::projected(card, &problem.projection, |projection| {
                    card.project(projection, problem.slm(), phase, wanted, weighted)
                })?;
                // The arguments change only when all is known, since the processor may need them.
                if is_something(&round.phase) {
                    phase.copy_from_slice(&round.phase);
                    wanted.clone_from_slice(&round.wanted);
                }
                Ok(round.evaluation)
            },
            |evaluation, (phase, _)| is_plausible(evaluation) && is_something(phase),
            |processor, (phase, wanted)| processor.project(phase, wanted, weighted),
        )
    }
}
