//! Displays that show all orders of their pixels.

use super::{HEIGHT_PX, WIDTH_PX, held_out_loss, learned, options, pairs};
use lightpath_bench::{SimulatedBench, SimulatedDisplay};
use lightpath_optics::hologram::initial_phase;
use lightpath_optics::learning::{KernelModel, LearnOptions, Learner, LearningPairs, Pair, compare};
use lightpath_optics::{
    Detector, DisplayModel, Engine, Grid, KernelShape, OpticalSetup, Orders, RegionOfInterest, SmoothField,
};

/// A simulated display that shows all orders of its pixels, at two thirds of the critical distance along x.
pub(crate) fn bench_of_all_orders([height_px, width_px]: [usize; 2], seed: u64) -> SimulatedDisplay {
    let grid = Grid::try_new(height_px, width_px, 8e-6).unwrap();
    let setup = OpticalSetup::try_new(grid, 515e-9, 6.25e-5 * width_px as f64).unwrap();
    let setup = setup.with_orders(Orders::All { fill_factor_x: 0.9, fill_factor_y: 0.8 }).unwrap();
    let bench = SimulatedBench { seed, misalignment_px: 0.5, ..SimulatedBench::FAIR };
    SimulatedDisplay::draw(setup, None, bench).unwrap()
}

/// The bench has errors of its own in each order. With errors that repeat in every order, the loss is a fifth of that
/// of the ideal display.
#[test]
fn errors_of_each_order_are_learned() {
    let bench = bench_of_all_orders([HEIGHT_PX, WIDTH_PX], 5);
    let training = pairs(&bench, 6, 100);
    let learner = learned(&bench, options(&bench, Some(5)), LearningPairs::training_only(&training));
    let ideal = held_out_loss(&bench, &DisplayModel::ideal(bench.setup()));
    let loss = held_out_loss(&bench, &learner.model());
    assert!(loss < 0.04 * ideal, "{loss} against {ideal}");
}

/// A display that shows all orders of its pixels, with errors that learning must find. Its photographs have 12 bits and
/// no noise.
#[test]
fn display_with_all_orders_is_learned() {
    let grid = Grid::try_new(HEIGHT_PX, WIDTH_PX, 8e-6).unwrap();
    let setup = OpticalSetup::try_new(grid, 515e-9, 8e-3).unwrap().with_orders(Orders::SQUARE).unwrap();
    let mut errors = SmoothField::flat(3);
    errors.phase.iter_mut().enumerate().for_each(|(i, c)| *c = 0.6 * (1.7 * i as f64).cos());
    errors.log_amplitude[2] = -0.2;
    let mut beyond = SmoothField::flat(2);
    (beyond.phase[0], beyond.phase[3], beyond.log_amplitude[1]) = (-2.0, 1.5, -0.5);
    let kernel = KernelShape::Smooth(errors);
    let truth = DisplayModel { kernel, beyond, gain: 0.4, ..DisplayModel::ideal(setup) };
    let camera = Engine::new(&truth, Detector::Pixel, None).unwrap();
    let pairs = |count: u64, seed: u64| -> Vec<Pair> {
        let one = |i: u64| {
            let phase = initial_phase(HEIGHT_PX, WIDTH_PX, 3.0, seed + i).unwrap();
            let light = camera.light(&phase).unwrap();
            let photo = light.map(|light| ((0.25 * light).clamp(0.0, 1.0) * 4095.0).round() / 4095.0);
            Pair { phase, photo }
        };
        (0..count).map(one).collect()
    };
    let (training, test) = (pairs(5, 100), pairs(2, 900));
    let region = RegionOfInterest::middle(&grid);
    let options = LearnOptions { seed: 3, degree: Some(4), ..LearnOptions::new(KernelModel::Smooth, region) };
    let mut learner = Learner::start(setup, options, &training).unwrap();
    while learner.step(LearningPairs::training_only(&training)).unwrap().is_some() {}
    let learned = learner.model();
    assert_eq!(learned.setup.orders(), Orders::SQUARE);
    let loss = |model: &DisplayModel| {
        let engine = Engine::new(model, Detector::Pixel, None).unwrap();
        test.iter().map(|pair| compare(&engine, pair, region).unwrap().fitted_loss()).sum::<f64>()
    };
    let within = DisplayModel { beyond: SmoothField::flat(0), ..learned.clone() };
    assert!(loss(&within) > 1.5 * loss(&learned), "the errors beyond the band are a part of the model");
    let (learned, ideal) = (loss(&learned), loss(&DisplayModel::ideal(setup)));
    assert!(learned < 0.01 * ideal, "{learned} against {ideal}");
}
