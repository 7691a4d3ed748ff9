//! What everything must pass that computes holograms: one suite, run on each [`Backend`].
//!
//! The slow [`Plain`] twin tells what is right. A crate with a backend of its own runs the suite with the feature
//! `conformance` in its tests: a test for each of [`CHECKS`].

use super::adam::AdamState;
use super::backend::{Backend, Picture};
use super::evaluate::{Evaluate, Evaluation, Project};
use super::initial::random;
use super::loss::Loss;
use super::plain::Plain;
use super::problem::HologramProblem;
use crate::display::{
    Carrier, Crosstalk, Detector, DisplayModel, Dust, FurtherMode, Ghost, KernelShape, LightBlur, OpticalSetup, Orders,
    PartialCoherence, ResponseVariation, SpatialVariation,
};
use crate::engine::Prepared;
use crate::engine::photometry::Quantity;
use crate::metrics::Gain;
use crate::numerics::optimizer::limited_memory::{LimitedMemory, Workspace};
use crate::numerics::{Grid, Plane, RegionOfInterest, SmoothField};
use num_complex::{Complex32, Complex64};
use rayon::ThreadPoolBuilder;

/// A check of a backend, which panics where the backend fails it.
pub type Check = fn(&dyn Backend);

/// All checks, each with its name.
pub const CHECKS: [(&str, Check); 7] = [
    ("gradient_is_that_of_the_loss", |backend| cases().iter().for_each(|case| check_gradient(case, backend))),
    ("fitted_gain_is_the_best", |backend| cases().iter().for_each(|case| check_gain(case, backend))),
    ("calls_depend_on_their_arguments_only", |backend| cases().iter().for_each(|case| check_calls(case, backend))),
    ("results_do_not_depend_on_threads", |backend| cases().iter().for_each(|case| check_threads(case, backend))),
    ("results_are_the_plain_ones", |backend| cases().iter().for_each(|case| check_agreement(case, backend))),
    ("projections_are_the_plain_ones", |backend| cases().iter().for_each(|case| check_projection(case, backend))),
    ("methods_take_the_plain_steps", check_methods),
];

#[cfg(test)]
mod on_backends {
    use super::*;
    use crate::engine::EngineCache;

    macro_rules! conforms {
        ($($body:ident: $backend:expr,)*) => {$(
            mod $body {
                use super::*;

                conforms! {
                    of $backend;
                    gradient_is_that_of_the_loss,
                    fitted_gain_is_the_best,
                    calls_depend_on_their_arguments_only,
                    results_do_not_depend_on_threads,
                    results_are_the_plain_ones,
                    projections_are_the_plain_ones,
                    methods_take_the_plain_steps,
                }
            }
        )*};
        (of $backend:expr; $($check:ident,)*) => {
            $(
                #[test]
                fn $check() {
                    let (_, check) = CHECKS.iter().find(|(name, _)| *name == stringify!($check)).unwrap();
                    check(&$backend);
                }
            )*

            #[test]
            fn every_check_has_a_test() {
                assert_eq!(CHECKS.map(|(name, _)| name), [$(stringify!($check)),*]);
            }
        };
    }

    conforms! {
        on_processor: EngineCache::new(1 << 20),
        on_plain: Plain,
    }
}

/// Relative error of what a body computes in f32: a transform of n values loses some log₂ n roundings, the light has
/// passed two, and a gradient four.
fn rounding(case: &Case) -> f64 {
    let padded = 4 * case.height_px * case.width_px;
    4.0 * f64::from(f32::EPSILON) * (padded as f64).log2()
}

