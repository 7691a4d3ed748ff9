//! Learning a display from photographs, including photographs of wrong holograms.
#![allow(clippy::unwrap_used)]

use lightpath_optics::hologram::initial_phase;
use lightpath_optics::learning::{
    Block, Blocks, BoxError, KernelModel, LearnOptions, LearnStage, LearnState, Learner, LearningPairs, Pair,
    PairSource, compare, interpolated,
};
use lightpath_optics::simulated_display::{SimulatedBench, SimulatedDisplay};
use lightpath_optics::{
    Detector, DisplayModel, Engine, Error, Grid, KernelShape, LightBlur, OpticalSetup, Orders, RegionOfInterest,
    SmoothField,
};
use rayon::ThreadPoolBuilder;
use std::f64::consts::TAU;

mod certainty;

const HEIGHT_PX: usize = 72;
const WIDTH_PX: usize = 96;

fn bench(seed: u64) -> SimulatedDisplay {
    simulated_display(6e-3, SimulatedBench { seed, misalignment_px: 0.5, ..SimulatedBench::FAIR })
}

/// A simulated display whose image moves by some pixels and whose aberrations grow with the distance.
fn bench_on_a_rail(distance_m: f64) -> SimulatedDisplay {
    let rail = SimulatedBench { seed: 11, rail_tilt_deg: 0.06, aberrations_at_m: 6e-3, ..SimulatedBench::FAIR };
    simulated_display(distance_m, rail)
}

fn simulated_display(distance_m: f64, imperfections: SimulatedBench) -> SimulatedDisplay {
    let grid = Grid::try_new(HEIGHT_PX, WIDTH_PX, 8e-6).unwrap();
    let setup = OpticalSetup::try_new(grid, 515e-9, distance_m).unwrap();
    SimulatedDisplay::draw(setup, None, imperfections).unwrap()
}

/// A simulated display that shows all orders of its pixels, at two thirds of the critical distance along x.
fn bench_of_all_orders(seed: u64) -> SimulatedDisplay {
    let setup = simulated_display(6e-3, SimulatedBench::FAIR).setup();
    let setup = setup.with_orders(Orders::All { fill_factor_x: 0.9, fill_factor_y: 0.8 }).unwrap();
    let bench = SimulatedBench { seed, misalignment_px: 0.5, ..SimulatedBench::FAIR };
    SimulatedDisplay::draw(setup, None, bench).unwrap()
}

/// Pairs of holograms and their photographs; half of the holograms are speckled and half are smooth.
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
    LearnOptions { seed: 3, order, ..LearnOptions::new(KernelModel::Display, region) }
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

/// The bench has errors of its own in each order. With errors that repeat in every order, the loss is a fifth of that
/// of the ideal display.
#[test]
fn errors_of_each_order_are_learned() {
    let bench = bench_of_all_orders(5);
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
    let options = LearnOptions { seed: 3, order: Some(4), ..LearnOptions::new(KernelModel::Smooth, region) };
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
    // At the end a ghost that lowers the loss by less than three tenths is left out.
    assert!(0.7 * last < losses[losses.len() - 1], "{last} after {losses:?}");
    let fixed = learned(&bench, options(&bench, Some(5)), LearningPairs::training_only(&training));
    let (chosen, fixed) = (held_out_loss(&bench, &learner.model()), held_out_loss(&bench, &fixed.model()));
    assert!(chosen < 1.05 * fixed, "{chosen} against {fixed}");
}

/// A display learned from ten photographs of a bench, with two more for validation. The light of the usual bench is no
/// polynomial of order 4, so a fine source describes it better by more than a tenth.
fn learned_with_validation(bench: &SimulatedDisplay) -> DisplayModel {
    let (training, validation) = (pairs(bench, 10, 100), pairs(bench, 2, 400));
    learned(bench, options(bench, None), LearningPairs { training: &training, validation: &validation }).model()
}

#[test]
fn crosstalk_is_found_and_its_width_recovered() {
    let crosstalk = SimulatedBench { seed: 5, crosstalk_px: 0.45, crosstalk_y_px: 0.35, ..SimulatedBench::FAIR };
    let model = learned_with_validation(&simulated_display(6e-3, crosstalk));
    let [x, y] = model.crosstalk.sigma_px();
    assert!((x / 0.45 - 1.0).abs() < 0.1 && (y / 0.35 - 1.0).abs() < 0.1, "σ {x} and {y} px");
    assert_eq!(Blocks::of(&model).without(Block::FineSource), Blocks::NONE.with(Block::Crosstalk));
}

