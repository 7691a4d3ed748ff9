//! Learning a display from photographs, including photographs of wrong holograms.
#![allow(clippy::unwrap_used)]

use lightpath_bench::{SimulatedBench, SimulatedDisplay};
use lightpath_optics::hologram::initial_phase;
use lightpath_optics::learning::{
    KernelModel, LearnOptions, LearnStage, LearnState, Learner, LearningPairs, Pair, compare,
};
use lightpath_optics::{Detector, DisplayModel, Engine, Error, Grid, OpticalSetup, RegionOfInterest};

mod certainty;
mod distances;
mod mechanisms;
mod orders;
mod repeatable;

const HEIGHT_PX: usize = 72;
const WIDTH_PX: usize = 96;

fn bench(seed: u64) -> SimulatedDisplay {
    simulated_display(6e-3, SimulatedBench { seed, misalignment_px: 0.5, ..SimulatedBench::FAIR })
}

fn simulated_display(distance_m: f64, imperfections: SimulatedBench) -> SimulatedDisplay {
    let grid = Grid::try_new(HEIGHT_PX, WIDTH_PX, 8e-6).unwrap();
    let setup = OpticalSetup::try_new(grid, 515e-9, distance_m).unwrap();
    SimulatedDisplay::draw(setup, None, imperfections).unwrap()
}

/// Pairs of holograms and their photographs; half of the holograms are speckled and half are smooth.
fn pairs(bench: &SimulatedDisplay, count: u64, seed: u64) -> Vec<Pair> {
    let grid = bench.setup().grid();
    let one = |i: u64| {
        let range_rad = if i.is_multiple_of(2) { 6.0 } else { 2.0 };
        let phase = initial_phase(grid.height_px(), grid.width_px(), range_rad, seed + i).unwrap();
        let photo = bench.capture(&phase, seed + i).unwrap().map(|level| f32::from(level) / 255.0);
        Pair { phase, photo }
    };
    (0..count).map(one).collect()
}

fn options(bench: &SimulatedDisplay, degree: Option<usize>) -> LearnOptions {
    let region = RegionOfInterest::middle(&bench.setup().grid());
    LearnOptions { seed: 3, degree, ..LearnOptions::new(KernelModel::Display, region) }
}

fn learned(bench: &SimulatedDisplay, options: LearnOptions, learning_pairs: LearningPairs<'_>) -> Learner {
    let mut learner = Learner::start(bench.setup(), options, learning_pairs.training).unwrap();
    while learner.step(learning_pairs).unwrap().is_some() {}
    learner
}

fn held_out_loss(bench: &SimulatedDisplay, model: &DisplayModel) -> f64 {
    let engine = Engine::new(model, Detector::Pixel, None).unwrap();
    let region = RegionOfInterest::middle(&bench.setup().grid());
    let test = pairs(bench, 3, 900);
    test.iter().map(|pair| compare(&engine, pair, region).unwrap().fitted_loss()).sum::<f64>() / test.len() as f64
}

#[test]
fn learned_display_has_far_lower_loss_than_ideal_display() {
    let bench = bench(5);
    let training = pairs(&bench, 6, 100);
    let learner = learned(&bench, options(&bench, Some(5)), LearningPairs::training_only(&training));
    let ideal = held_out_loss(&bench, &DisplayModel::ideal(bench.setup()));
    let loss = held_out_loss(&bench, &learner.model());
    assert!(loss < 0.03 * ideal, "{loss} against {ideal}");
}

