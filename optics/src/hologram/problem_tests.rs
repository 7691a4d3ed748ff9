//! Tests of the gradients against central differences in f64, for all losses and detectors and several numbers of
//! frames and planes.

use super::*;
use crate::display::{
    Carrier, Crosstalk, DisplayModel, Dust, FurtherMode, Ghost, KernelShape, LightBlur, OpticalSetup, Orders,
    PartialCoherence, ResponseVariation, SpatialVariation,
};
use crate::engine::Detector;
use crate::hologram::initial::random;
use crate::numerics::{Grid, SmoothField};
use num_complex::Complex64;

const SIZES: [(usize, usize); 3] = [(16, 24), (17, 13), (11, 30)];

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

/// Parameters of a test problem.
#[derive(Clone, Copy, Debug)]
struct Case {
    height_px: usize,
    width_px: usize,
    detector: Detector,
    carrier: Option<Carrier>,
    planes: usize,
    frames: usize,
    masked: bool,
    loss: Loss,
    orders: Orders,
}

impl Case {
    fn plain((height_px, width_px): (usize, usize), detector: Detector) -> Self {
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
        }
    }

    fn problem(&self) -> ProblemCore<f64> {
        let (height_px, width_px) = (self.height_px, self.width_px);
        let grid = Grid::try_new(height_px, width_px, 8e-6).unwrap();
        let plane = |p: usize| {
            let setup = OpticalSetup::try_new(grid, 515e-9, 3e-3 - 2e-3 * p as f64).unwrap();
            let setup = setup.with_orders(self.orders).unwrap();
            // The kernel varies for odd heights, and in the second plane.
            let varies = height_px % 2 == 1 || p == 1;
            // Some sizes have cross-talk in one plane only, or a varying response.
            let wraps = [width_px != 13 && p == 0, width_px == 30 || p == 1];
            let engine = EngineCore::new(&flawed(setup, varies, wraps), self.detector, self.carrier).unwrap();
            let wave = |y: usize, x: usize| 0.5 + 0.4 * ((3 * y + (5 + p) * x) as f64).sin();
            let weight = |y: usize, x: usize| [1.0, 0.0, 0.4][(y + 2 * x + p) % 3];
            PlaneInput {
                engine,
                target: Plane::from_fn(height_px, width_px, wave),
                weight: self.masked.then(|| Plane::from_fn(height_px, width_px, weight)),
                share: 1.0 + p as f64,
            }
        };
        let planes = (0..self.planes).map(plane).collect();
        ProblemCore::with_planes(planes, self.frames, RegionOfInterest::middle(&grid), self.loss).unwrap()
    }

    fn phase(&self) -> Vec<f64> {
        let phase = random(self.frames, self.height_px * self.width_px, 6.0, 5).unwrap();
        phase.into_iter().map(f64::from).collect()
    }

    /// Compares the gradient along one direction with the central difference of the loss, at a fixed gain or the fitted
    /// gain.
    fn check(&self, gain: Option<f64>) {
        let (mut problem, phase) = (self.problem(), self.phase());
        let direction: Vec<f64> = (0..phase.len()).map(|i| (i as f64 * 2.3).cos()).collect();
        let mut gradient = vec![f64::NAN; phase.len()];
        let evaluation = match gain {
            Some(gain) => problem.evaluate(&phase, gain, &mut gradient),
            None => problem.evaluate_fitted(&phase, &mut gradient),
        };
        let slope: f64 = gradient.iter().zip(&direction).map(|(g, d)| g * d).sum();
        let h = 1e-5;
        let mut at = |step: f64| {
            let moved: Vec<f64> = phase.iter().zip(&direction).map(|(p, d)| p + step * d).collect();
            let found = problem.measure(&moved, gain.unwrap_or(1.0));
            if gain.is_some() { found.loss } else { found.best_loss }
        };
        let difference = (at(h) - at(-h)) / (2.0 * h);
        let error = (slope - difference).abs() / difference.abs();
        assert!(error < 1e-6, "{self:?} gain {gain:?}: {slope} against {difference}");
        let value = at(0.0);
        let found = if gain.is_some() { evaluation.loss } else { evaluation.best_loss };
        assert!((found - value).abs() < 1e-12, "{self:?} gain {gain:?}: {found} against {value}");
    }
}

#[test]
fn gradient_matches_central_differences() {
    for size in SIZES {
        for detector in Detector::ALL {
            for carrier in [None, Some(Carrier::HalfOrderX), Some(Carrier::HalfOrderY)] {
                Case { carrier, ..Case::plain(size, detector) }.check(Some(0.7));
            }
        }
    }
}

#[test]
fn gradient_is_exact_for_all_losses_detectors_frames_and_planes() {
    let roughness = Loss { total_variation: 0.3, speckle: 0.7, speckle_block_px: 3, ..Loss::default() };
    for (i, size) in SIZES.into_iter().enumerate() {
        for detector in Detector::ALL {
            for (planes, frames) in [(1, 1), (3, 1), (1, 2), (2, 3)] {
                for quantity in [Quantity::Intensity, Quantity::Amplitude] {
                    for terms in [Loss::default(), roughness] {
                        let loss = Loss { quantity, ..terms };
                        let masked = (i + planes + frames) % 2 == 0;
                        let case = Case { planes, frames, masked, loss, ..Case::plain(size, detector) };
                        case.check(Some(0.7));
                        case.check(None);
                    }
                }
            }
        }
    }
}