/// Every detector and quantity, several planes and frames, weights, roughness, a grating, and displays with all parts.
fn cases() -> [Case; 6] {
    let rough = Loss { quantity: Quantity::Amplitude, total_variation: 0.3, speckle: 0.7, speckle_block_px: 3 };
    [
        Case::plain((8, 12), Detector::Point),
        Case { carrier: Some(Carrier::HalfOrderX), frames: 2, ..Case::plain((6, 10), Detector::Pixel) },
        Case { planes: 2, masked: true, ..Case::plain((6, 10), Detector::Supersampled) },
        Case { loss: rough, ..Case::plain((8, 10), Detector::Supersampled) },
        Case { all_flaws: true, ..Case::plain((7, 11), Detector::Pixel) },
        Case { all_flaws: true, masked: true, frames: 2, ..Case::plain((5, 9), Detector::Supersampled) },
    ]
}

const GAINS: [Gain; 2] = [Gain::Given(0.7), Gain::Fitted];

/// An evaluation with its gradient, which is written over numbers that must not matter.
fn evaluated(body: &mut dyn Evaluate, phase: &[f32], gain: Gain) -> (Evaluation, Vec<f32>) {
    let mut gradient = vec![f32::NAN; phase.len()];
    (body.evaluate(phase, gain, &mut gradient), gradient)
}

/// Relative L2 difference.
fn difference(found: &[f32], expected: &[f32]) -> f64 {
    let square = |of: &dyn Fn(usize) -> f32| (0..expected.len()).map(|i| f64::from(of(i)).powi(2)).sum::<f64>();
    (square(&|i| found[i] - expected[i]) / square(&|i| expected[i])).sqrt()
}

/// Compares the gradient along two directions with differences of the loss over a step and twice the step, whose third
/// derivatives cancel. The step is long enough that the rounding of the loss hardly counts.
fn check_gradient(case: &Case, backend: &dyn Backend) {
    const STEP_RAD: f32 = 0.01;
    let (mut body, phase) = (case.body(backend), case.phase());
    for gain in GAINS {
        let (_, gradient) = evaluated(&mut *body, &phase, gain);
        let mut loss = |phase: &[f32]| match gain {
            Gain::Given(gain) => body.measure(phase, gain).loss,
            Gain::Fitted => body.measure(phase, 1.0).best_loss,
        };
        let directions: [fn(f32, f32) -> f32; 2] = [|i, _| (2.3 * i).cos(), |_, g| g.signum()];
        for direction in directions {
            let towards = |step: f32| -> Vec<f32> {
                let values = phase.iter().zip(&gradient).enumerate();
                values.map(|(i, (p, &g))| p + step * direction(i as f32, g)).collect()
            };
            // The change of the loss, that which the gradient tells, and the product of the lengths of step and gradient.
            let mut over = |step: f32| {
                let (above, below) = (towards(step), towards(-step));
                let moved = || above.iter().zip(&below).map(|(above, below)| f64::from(*above) - f64::from(*below));
                let told: f64 = moved().zip(&gradient).map(|(moved, &g)| moved * f64::from(g)).sum();
                let length = moved().map(|moved| moved * moved).sum::<f64>().sqrt()
                    * gradient.iter().map(|&g| f64::from(g).powi(2)).sum::<f64>().sqrt();
                (loss(&above) - loss(&below), told, length)
            };
            let ((once, told_once, length), (twice, told_twice, _)) = (over(STEP_RAD), over(2.0 * STEP_RAD));
            let error = ((8.0 * once - twice) - (8.0 * told_once - told_twice)).abs() / (6.0 * length);
            let bound = f64::from(STEP_RAD).powi(2) + 2.0 * rounding(case) * loss(&phase) / length;
            assert!(error < bound, "{case:?}, {gain:?}: {error:e} of {bound:e}");
        }
    }
}

fn check_gain(case: &Case, backend: &dyn Backend) {
    let (mut body, phase) = (case.body(backend), case.phase());
    let (fitted, _) = evaluated(&mut *body, &phase, Gain::Fitted);
    let at_best = body.measure(&phase, fitted.best_gain);
    for loss in [fitted.best_loss, at_best.loss, at_best.best_loss] {
        assert!((loss / fitted.loss - 1.0).abs() < rounding(case), "{case:?}: {loss} {}", fitted.loss);
    }
    for factor in [0.9, 1.1] {
        assert!(body.measure(&phase, factor * fitted.best_gain).loss > fitted.loss, "{case:?}");
    }
}

