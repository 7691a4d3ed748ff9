use super::*;
use crate::display::parts::blocks::Blocks;
use crate::display::parts::{Block, ModelPart};
use crate::display::{Carrier, Detector, OpticalSetup, Orders};
use crate::hologram::initial_phase;
use crate::learning::layout::Layout;
use crate::learning::options::KernelModel;
use crate::learning::pair::Pair;
use crate::numerics::{Grid, Plane, RegionOfInterest};

type Case = (KernelModel, usize, Blocks, Option<Carrier>, Orders);

/// A fit away from any optimum, its example and its parameters.
fn fit_away_from_optimum((model, order, blocks, carrier, orders): Case) -> (Fit<f64>, Example<f64>, Vec<f64>) {
    let grid = Grid::try_new(18, 23, 8e-6).unwrap();
    let setup = OpticalSetup::try_new(grid, 515e-9, 2e-3).unwrap().with_orders(orders).unwrap();
    let layout = Layout::of(model, order, blocks).on(&setup);
    let mut fit = Fit::<f64>::new(vec![setup], layout, Detector::Pixel, carrier).unwrap();
    // Some pixels are saturated.
    let photo = Plane::from_fn(18, 23, |y, x| (0.6 + 0.5 * ((y * 2 + x * 3) as f32).sin()).min(1.0));
    let pair = Pair { phase: initial_phase(18, 23, 6.0, 3).unwrap(), photo };
    let example = Example::new(&pair, &fit.engine, RegionOfInterest::middle(&grid)).unwrap();
    let mut theta: Vec<f64> = (0..fit.layout.len()).map(|i| 0.1 * (i as f64 * 1.3 + 0.5).sin()).collect();
    theta[layout.range(ModelPart::Crosstalk)].iter_mut().for_each(|q| *q = 0.1 + q.abs());
    theta[layout.range(ModelPart::LightBlur)].iter_mut().for_each(|q| *q = 0.2 + q.abs());
    fit.set(0, &theta);
    (fit, example, theta)
}

const ALL_ORDERS: Orders = Orders::All { fill_factor_x: 0.9, fill_factor_y: 0.7 };
const MODELS: [Case; 8] = [
    (KernelModel::Smooth, 3, Blocks::NONE, None, Orders::First),
    (KernelModel::Display, 4, Blocks::NONE, None, Orders::First),
    (KernelModel::Display, 2, Blocks::NONE, Some(Carrier::HalfOrderX), Orders::First),
    (KernelModel::Varying, 5, Blocks::NONE.with(Block::Varying), Some(Carrier::HalfOrderX), Orders::First),
    (KernelModel::Display, 2, Blocks::NONE.with(Block::LightBlur), None, Orders::First),
    (KernelModel::Display, 2, Blocks::ALL.without(Block::Varying), Some(Carrier::HalfOrderX), Orders::First),
    (KernelModel::Varying, 3, Blocks::NONE.with(Block::Varying), None, ALL_ORDERS),
    (KernelModel::Display, 2, Blocks::ALL.without(Block::Varying), None, ALL_ORDERS),
];

#[test]
fn light_derivatives_match_back_propagated_gradient() {
    for case @ (model, .., orders) in MODELS {
        let (mut fit, example, _) = fit_away_from_optimum(case);
        let (_, backward) = fit.evaluate(&example);
        let forward = fit.curvature(&example, 0, 1).gradient;
        let scale = backward.iter().fold(0.0_f64, |largest, g| largest.max(g.abs()));
        for (i, (forward, backward)) in forward.iter().zip(&backward).enumerate() {
            assert!(
                (forward - backward).abs() < 1e-10 * scale,
                "{model:?}, {orders}, {i}: {forward} against {backward}"
            );
        }
    }
}

/// Values along the sampled rows: first 1, stride 3.
fn sampled(example: &Example<f64>, value: impl Fn(usize, usize) -> f64) -> Vec<f64> {
    let rows = (0..18).filter_map(|y| example.region.columns(y).map(|columns| (y, columns))).skip(1).step_by(3);
    rows.flat_map(|(y, columns)| columns.map(move |x| (y, x))).map(|(y, x)| value(y, x)).collect()
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// `a` minus its projection onto `b`.
fn without(a: &[f64], b: &[f64]) -> Vec<f64> {
    let share = product(a, b) / product(b, b);
    a.iter().zip(b).map(|(a, b)| a - share * b).collect()
}

#[test]
fn curvature_matches_central_differences() {
    for case @ (model, .., orders) in MODELS {
        let (mut fit, example, theta) = fit_away_from_optimum(case);
        let curvature = fit.curvature(&example, 1, 3);
        let (gain, h) = (fit.gain, 1e-5);
        let mut light = |theta: &[f64]| -> Vec<f64> {
            fit.set(0, theta);
            let light = fit.engine.light(&example.phase).unwrap();
            sampled(&example, |y, x| gain * light.at(y, x) * example.weight.at(y, x))
        };
        let weight = sampled(&example, |y, x| example.weight.at(y, x));
        let brightness = without(&light(&theta), &weight);
        let differences: Vec<Vec<f64>> = (0..theta.len())
            .map(|i| {
                let mut at = |step: f64| {
                    let mut moved = theta.clone();
                    moved[i] += step;
                    light(&moved)
                };
                let (after, before) = (at(h), at(-h));
                let slope: Vec<f64> = after.iter().zip(&before).map(|(a, b)| (a - b) / (2.0 * h)).collect();
                without(&without(&slope, &weight), &brightness)
            })
            .collect();
        let scale = curvature.matrix.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        let counted: f64 = weight.iter().sum();
        for a in 0..theta.len() {
            for b in 0..theta.len() {
                let difference = 2.0 / counted * product(&differences[a], &differences[b]);
                let exact = curvature.matrix[a * theta.len() + b];
                assert!(
                    (exact - difference).abs() < 1e-6 * scale,
                    "{model:?}, {orders}, {a} and {b}: {exact}, {difference}"
                );
            }
        }
    }
}