#[test]
fn gradient_is_exact_for_displays_with_all_orders() {
    let orders = Orders::All { fill_factor_x: 0.9, fill_factor_y: 1.0 };
    for (detector, planes, frames) in [(Detector::Pixel, 1, 1), (Detector::Supersampled, 2, 2), (Detector::Point, 2, 1)]
    {
        for size in [(16, 24), (17, 13)] {
            let case = Case { orders, planes, frames, ..Case::plain(size, detector) };
            case.check(Some(0.7));
            case.check(None);
        }
    }
}

#[test]
fn roughness_does_not_depend_on_brightness_or_gain() {
    let loss = Loss { total_variation: 1.0, speckle: 1.0, speckle_block_px: 4, ..Loss::default() };
    let case = Case { loss, ..Case::plain((16, 24), Detector::Pixel) };
    let (mut rough, mut plain) = (case.problem(), Case { loss: Loss::default(), ..case }.problem());
    let phase = case.phase();
    let mut excess = |gain| rough.measure(&phase, gain).loss - plain.measure(&phase, gain).loss;
    let (one, other) = (excess(0.5), excess(2.0));
    assert!(one > 0.01 && (one - other).abs() < 1e-12, "{one} {other}");
}

#[test]
fn fitted_gain_minimizes_loss() {
    let mut problem = Case::plain((20, 20), Detector::Pixel).problem();
    let phase = vec![0.5; 400];
    let best = problem.measure(&phase, 1.0);
    let at_best = problem.measure(&phase, best.best_gain);
    assert!((at_best.loss - best.best_loss).abs() < 1e-12);
    for gain in [0.99, 1.01] {
        assert!(problem.measure(&phase, gain * best.best_gain).loss > at_best.loss);
    }
}

#[test]
fn one_pass_and_two_passes_agree() {
    for detector in Detector::ALL {
        let case = Case { planes: 2, ..Case::plain((17, 13), detector) };
        let (mut problem, phase) = (case.problem(), case.phase());
        let (mut fused, mut two) = (vec![0.0; phase.len()], vec![0.0; phase.len()]);
        let gain = problem.measure(&phase, 1.0).best_gain;
        let one = problem.evaluate(&phase, gain, &mut fused);
        let other = problem.evaluate_fitted(&phase, &mut two);
        assert!((one.loss - other.loss).abs() < 1e-13);
        let scale = fused.iter().fold(0.0_f64, |largest, g| largest.max(g.abs()));
        assert!(fused.iter().zip(&two).all(|(a, b)| (a - b).abs() < 1e-12 * scale));
    }
}

#[test]
fn invalid_problems_are_refused_by_name() {
    let grid = Grid::try_new(16, 16, 8e-6).unwrap();
    let setup = OpticalSetup::try_new(grid, 515e-9, 3e-3).unwrap();
    let engine = EngineCore::<f64>::new(&DisplayModel::ideal(setup), Detector::Pixel, None).unwrap();
    let region = RegionOfInterest::middle(&grid);
    let input =
        |engine: EngineCore<f64>| PlaneInput { engine, target: Plane::filled(16, 16, 0.5), weight: None, share: 1.0 };
    let plane = || input(engine.clone());
    let refusal =
        |planes, frames, loss| ProblemCore::with_planes(planes, frames, region, loss).unwrap_err().to_string();
    let plain = Loss::default();
    assert!(refusal(vec![], 1, plain).starts_with("planes is empty"));
    assert!(refusal(vec![plane()], 0, plain).starts_with("frames is 0"));
    let black = PlaneInput { target: Plane::filled(16, 16, 0.0), ..plane() };
    assert!(refusal(vec![black], 1, plain).starts_with("target_intensity is empty"));
    let blind = PlaneInput { weight: Some(Plane::filled(16, 16, 0.0)), ..plane() };
    assert!(refusal(vec![plane(), blind], 1, plain).starts_with("weight is empty"));
    assert!(refusal(vec![PlaneInput { share: 0.0, ..plane() }], 1, plain).starts_with("share is 0"));
    let negative = PlaneInput { weight: Some(Plane::filled(16, 16, -0.1)), ..plane() };
    assert!(refusal(vec![negative], 1, plain).starts_with("weight is -0.1"));
    assert!(refusal(vec![plane()], 1, Loss { speckle: -1.0, ..plain }).starts_with("speckle is -1"));
    let large = Loss { speckle: 1.0, speckle_block_px: 13, ..plain };
    assert!(refusal(vec![plane()], 1, large).starts_with("speckle_block_px is 13"));
    let other = input(engine.with_detector(Detector::Point));
    assert!(refusal(vec![plane(), other], 1, plain).contains("same detector"));
}