#[test]
fn blur_of_the_camera_is_found_and_its_width_recovered() {
    let bench = simulated_display(6e-3, SimulatedBench { seed: 5, blur_px: 0.5, ..SimulatedBench::FAIR });
    let model = learned_with_validation(&bench);
    let [x, y] = model.light_blur.sigma_px();
    assert!((x / 0.5 - 1.0).abs() < 0.1 && (y / 0.5 - 1.0).abs() < 0.1, "σ {x} and {y} px");
    assert_eq!(Blocks::of(&model).without(Block::FineSource), Blocks::NONE.with(Block::LightBlur));
    let without = DisplayModel { light_blur: LightBlur::NONE, ..model.clone() };
    let (with, without) = (held_out_loss(&bench, &model), held_out_loss(&bench, &without));
    assert!(with < 0.2 * without, "{with} with the blur, {without} without it");
}

#[test]
fn uneven_surface_is_found_and_recovered() {
    let bench = simulated_display(6e-3, SimulatedBench { seed: 5, surface_waves: 1.5, ..SimulatedBench::FAIR });
    let model = learned_with_validation(&bench);
    assert_eq!(Blocks::of(&model), Blocks::NONE.with(Block::FineSource));
    let difference_rad = |y: usize, x: usize| {
        let (at_x, at_y) = (centre(x, WIDTH_PX), centre(y, HEIGHT_PX));
        model.source.value(at_x, at_y).arg() - bench.surface_rad(y, x)
    };
    let rms_rad = rms_without_tilt(difference_rad, |y, x| bench.source(y, x));
    assert!(rms_rad < 0.1, "{rms_rad} rad");
}

#[test]
fn uneven_response_is_found_and_recovered() {
    let bench = simulated_display(6e-3, SimulatedBench { seed: 5, response_variation: 0.12, ..SimulatedBench::FAIR });
    let model = learned_with_validation(&bench);
    assert_eq!(Blocks::of(&model).without(Block::FineSource), Blocks::NONE.with(Block::UnevenResponse));
    let error = |y: usize, x: usize| {
        let (at_x, at_y) = (centre(x, WIDTH_PX), centre(y, HEIGHT_PX));
        (model.response_variation.value(at_x, at_y) - bench.response_variation(y, x)).powi(2)
    };
    let places = || (0..HEIGHT_PX).flat_map(|y| (0..WIDTH_PX).map(move |x| (y, x)));
    let rms = (places().map(|(y, x)| error(y, x)).sum::<f64>() / (HEIGHT_PX * WIDTH_PX) as f64).sqrt();
    assert!(rms < 0.02, "{rms}");
}

#[test]
fn ghost_is_found_and_recovered() {
    let bench = simulated_display(6e-3, SimulatedBench { seed: 5, ghost_share: 0.04, ..SimulatedBench::FAIR });
    let model = learned_with_validation(&bench);
    assert_eq!(Blocks::of(&model).without(Block::FineSource), Blocks::NONE.with(Block::Ghost));
    // Half of the ghost's light interferes.
    assert!((model.ghost.share() / 0.02 - 1.0).abs() < 0.2, "{:?}", model.ghost);
}

#[test]
fn partial_coherence_is_found_and_recovered() {
    let angle = SimulatedBench { seed: 5, source_angle_mrad: 4.0, ..SimulatedBench::FAIR };
    let model = learned_with_validation(&simulated_display(6e-3, angle));
    assert_eq!(Blocks::of(&model).without(Block::FineSource), Blocks::NONE.with(Block::PartialCoherence));
    // A uniform disc of directions has a standard deviation of a quarter of its diameter along each axis.
    let expected_px = 4e-3 / 4.0 * 6e-3 / 8e-6;
    for spread_px in model.coherence.spread_px() {
        assert!((spread_px / expected_px - 1.0).abs() < 0.1, "{spread_px} px instead of {expected_px} px");
    }
}

