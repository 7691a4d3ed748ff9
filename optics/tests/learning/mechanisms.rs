//! Mechanisms of a display are found, and what is learned of them is what the display has.

use super::{HEIGHT_PX, WIDTH_PX, bench, held_out_loss, learned, options, pairs, simulated_display};
use lightpath_bench::{SimulatedBench, SimulatedDisplay};
use lightpath_optics::learning::{Block, Blocks, LearningPairs};
use lightpath_optics::{DisplayModel, LightBlur, RegionOfInterest};
use std::f64::consts::TAU;

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
    let angle = SimulatedBench { seed: 5, source_angle_rad: 4e-3, ..SimulatedBench::FAIR };
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
