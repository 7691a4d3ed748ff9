//! What every [`FieldAdjoint`] must compute, judged by the slow twin.

use super::adjoint::{Adjoint, FieldAdjoint, ModeAdjoint, SeriesGradient};
use super::fit::Fit;
use super::layout::Layout;
use super::options::KernelModel;
use super::pair::{Example, Pair};
use super::plain_adjoint::PlainAdjoint;
use crate::display::parts::blocks::Blocks;
use crate::display::parts::{Block, ModelPart};
use crate::display::{Carrier, Detector, DisplayModel, OpticalSetup};
use crate::hologram::initial_phase;
use crate::numerics::{Grid, Plane, RegionOfInterest};

/// All blocks but the varying kernel.
const ALL: Blocks = Blocks::ALL.without(Block::Varying);

/// Each group of numbers of a gradient, by name.
fn groups(adjoint: &Adjoint) -> Vec<(String, Vec<f64>)> {
    let series = |(alpha, psi): &SeriesGradient| [alpha.as_slice(), psi].concat();
    let mut groups = Vec::new();
    for (m, ModeAdjoint { light, kernels }) in adjoint.modes.iter().enumerate() {
        groups.push((format!("light of mode {m}"), vec![*light]));
        for (k, kernel) in kernels.iter().enumerate() {
            groups.push((format!("kernel {k} of mode {m}"), series(kernel)));
        }
    }
    groups.push(("ghost".into(), adjoint.ghost.map_or(vec![], Vec::from)));
    groups.push(("blur".into(), adjoint.blur.map_or(vec![], Vec::from)));
    if let Some(modulator) = &adjoint.modulator {
        groups.push(("source".into(), series(&modulator.source)));
        groups.push(("response".into(), modulator.response.as_flattened().to_vec()));
        groups.push(("zero order".into(), modulator.zero_order.to_vec()));
        groups.push(("cross-talk".into(), modulator.crosstalk.to_vec()));
        groups.push(("variation of the response".into(), modulator.variation.clone()));
    }
    groups
}

/// The first photograph of some holograms that has something of the light: without it there is no gradient.
fn example(fit: &mut Fit<f64>, region: RegionOfInterest) -> Example<f64> {
    let mut photo = Plane::from_fn(14, 19, |y, x| 0.5 + 0.5 * ((y * 2 + x * 3) as f32).sin());
    // One saturated pixel, which has no weight.
    photo.values_mut()[7 * 19 + 9] = 1.0;
    let examples = (3..20).map(|seed| {
        let pair = Pair { phase: initial_phase(14, 19, 6.0, seed).unwrap(), photo: photo.clone() };
        Example::new(&pair, &fit.engine, region).unwrap()
    });
    let mut examples = examples.collect::<Vec<_>>().into_iter();
    examples.find(|example| fit.measure(example).best_gain_and_offset().0 > 0.0).unwrap()
}

#[test]
fn gradients_of_the_processor_are_those_of_the_slow_twin() {
    for (model, order, blocks, carrier, detector) in [
        (KernelModel::Smooth, 3, Blocks::NONE, None, Detector::Point),
        (KernelModel::Display, 4, Blocks::NONE, Some(Carrier::HalfOrderX), Detector::Pixel),
        (KernelModel::Varying, 3, Blocks::NONE.with(Block::Varying), None, Detector::Supersampled),
        (KernelModel::Display, 2, Blocks::NONE.with(Block::LightBlur), None, Detector::Supersampled),
        (KernelModel::Display, 2, Blocks::NONE.with(Block::PartialCoherence), None, Detector::Point),
        (KernelModel::Display, 2, ALL, Some(Carrier::HalfOrderY), Detector::Pixel),
    ] {
        let grid = Grid::try_new(14, 19, 8e-6).unwrap();
        let setup = OpticalSetup::try_new(grid, 515e-9, 2e-3).unwrap();
        let layout = Layout::of(model, order, blocks);
        let mut fit = Fit::<f64>::new(vec![setup], layout, detector, carrier).unwrap();
        let mut theta: Vec<f64> = (0..layout.len()).map(|i| 0.1 * (i as f64 * 1.3 + 0.5).sin()).collect();
        theta[layout.range(ModelPart::Crosstalk)].iter_mut().for_each(|q| *q = 0.1 + q.abs());
        theta[layout.range(ModelPart::LightBlur)].iter_mut().for_each(|q| *q = 0.2 + q.abs());
        let display = layout.model(&setup, (1.0, 0.0), &theta);
        let mut twin = PlainAdjoint { model: DisplayModel::ideal(setup), layout, detector, carrier };
        FieldAdjoint::set(&mut fit, 0, &layout, &display);
        twin.set(0, &layout, &display);
        let example = example(&mut fit, RegionOfInterest::middle(&grid));
        let case = format!("{model:?}, {blocks:?}, {carrier:?}, {detector:?}");

        let mut judged: [&mut dyn FieldAdjoint<f64>; 2] = [&mut fit, &mut twin];
        let [found, expected] = judged.each_mut().map(|body| body.measure(&example));
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9 * b.abs().max(1e-3);
        let (found, expected) = (found.best_gain_and_offset(), expected.best_gain_and_offset());
        assert!(near(found.0, expected.0) && near(found.1, expected.1), "{case}: {found:?}, {expected:?}");
        let [(found_sums, found), (expected_sums, expected)] = judged.map(|body| body.adjoint(&example));
        assert!(near(found_sums.loss(), expected_sums.loss()), "{case}: {found_sums:?}, {expected_sums:?}");
        let (found, expected) = (groups(&found), groups(&expected));
        assert_eq!(found.len(), expected.len(), "{case}");
        for ((name, found), (_, expected)) in found.iter().zip(&expected) {
            assert_eq!(found.len(), expected.len(), "{case}: {name}");
            let scale = expected.iter().fold(1e-6_f64, |largest, value| largest.max(value.abs()));
            for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
                assert!((found - expected).abs() <= 1e-6 * scale, "{case}: {name}, {i}: {found}, {expected}");
            }
        }
    }
}