#[test]
fn dust_is_found_and_recovered() {
    let bench = simulated_display(6e-3, SimulatedBench { seed: 5, dust_contrast: 0.1, ..SimulatedBench::FAIR });
    let model = learned_with_validation(&bench);
    assert_eq!(Blocks::of(&model).without(Block::FineSource), Blocks::NONE.with(Block::Dust));
    // Smooth parts of the dust belong to the smooth source as well, so both are compared together.
    let learned =
        |y: usize, x: usize| model.source.value(centre(x, WIDTH_PX), centre(y, HEIGHT_PX)) * model.dust.factor(y, x);
    let dust = |y: usize, x: usize| learned(y, x) / bench.source(y, x);
    // The light of the outer pixels mostly leaves the region that is compared.
    let region = RegionOfInterest::middle(&bench.setup().grid());
    let seen = |y: usize, x: usize| region.columns(y).is_some_and(|columns| columns.contains(&x));
    let lit = || (0..HEIGHT_PX * WIDTH_PX).map(|i| (i / WIDTH_PX, i % WIDTH_PX)).filter(|&(y, x)| seen(y, x));
    let rms = |of: &dyn Fn(usize, usize) -> f64| {
        let mean = lit().map(|(y, x)| of(y, x)).sum::<f64>() / lit().count() as f64;
        (lit().map(|(y, x)| (of(y, x) - mean).powi(2)).sum::<f64>() / lit().count() as f64).sqrt()
    };
    let amplitude = rms(&|y, x| (dust(y, x) / bench.dust(y, x)).norm().ln());
    let phase_rad =
        rms_without_tilt(|y, x| (dust(y, x) / bench.dust(y, x)).arg(), |y, x| f64::from(u8::from(seen(y, x))));
    assert!(
        rms(&|y, x| bench.dust(y, x).norm().ln()) > 0.05 && amplitude < 0.03 && phase_rad < 0.03,
        "{amplitude}, {phase_rad}"
    );
}

#[test]
fn display_without_flaws_of_blocks_gets_none() {
    let perfect = SimulatedBench { seed: 5, strength: 0.0, ..SimulatedBench::FAIR };
    let model = learned_with_validation(&simulated_display(6e-3, perfect));
    assert_eq!((Blocks::of(&model), model.source.order), (Blocks::NONE, 4));
    let usual = learned_with_validation(&bench(5));
    assert_eq!(Blocks::of(&usual).without(Block::FineSource), Blocks::NONE);
    // Without validation pairs there is no choice.
    let bench = simulated_display(6e-3, SimulatedBench { seed: 5, crosstalk_px: 0.45, ..SimulatedBench::FAIR });
    let training = pairs(&bench, 6, 100);
    let alone = learned(&bench, options(&bench, Some(5)), LearningPairs::training_only(&training)).model();
    assert_eq!(Blocks::of(&alone), Blocks::NONE);
}

/// Position of a pixel's centre on [−1, 1].
fn centre(i: usize, n: usize) -> f64 {
    (2 * i + 1) as f64 / n as f64 - 1.0
}

