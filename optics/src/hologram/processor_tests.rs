//! Tests of the gradients against central differences in f64, for all losses and detectors and several numbers of
//! frames and planes.

use super::*;
use crate::display::{Carrier, Detector, DisplayModel, OpticalSetup, Orders};
use crate::hologram::conformance::Case;
use crate::hologram::loss::check_planes;
use crate::numerics::{Grid, Plane};

const SIZES: [(usize, usize); 3] = [(16, 24), (17, 13), (11, 30)];

impl Case {
    fn problem(&self) -> ProcessorProblem<f64> {
        let engine = |model: &DisplayModel| EngineCore::new(model, self.detector, self.carrier).unwrap();
        let planes = self.planes().into_iter().map(|plane| PlaneInput {
            engine: engine(&plane.model),
            target: plane.target.map(f64::from),
            weight: plane.weight.map(|weight| weight.map(f64::from)),
            share: plane.share,
        });
        ProcessorProblem::with_planes(planes.collect(), self.frames, self.region(), self.loss)
    }

    fn phase_f64(&self) -> Vec<f64> {
        self.phase().into_iter().map(f64::from).collect()
    }

    /// Compares the gradient along one direction with the central difference of the loss, at a fixed gain or the fitted
    /// gain.
    fn check(&self, gain: Gain) {
        let (mut problem, phase) = (self.problem(), self.phase_f64());
        let direction: Vec<f64> = (0..phase.len()).map(|i| (i as f64 * 2.3).cos()).collect();
        let mut gradient = vec![f64::NAN; phase.len()];
        let evaluation = problem.evaluate(&phase, gain, &mut gradient);
        let slope: f64 = gradient.iter().zip(&direction).map(|(g, d)| g * d).sum();
        let h = 1e-5;
        let mut at = |step: f64| {
            let moved: Vec<f64> = phase.iter().zip(&direction).map(|(p, d)| p + step * d).collect();
            match gain {
                Gain::Given(gain) => problem.measure(&moved, gain).loss,
                Gain::Fitted => problem.measure(&moved, 1.0).best_loss,
            }
        };
        let difference = (at(h) - at(-h)) / (2.0 * h);
        let error = (slope - difference).abs() / difference.abs();
        assert!(error < 1e-6, "{self:?} gain {gain:?}: {slope} against {difference}");
        let value = at(0.0);
        let found = if gain == Gain::Fitted { evaluation.best_loss } else { evaluation.loss };
        assert!((found - value).abs() < 1e-12, "{self:?} gain {gain:?}: {found} against {value}");
    }
}

#[test]
fn gradient_matches_central_differences() {
    for size in SIZES {
        for detector in Detector::ALL {
            for carrier in [None, Some(Carrier::HalfOrderX), Some(Carrier::HalfOrderY)] {
                Case { carrier, ..Case::plain(size, detector) }.check(Gain::Given(0.7));
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
                        case.check(Gain::Given(0.7));
                        case.check(Gain::Fitted);
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
            case.check(Gain::Given(0.7));
            case.check(Gain::Fitted);
        }
    }
}

#[test]
fn roughness_does_not_depend_on_brightness_or_gain() {
    let loss = Loss { total_variation: 1.0, speckle: 1.0, speckle_block_px: 4, ..Loss::default() };
    let case = Case { loss, ..Case::plain((16, 24), Detector::Pixel) };
    let (mut rough, mut plain) = (case.problem(), Case { loss: Loss::default(), ..case }.problem());
    let phase = case.phase_f64();
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
        let (mut problem, phase) = (case.problem(), case.phase_f64());
        let (mut fused, mut two) = (vec![0.0; phase.len()], vec![0.0; phase.len()]);
        let gain = problem.measure(&phase, 1.0).best_gain;
        let one = problem.evaluate(&phase, Gain::Given(gain), &mut fused);
        let other = problem.evaluate(&phase, Gain::Fitted, &mut two);
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
    let refusal = |planes: Vec<PlaneInput<f64>>, frames, loss| {
        let planes: Vec<_> = planes.iter().map(PlaneInput::unchecked).collect();
        check_planes(&planes, frames, region, &loss).unwrap_err().to_string()
    };
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