/// Calls with other arguments in between change nothing.
fn check_calls(case: &Case, backend: &dyn Backend) {
    let (mut body, phase) = (case.body(backend), case.phase());
    assert_eq!(body.size().parameters(), phase.len());
    let other: Vec<f32> = phase.iter().map(|phase| 1.0 - phase).collect();
    let light = body.light(&phase);
    let measured = body.measure(&phase, 0.7);
    let first = GAINS.map(|gain| evaluated(&mut *body, &phase, gain));
    for gain in GAINS {
        evaluated(&mut *body, &other, gain);
        body.light(&other);
    }
    assert_eq!(GAINS.map(|gain| evaluated(&mut *body, &phase, gain)), first, "{case:?}");
    assert!(body.latest_light().is_none_or(|latest| latest == light), "{case:?}");
    assert_eq!((body.measure(&phase, 0.7), body.light(&phase)), (measured, light), "{case:?}");
}

fn check_threads(case: &Case, backend: &dyn Backend) {
    let run = |threads: usize| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("a valid test problem");
        pool.install(|| {
            let (mut body, phase) = (case.body(backend), case.phase());
            (GAINS.map(|gain| evaluated(&mut *body, &phase, gain)), body.light(&phase))
        })
    };
    assert_eq!(run(1), run(2), "{case:?}");
}

fn check_agreement(case: &Case, backend: &dyn Backend) {
    let (mut body, mut expected, phase) = (case.body(backend), case.body(&Plain), case.phase());
    let bound = rounding(case);
    for gain in GAINS {
        let (of_body, gradient) = evaluated(&mut *body, &phase, gain);
        let (of_plain, wanted) = evaluated(&mut *expected, &phase, gain);
        let pairs = [
            (of_body.loss, of_plain.loss),
            (of_body.best_gain, of_plain.best_gain),
            (of_body.best_loss, of_plain.best_loss),
        ];
        assert!(pairs.iter().all(|(found, wanted)| (found / wanted - 1.0).abs() < bound), "{case:?}: {pairs:?}");
        let error = difference(&gradient, &wanted);
        assert!(error < bound, "{case:?}, {gain:?}: gradient {error:e} of {bound:e}");
    }
    let error = difference(&body.light(&phase), &expected.light(&phase));
    assert!(error < bound, "{case:?}: light {error:e} of {bound:e}");
}

/// The field that targets send back, and rounds of Gerchberg–Saxton with their weights.
fn check_projection(case: &Case, backend: &dyn Backend) {
    // The phase of a field is as exact as the field is bright. Some pixels are dark.
    let bound = 30.0 * rounding(case);
    let (mut body, mut expected) = (case.body(backend), case.body(&Plain));
    let image_phase = random(1, case.height_px * case.width_px, 6.0, 7).expect("a valid range");
    let flat = |field: Vec<Complex32>| field.iter().flat_map(|c| [c.re, c.im]).collect::<Vec<_>>();
    let [found, wanted] = [&body, &expected].map(|body| flat(body.back_propagated(&image_phase)));
    let error = difference(&found, &wanted);
    assert!(error < bound, "{case:?}: field {error:e} of {bound:e}");
    for weighted in [false, true] {
        let round = |body: &mut dyn Project| {
            let (mut phase, mut wanted) = (case.phase(), body.target_amplitudes());
            let evaluation = body.project(&mut phase, &mut wanted, weighted);
            let turns = flat(phase.iter().map(|&phase| Complex32::cis(phase)).collect());
            let wanted: Vec<f32> = wanted.iter().flat_map(|wanted| wanted.values()).copied().collect();
            (evaluation, turns, wanted)
        };
        let ((found, turns, weights), (told, told_turns, told_weights)) = (round(&mut *body), round(&mut *expected));
        for (found, told) in [(found.loss, told.loss), (found.best_gain, told.best_gain)] {
            assert!((found / told - 1.0).abs() < bound, "{case:?}: {found} {told}");
        }
        let errors = [difference(&turns, &told_turns), difference(&weights, &told_weights)];
        assert!(errors.iter().all(|&error| error < bound), "{case:?}, {weighted}: {errors:?} of {bound:e}");
    }
}