/// Root mean square of a phase over the lit pixels without its mean and its tilt, which the kernel's tilt replaces. The
/// phase is unwrapped along rows and along the first column.
fn rms_without_tilt(phase: impl Fn(usize, usize) -> f64, amplitude: impl Fn(usize, usize) -> f64) -> f64 {
    let near = |phase: f64, to: f64| phase - ((phase - to) / TAU).round() * TAU;
    let mut unwrapped = vec![vec![0.0; WIDTH_PX]; HEIGHT_PX];
    for y in 0..HEIGHT_PX {
        for x in 0..WIDTH_PX {
            let before = if x > 0 { unwrapped[y][x - 1] } else { unwrapped[y.saturating_sub(1)][0] };
            unwrapped[y][x] = near(phase(y, x), before);
        }
    }
    let places: Vec<(usize, usize)> = (0..HEIGHT_PX)
        .flat_map(|y| (0..WIDTH_PX).map(move |x| (y, x)))
        .filter(|&(y, x)| amplitude(y, x) > 0.3)
        .collect();
    // Gauss and Seidel's method for the plane that fits best.
    let mut plane = [0.0; 3];
    let terms = |y: usize, x: usize| [1.0, centre(x, WIDTH_PX), centre(y, HEIGHT_PX)];
    let rest = |plane: &[f64; 3], y: usize, x: usize| {
        unwrapped[y][x] - terms(y, x).iter().zip(plane).map(|(t, c)| t * c).sum::<f64>()
    };
    for i in (0..60).map(|round| round % 3) {
        let product: f64 = places.iter().map(|&(y, x)| rest(&plane, y, x) * terms(y, x)[i]).sum();
        plane[i] += product / places.iter().map(|&(y, x)| terms(y, x)[i].powi(2)).sum::<f64>();
    }
    (places.iter().map(|&(y, x)| rest(&plane, y, x).powi(2)).sum::<f64>() / places.len() as f64).sqrt()
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
        let LearnState::Parametric(mut state) = learner.state().into_owned() else { panic!("a smooth model") };
        assert_eq!(state.kept, [0, 1, 2, 4, 5, 6, 7, 8, 9]);
        // As if two good photographs had resembled their holograms too little.
        state.kept.retain(|&index| index != 1 && index != 6);
        let mut learner = Learner::resume(bench.setup(), options, LearnState::Parametric(state)).unwrap();
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

#[test]
fn learning_does_not_depend_on_threads_or_pauses() {
    let flaws =
        SimulatedBench { crosstalk_px: 0.4, surface_waves: 1.0, response_variation: 0.1, ..SimulatedBench::FAIR };
    let first = simulated_display(
        6e-3,
        SimulatedBench { seed: 10, dust_contrast: 0.2, ghost_share: 0.04, blur_px: 0.6, ..flaws },
    );
    let all = bench_of_all_orders(10);
    for (bench, model, refinement_evaluations) in
        [(&first, KernelModel::Display, 8), (&first, KernelModel::Varying, 4), (&all, KernelModel::Display, 3)]
    {
        let (training, validation) = (pairs(bench, 5, 100), pairs(bench, 2, 400));
        let learning_pairs = LearningPairs { training: &training, validation: &validation };
        let options = LearnOptions { model, refinement_evaluations, epochs: 2, ..options(bench, None) };
        let on = |threads: usize| {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| learned(bench, options.clone(), learning_pairs).model())
        };
        let one = on(1);
        assert_eq!(one, on(2));
        assert_eq!(one, on(8));

        let mut learner = Learner::start(bench.setup(), options.clone(), &training).unwrap();
        while learner.step(learning_pairs).unwrap().is_some() {
            learner = Learner::resume(bench.setup(), options.clone(), learner.state().into_owned()).unwrap();
        }
        assert_eq!(one, learner.model());
    }
}

/// Pairs at several distances, one list for each distance.
struct PairsOnRail(Vec<Vec<Pair>>);

impl PairSource for PairsOnRail {
    fn len(&self) -> usize {
        self.0.iter().map(Vec::len).sum()
    }

    fn plane(&self, index: usize) -> usize {
        index / self.0[0].len()
    }

    fn pair(&self, index: usize) -> Result<Pair, BoxError> {
        Ok(self.0[self.plane(index)][index % self.0[0].len()].clone())
    }
}

const RAIL_M: [f64; 3] = [5e-3, 6e-3, 7e-3];

fn pairs_on_rail(count: u64, seed: u64) -> PairsOnRail {
    let at = |(plane, &distance_m): (usize, &f64)| pairs(&bench_on_a_rail(distance_m), count, seed + 50 * plane as u64);
    PairsOnRail(RAIL_M.iter().enumerate().map(at).collect())
}

fn learned_on_rail(options: LearnOptions, learning_pairs: LearningPairs<'_>) -> Vec<DisplayModel> {
    let setups = RAIL_M.map(|distance_m| bench_on_a_rail(distance_m).setup());
    let mut learner = Learner::start_joint(&setups, options, learning_pairs.training).unwrap();
    while learner.step(learning_pairs).unwrap().is_some() {}
    learner.models()
}

