//! Learning a display from photographs, as a lab with slips of its own makes them.
#![allow(clippy::unwrap_used)]

use lightpath_optics::hologram::initial_phase;
use lightpath_optics::learning::{LearnModel, LearnOptions, Learner, Lessons, Pair, compare};
use lightpath_optics::simulated_display::{Imperfections, SimulatedDisplay};
use lightpath_optics::{Detector, DisplayModel, Engine, Error, Grid, OpticalSetup, RegionOfInterest};
use rayon::ThreadPoolBuilder;

const HEIGHT_PX: usize = 72;
const WIDTH_PX: usize = 96;

fn bench(seed: u64) -> SimulatedDisplay {
    let grid = Grid::try_new(HEIGHT_PX, WIDTH_PX, 8e-6).unwrap();
    let setup = OpticalSetup::try_new(grid, 515e-9, 6e-3).unwrap();
    let imperfections = Imperfections { seed, misalignment_px: 0.5, ..Imperfections::FAIR };
    SimulatedDisplay::draw(setup, None, imperfections).unwrap()
}

/// Photographs of speckled and of smooth holograms.
fn pairs(bench: &SimulatedDisplay, count: u64, seed: u64) -> Vec<Pair> {
    let one = |i: u64| {
        let range_rad = if i.is_multiple_of(2) { 6.0 } else { 2.0 };
        let phase = initial_phase(HEIGHT_PX, WIDTH_PX, range_rad, seed + i).unwrap();
        let photo = bench.capture(&phase, seed + i).unwrap().map(|level| f32::from(level) / 255.0);
        Pair { phase, photo }
    };
    (0..count).map(one).collect()
}

fn options(bench: &SimulatedDisplay, order: Option<usize>) -> LearnOptions {
    let region = RegionOfInterest::middle(&bench.setup().grid());
    LearnOptions { seed: 3, ..LearnOptions::new(LearnModel::Display { order }, region) }
}

fn learned(bench: &SimulatedDisplay, options: LearnOptions, lessons: Lessons<'_>) -> Learner {
    let mut learner = Learner::start(bench.setup(), options, lessons.training).unwrap();
    while learner.step(lessons).unwrap().is_some() {}
    learner
}

fn held_out_loss(bench: &SimulatedDisplay, model: &DisplayModel) -> f64 {
    let engine = Engine::<f32>::new(model, Detector::Pixel, None).unwrap();
    let region = RegionOfInterest::middle(&bench.setup().grid());
    let test = pairs(bench, 3, 900);
    test.iter().map(|pair| compare(&engine, pair, region).unwrap().fitted_loss()).sum::<f64>() / test.len() as f64
}

#[test]
fn a_display_is_learned_down_to_the_noise_of_its_camera() {
    let bench = bench(5);
    let training = pairs(&bench, 6, 100);
    let learner = learned(&bench, options(&bench, Some(5)), Lessons::only(&training));
    let ideal = held_out_loss(&bench, &DisplayModel::ideal(bench.setup()));
    let loss = held_out_loss(&bench, &learner.model());
    assert!(loss < 0.03 * ideal, "{loss} against {ideal}");
}

#[test]
fn a_photograph_of_another_hologram_is_found_and_left_out() {
    let bench = bench(6);
    let mut training = pairs(&bench, 8, 100);
    training[3].photo = pairs(&bench, 1, 500)[0].photo.clone();
    let learner = learned(&bench, options(&bench, Some(5)), Lessons::only(&training));
    assert_eq!(learner.kept_pairs(8), [0, 1, 2, 4, 5, 6, 7]);
    let ideal = held_out_loss(&bench, &DisplayModel::ideal(bench.setup()));
    let loss = held_out_loss(&bench, &learner.model());
    assert!(loss < 0.03 * ideal, "{loss} against {ideal}");
}

#[test]
fn photographs_of_other_holograms_are_refused() {
    let bench = bench(7);
    let mut training = pairs(&bench, 6, 100);
    training.iter_mut().zip(pairs(&bench, 6, 300)).for_each(|(pair, other)| pair.photo = other.photo);
    let error = Learner::start(bench.setup(), options(&bench, Some(5)), &training).unwrap_err();
    assert!(matches!(error.downcast_ref(), Some(Error::Unrelated { .. })), "{error}");
}

#[test]
fn validation_chooses_the_order_and_says_so() {
    let bench = bench(8);
    let (training, validation) = (pairs(&bench, 6, 100), pairs(&bench, 2, 400));
    let lessons = Lessons { training: &training, validation: &validation };
    let mut learner = Learner::start(bench.setup(), options(&bench, None), &training).unwrap();
    let mut best = f64::INFINITY;
    while let Some(step) = learner.step(lessons).unwrap() {
        let loss = step.validation_loss.unwrap_or(f64::INFINITY);
        assert!(loss <= best, "the best so far never gets worse");
        best = loss;
    }
    let fixed = learned(&bench, options(&bench, Some(5)), Lessons::only(&training));
    let (chosen, fixed) = (held_out_loss(&bench, &learner.model()), held_out_loss(&bench, &fixed.model()));
    assert!(chosen < 1.05 * fixed, "{chosen} against {fixed}");
}

#[test]
fn learning_goes_on_from_an_earlier_version() {
    let bench = bench(9);
    let training = pairs(&bench, 6, 100);
    let first = learned(&bench, options(&bench, Some(5)), Lessons::only(&training));
    let warm = LearnOptions { warm_start: Some(first.model()), ..options(&bench, Some(5)) };
    let mut learner = Learner::start(bench.setup(), warm, &training).unwrap();
    let mut steps = 0;
    while learner.step(Lessons::only(&training)).unwrap().is_some() {
        steps += 1;
    }
    assert!(steps < 8, "{steps} steps from what was learned already");
    let (before, after) = (held_out_loss(&bench, &first.model()), held_out_loss(&bench, &learner.model()));
    assert!(after < 1.05 * before, "{after} against {before}");
}

#[test]
fn learning_is_the_same_on_any_number_of_threads_and_after_a_pause() {
    let bench = bench(10);
    let (training, validation) = (pairs(&bench, 5, 100), pairs(&bench, 2, 400));
    let lessons = Lessons { training: &training, validation: &validation };
    let short = || LearnOptions { refinement_evaluations: 8, epochs: 2, ..options(&bench, None) };
    let on = |threads: usize| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| learned(&bench, short(), lessons).model())
    };
    let one = on(1);
    assert_eq!(one, on(2));
    assert_eq!(one, on(8));

    let mut learner = Learner::start(bench.setup(), short(), &training).unwrap();
    while learner.step(lessons).unwrap().is_some() {
        learner = Learner::resume(bench.setup(), short(), learner.state()).unwrap();
    }
    assert_eq!(one, learner.model());
}