/// Some steps of Adam and of L-BFGS end at the same phases. They divide by gradients, some of which are small.
fn check_methods(backend: &dyn Backend) {
    let case = Case::plain((6, 10), Detector::Pixel);
    let found = [case.body(backend), case.body(&Plain)].map(|mut body| {
        let mut gradient = vec![0.0; case.phase().len()];
        let mut adam = AdamState::new(case.phase(), body.measure(&case.phase(), 1.0).best_gain);
        let mut losses = Vec::new();
        body.adam_steps(&mut adam, 0.1, 2, &mut gradient, &mut |evaluation| losses.push(evaluation.loss));
        body.adam_steps(&mut adam, 0.1, 1, &mut gradient, &mut |evaluation| losses.push(evaluation.loss));
        assert!(losses.len() == 3 && losses.is_sorted_by(|before, after| after < before), "{losses:?}");
        let (mut memory, mut workspace) = (LimitedMemory::new(case.phase()), Workspace::default());
        for _ in 0..4 {
            memory.advance(&mut workspace, |phase, gradient| body.evaluate(phase, Gain::Fitted, gradient).loss);
        }
        (adam.phase, memory.point)
    });
    let [(adam, lbfgs), (adam_plain, lbfgs_plain)] = found;
    for (found, wanted) in [(adam, adam_plain), (lbfgs, lbfgs_plain)] {
        assert!(difference(&wanted, &case.phase()) > 1e-2, "the steps move the phases");
        let error = difference(&found, &wanted);
        assert!(error < 10.0 * rounding(&case), "{error:e}");
    }
}

/// A target picture of a test problem with the display that shows it.
#[derive(Debug)]
pub(super) struct CasePlane {
    pub(super) model: DisplayModel,
    pub(super) target: Plane<f32>,
    pub(super) weight: Option<Plane<f32>>,
    pub(super) share: f64,
}

/// Parameters of a test problem.
#[derive(Clone, Copy, Debug)]
pub(super) struct Case {
    pub(super) height_px: usize,
    pub(super) width_px: usize,
    pub(super) detector: Detector,
    pub(super) carrier: Option<Carrier>,
    pub(super) planes: usize,
    pub(super) frames: usize,
    pub(super) masked: bool,
    pub(super) loss: Loss,
    pub(super) orders: Orders,
    /// Whether the display of each plane has all flaws instead of those that its size has.
    pub(super) all_flaws: bool,
}

impl Case {
    pub(super) fn plain((height_px, width_px): (usize, usize), detector: Detector) -> Self {
        let loss = Loss::default();
        Self {
            height_px,
            width_px,
            detector,
            carrier: None,
            planes: 1,
            frames: 1,
            masked: false,
            loss,
            orders: Orders::First,
            all_flaws: false,
        }
    }

    fn body(&self, backend: &dyn Backend) -> Box<dyn Project> {
        let planes = self.planes();
        let pictures = planes.iter().map(|CasePlane { model, target, weight, share }| {
            let display = Prepared::new(model, self.detector, self.carrier).expect("the display is valid");
            Picture { display, target: target.clone(), weight: weight.clone(), share: *share }
        });
        let problem = HologramProblem::on(backend, pictures.collect(), self.frames, self.region(), self.loss);
        problem.expect("the backend computes the problem").body
    }

    pub(super) fn region(&self) -> RegionOfInterest {
        RegionOfInterest::middle(&Grid::try_new(self.height_px, self.width_px, 8e-6).expect("a valid test problem"))
    }