#[test]
fn photograph_of_another_hologram_is_left_out() {
    let bench = bench(6);
    let mut training = pairs(&bench, 8, 100);
    training[3].photo = pairs(&bench, 1, 500)[0].photo.clone();
    let learner = learned(&bench, options(&bench, Some(5)), LearningPairs::training_only(&training));
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
fn validation_chooses_order_and_reports_best_loss() {
    let bench = bench(8);
    let (training, validation) = (pairs(&bench, 6, 100), pairs(&bench, 2, 400));
    let learning_pairs = LearningPairs { training: &training, validation: &validation };
    let mut learner = Learner::start(bench.setup(), options(&bench, None), &training).unwrap();
    let mut losses = Vec::new();
    while let Some(step) = learner.step(learning_pairs).unwrap() {
        losses.push(step.validation_loss.unwrap_or(f64::INFINITY));
    }
    let last = losses.pop().expect("a step");
    assert!(losses.is_sorted_by(|before, after| after <= before), "the best validation loss never rises: {losses:?}");
    // At the end a block that lowers the loss by less than a tenth is left out.
    assert!(0.9 * last < losses[losses.len() - 1], "{last} after {losses:?}");
    let fixed = learned(&bench, options(&bench, Some(5)), LearningPairs::training_only(&training));
    let (chosen, fixed) = (held_out_loss(&bench, &learner.model()), held_out_loss(&bench, &fixed.model()));
    assert!(chosen < 1.05 * fixed, "{chosen} against {fixed}");
}

#[test]
fn kernel_varies_over_modulator_only_if_validation_loss_falls() {
    let fair = SimulatedBench { seed: 5, ..SimulatedBench::FAIR };
    for (field_aberration_rad, varies) in [(6.0, true), (0.0, false)] {
        let bench = simulated_display(6e-3, SimulatedBench { field_aberration_rad, ..fair });
        let (training, validation) = (pairs(&bench, 8, 100), pairs(&bench, 2, 400));
        let learning_pairs = LearningPairs { training: &training, validation: &validation };
        let display = learned(&bench, options(&bench, Some(5)), learning_pairs).model();
        let model = KernelModel::Varying;
        let varying = learned(&bench, LearnOptions { model, ..options(&bench, Some(5)) }, learning_pairs).model();
        assert_eq!(!varying.variation.is_none(), varies, "{field_aberration_rad} rad");
        let (varying, display) = (held_out_loss(&bench, &varying), held_out_loss(&bench, &display));
        assert!(if varies { varying < 0.6 * display } else { varying == display }, "{varying} against {display}");
    }
}

#[test]
fn fitted_model_takes_explained_pairs_back_and_leaves_wrong_ones_out() {
    let bench = simulated_display(6e-3, SimulatedBench { seed: 5, crosstalk_px: 0.45, ..SimulatedBench::FAIR });
    let (mut training, validation) = (pairs(&bench, 10, 100), pairs(&bench, 2, 400));
    training[3].photo = training[4].photo.clone();
    let learning_pairs = LearningPairs { training: &training, validation: &validation };
    for has_validation in [true, false] {
        let learning_pairs = if has_validation { learning_pairs } else { LearningPairs::training_only(&training) };
        let options = options(&bench, Some(5));
        let mut learner = Learner::start(bench.setup(), options.clone(), &training).unwrap();
        while learner.step(learning_pairs).unwrap().unwrap().stage == LearnStage::Adam {}
        assert_eq!(learner.kept_pairs(10), [0, 1, 2, 4, 5, 6, 7, 8, 9]);
        // As if two good photographs had resembled their holograms too little.
        let mut state = serde_json::to_value(learner.state()).unwrap();
        state["Parametric"]["kept"] = serde_json::json!([0, 2, 4, 5, 7, 8, 9]);
        let state: LearnState = serde_json::from_value(state).unwrap();
        let mut learner = Learner::resume(bench.setup(), options, state).unwrap();
        assert_eq!(learner.kept_pairs(10).len(), 7);
        while learner.step(learning_pairs).unwrap().is_some() {}
        assert_eq!(learner.kept_pairs(10), [0, 1, 2, 4, 5, 6, 7, 8, 9], "validation pairs: {has_validation}");
    }
}

#[test]
fn warm_start_needs_few_steps() {
    let bench = bench(9);
    let training = pairs(&bench, 6, 100);
    let first = learned(&bench, options(&bench, Some(5)), LearningPairs::training_only(&training));
    let warm = LearnOptions { warm_start: Some(first.model()), ..options(&bench, Some(5)) };
    let mut learner = Learner::start(bench.setup(), warm, &training).unwrap();
    let mut steps = 0;
    while learner.step(LearningPairs::training_only(&training)).unwrap().is_some() {
        steps += 1;
    }
    assert!(steps < 8, "{steps} steps after a warm start");
    let (before, after) = (held_out_loss(&bench, &first.model()), held_out_loss(&bench, &learner.model()));
    assert!(after < 1.05 * before, "{after} against {before}");
}