#[test]
fn interpolated_display_is_nearly_as_good_as_learned_display() {
    let training = pairs_on_rail(6, 100);
    let models = learned_on_rail(options(&bench_on_a_rail(6e-3), Some(5)), LearningPairs::training_only(&training));
    for distance_m in [5.4e-3, 6.6e-3] {
        let bench = bench_on_a_rail(distance_m);
        let own_pairs = pairs(&bench, 6, 100);
        let learned_there = held_out_loss(
            &bench,
            &learned(&bench, options(&bench, Some(5)), LearningPairs::training_only(&own_pairs)).model(),
        );
        let between = held_out_loss(&bench, &interpolated(&models, bench.setup()).unwrap());
        let ideal = held_out_loss(&bench, &DisplayModel::ideal(bench.setup()));
        // The kernel learned at the nearest photographed distance, less than half a millimetre away.
        let nearest = models.iter().min_by(|a, b| {
            let distance = |model: &DisplayModel| (model.setup.distance_m() - distance_m).abs();
            distance(a).total_cmp(&distance(b))
        });
        let nearest = held_out_loss(&bench, &DisplayModel { setup: bench.setup(), ..nearest.unwrap().clone() });
        assert!(between < 1.2 * learned_there && between < 0.03 * ideal && between < 0.5 * nearest, "{between}");
    }
}

#[test]
fn display_at_several_distances_gets_its_blocks() {
    let at = |distance_m: f64| {
        simulated_display(distance_m, SimulatedBench { seed: 11, crosstalk_px: 0.45, ..SimulatedBench::FAIR })
    };
    let taken = |count: u64, seed: u64| {
        let planes = RAIL_M.iter().enumerate();
        PairsOnRail(planes.map(|(plane, &z_m)| pairs(&at(z_m), count, seed + 50 * plane as u64)).collect())
    };
    let (training, validation) = (taken(4, 100), taken(1, 400));
    let learning_pairs = LearningPairs { training: &training, validation: &validation };
    let models = learned_on_rail(options(&at(6e-3), Some(5)), learning_pairs);
    for model in &models {
        assert_eq!(Blocks::of(model), Blocks::NONE.with(Block::Crosstalk));
        assert!((model.crosstalk.sigma_px()[0] / 0.45 - 1.0).abs() < 0.1, "{:?}", model.crosstalk);
    }
    assert_eq!(interpolated(&models, at(5.5e-3).setup()).unwrap().crosstalk, models[0].crosstalk);
}

#[test]
fn joint_learning_does_not_depend_on_threads_or_pauses() {
    let (training, validation) = (pairs_on_rail(3, 100), pairs_on_rail(1, 400));
    let learning_pairs = LearningPairs { training: &training, validation: &validation };
    let setups = RAIL_M.map(|distance_m| bench_on_a_rail(distance_m).setup());
    let short = || LearnOptions { refinement_evaluations: 6, epochs: 1, ..options(&bench_on_a_rail(6e-3), None) };
    let on = |threads: usize| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| learned_on_rail(short(), learning_pairs))
    };
    let one = on(1);
    assert_eq!(one, on(3));
    let mut learner = Learner::start_joint(&setups, short(), &training).unwrap();
    while learner.step(learning_pairs).unwrap().is_some() {
        learner = Learner::resume_joint(&setups, short(), learner.state().into_owned()).unwrap();
    }
    assert_eq!(one, learner.models());
}

#[test]
fn joint_learning_refuses_setups_that_differ_in_more_than_distance() {
    let training = pairs_on_rail(1, 100);
    let [near, middle, far] = RAIL_M.map(|distance_m| bench_on_a_rail(distance_m).setup());
    let refused = |setups: &[OpticalSetup], model| {
        let options = LearnOptions { model, ..options(&bench_on_a_rail(6e-3), Some(5)) };
        Learner::start_joint(setups, options, &training).unwrap_err().to_string()
    };
    let display = KernelModel::Display;
    assert!(refused(&[near, middle, near], display).contains("each distance may occur only once"));
    let red = OpticalSetup::try_new(near.grid(), 640e-9, 8e-3).unwrap();
    assert!(refused(&[near, middle, red], display).contains("grid and wavelength must be the same"));
    assert!(refused(&[near, middle, far], KernelModel::Dense).contains("only the models smooth and display"));
    let more = OpticalSetup::try_new(near.grid(), 515e-9, 8e-3).unwrap();
    assert!(refused(&[near, middle, far, more], display).contains("pairs is empty"));
}