    /// The pictures, each with its display.
    pub(super) fn planes(&self) -> Vec<CasePlane> {
        let (height_px, width_px) = (self.height_px, self.width_px);
        let grid = Grid::try_new(height_px, width_px, 8e-6).expect("a valid test problem");
        let plane = |p: usize| {
            let setup = OpticalSetup::try_new(grid, 515e-9, 3e-3 - 2e-3 * p as f64).expect("a valid test problem");
            let setup = setup.with_orders(self.orders).expect("a valid test problem");
            // The kernel varies for odd heights, and in the second plane.
            let varies = self.all_flaws || height_px % 2 == 1 || p == 1;
            // Some sizes have cross-talk in one plane only, or a varying response.
            let wraps = [width_px != 13 && p == 0, width_px == 30 || p == 1].map(|flaw| self.all_flaws || flaw);
            let wave = |y: usize, x: usize| 0.5 + 0.4 * ((3 * y + (5 + p) * x) as f32).sin();
            let weight = |y: usize, x: usize| [1.0, 0.0, 0.4][(y + 2 * x + p) % 3];
            CasePlane {
                model: flawed(setup, varies, wraps),
                target: Plane::from_fn(height_px, width_px, wave),
                weight: self.masked.then(|| Plane::from_fn(height_px, width_px, weight)),
                share: 1.0 + p as f64,
            }
        };
        (0..self.planes).map(plane).collect()
    }

    pub(super) fn phase(&self) -> Vec<f32> {
        random(self.frames, self.height_px * self.width_px, 6.0, 5).expect("a valid test problem")
    }
}

/// Display with all flaws of the display model. Its kernel varies across the image if `varies` is true. With `blurs`
/// its pixels have cross-talk and its light blurs, and with `uneven` its response varies, and there are dust, a ghost
/// and three modes of light.
fn flawed(setup: OpticalSetup, varies: bool, [blurs, uneven]: [bool; 2]) -> DisplayModel {
    let smooth = |order, scale: f64| {
        let mut field = SmoothField::flat(order);
        let both = field.log_amplitude.iter_mut().chain(&mut field.phase);
        both.enumerate().for_each(|(i, c)| *c = scale * (1.7 * i as f64 + 0.3).sin());
        field
    };
    DisplayModel {
        kernel: KernelShape::Smooth(smooth(3, 0.3)),
        ghost: match uneven {
            true => Ghost { amplitude: Complex64::new(0.1, -0.07), shift_px: [4.3, -2.2], defocus_rad: 3.0 },
            false => Ghost::NONE,
        },
        variation: match varies {
            true => SpatialVariation::new([0.1, -0.1, 0.05, 0.1, -0.05].map(|scale| smooth(2, scale))),
            false => SpatialVariation::none(),
        },
        coherence: match uneven {
            true => PartialCoherence::new(vec![
                FurtherMode { light: 0.7, errors: smooth(2, 0.4) },
                FurtherMode { light: 0.3, errors: smooth(1, -0.6) },
            ]),
            false => PartialCoherence::none(),
        },
        source: smooth(2, 0.1),
        dust: match uneven {
            true => {
                let (height_px, width_px) = (setup.grid().height_px(), setup.grid().width_px());
                let steps =
                    |y, x| [(y * 7919 + x * 104_729) % 4001, (y * 31 + x * 17) % 3001].map(|n: usize| n as i16 - 2000);
                Dust::new(Plane::from_fn(height_px, width_px, steps))
            }
            false => Dust::none(),
        },
        response: vec![[0.15, -0.05], [0.02, 0.04]],
        zero_order: Complex64::new(0.03, -0.02),
        crosstalk: if blurs { Crosstalk { ratio_x: 0.1, ratio_y: 0.04 } } else { Crosstalk::NONE },
        light_blur: if blurs { LightBlur { ratio_x: 0.3, ratio_y: 0.5 } } else { LightBlur::NONE },
        response_variation: match uneven {
            true => ResponseVariation { order: 1, coefficients: vec![0.05, -0.1, 0.08] },
            false => ResponseVariation::none(),
        },
        ..DisplayModel::ideal(setup)
    }
}
