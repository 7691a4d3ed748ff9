//! Tests of all optimization methods: each approaches its targets, and the results have the same bits on any number of
//! threads and after any interruption.

use super::*;
use crate::display::phase_response::PhaseResponse;
use crate::display::{Carrier, Detector, DisplayModel, OpticalSetup};
use crate::engine::Engine;
use crate::hologram::initial::InitialPhase;
use crate::hologram::loss::{ImagePlane, Loss};
use crate::hologram::quality::quality;
use crate::hologram::rounded::Levels;
use crate::hologram::shown_light::light_of_frames;
use crate::numerics::{Grid, RegionOfInterest};
use crate::pictures_of_tests::picture;
use rayon::ThreadPoolBuilder;

const HEIGHT_PX: usize = 90;
const WIDTH_PX: usize = 128;

fn grid() -> Grid {
    Grid::try_new(HEIGHT_PX, WIDTH_PX, 8e-6).unwrap()
}

fn setup(distance_m: f64) -> OpticalSetup {
    OpticalSetup::try_new(grid(), 515e-9, distance_m).unwrap()
}

fn plane(distance_m: f64, detector: Detector, seed: u64) -> ImagePlane {
    let engine = Engine::new(&DisplayModel::ideal(setup(distance_m)), detector, None).unwrap();
    ImagePlane::new(engine, picture(HEIGHT_PX, WIDTH_PX, seed))
}

fn problem(detector: Detector, planes: usize, frames: usize) -> HologramProblem {
    let planes = (0..planes).map(|p| plane(12e-3 + 8e-3 * p as f64, detector, p as u64)).collect();
    HologramProblem::with_planes(planes, frames, RegionOfInterest::middle(&grid()), Loss::default()).unwrap()
}

fn start(problem: HologramProblem, options: HologramOptions) -> Optimization {
    let initial = InitialPhase::Random { range_rad: 1.0 };
    let phases = initial.phases(&problem, &setup(12e-3), 1).unwrap();
    Optimization::start(problem, options, phases).unwrap()
}

/// Runs all steps and returns the loss of the phases at the best gain, with the optimization.
fn finished(mut optimization: Optimization) -> (f64, Optimization) {
    while optimization.step().is_some() {}
    let phases = optimization.phases().to_vec();
    (optimization.measure(&phases).unwrap().best_loss, optimization)
}

const ADAM: HologramMethod = HologramMethod::Adam { learning_rate: 0.1 };
const ALL: [HologramMethod; 5] = [
    ADAM,
    HologramMethod::Lbfgs,
    HologramMethod::GerchbergSaxton,
    HologramMethod::WeightedGerchbergSaxton,
    HologramMethod::DoublePhase,
];

/// Levels of a display with `bit_depth` bits. Tests choose few bits, so that rounding matters.
fn coarse(bit_depth: u32) -> Levels {
    Levels::new(PhaseResponse::linear(bit_depth).unwrap(), Some(Carrier::HalfOrderX)).unwrap()
}

#[test]
fn phases_do_not_depend_on_threads_or_interruptions() {
    let runs = ALL.iter().map(|&method| HologramOptions::new(method, 9));
    let with_levels = [ADAM, HologramMethod::Lbfgs]
        .map(|method| HologramOptions { levels: Some(coarse(5)), ..HologramOptions::new(method, 9) });
    for options in runs.chain(with_levels) {
        for (planes, frames) in [(1, 1), (2, 2)] {
            let run = |threads: usize, stops: &[u32]| {
                let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| {
                    let mut optimization = start(problem(Detector::Pixel, planes, frames), options.clone());
                    while let Some(step) = optimization.step() {
                        if stops.contains(&step.iteration) {
                            let state = optimization.state().clone();
                            let again = problem(Detector::Pixel, planes, frames);
                            optimization = Optimization::resume(again, options.clone(), state).unwrap();
                        }
                    }
                    optimization.phases().iter().map(|phase| phase.to_bits()).collect::<Vec<_>>()
                })
            };
            let whole = run(1, &[]);
            for (threads, stops) in [(2, &[1][..]), (8, &[2, 5, 6, 7, 8])] {
                let name = format!("{:?}, {planes} planes, {frames} frames", options.method);
                assert!(run(threads, stops) == whole, "{name}: {threads} threads, stopped at {stops:?}");
            }
        }
    }
}

#[test]
fn state_of_another_optimization_is_refused() {
    let mut adam = start(problem(Detector::Point, 1, 1), HologramOptions::new(ADAM, 3));
    adam.step();
    let state = adam.state().clone();
    for options in [HologramMethod::Lbfgs, HologramMethod::GerchbergSaxton, HologramMethod::DoublePhase]
        .map(|method| HologramOptions::new(method, 3))
    {
        let refused = Optimization::resume(problem(Detector::Point, 1, 1), options, state.clone());
        assert!(refused.unwrap_err().to_string().starts_with("state is"));
    }
    let larger = Optimization::resume(problem(Detector::Point, 1, 2), HologramOptions::new(ADAM, 3), state.clone());
    assert!(larger.is_err());
    let mut cut = state;
    let Run::Adam(adam) = &mut cut.run else { panic!("expected a state of Adam") };
    adam.first_moment.pop();
    assert!(Optimization::resume(problem(Detector::Point, 1, 1), HologramOptions::new(ADAM, 3), cut).is_err());
}

#[test]
fn hologram_of_several_planes_shows_each_plane() {
    let mut both = start(problem(Detector::Pixel, 2, 1), HologramOptions::new(HologramMethod::Lbfgs, 60));
    while both.step().is_some() {}
    let mut first = start(problem(Detector::Pixel, 1, 1), HologramOptions::new(HologramMethod::Lbfgs, 60));
    while first.step().is_some() {}
    let far = plane(20e-3, Detector::Pixel, 1);
    let psnr_db = |phases: &[f32]| {
        let phase = Plane::try_from_vec(HEIGHT_PX, WIDTH_PX, phases.to_vec()).unwrap();
        quality(&far.engine, &phase, &far.target, RegionOfInterest::middle(&grid())).unwrap().pixel.psnr_db
    };
    let (with, without) = (psnr_db(both.phases()), psnr_db(first.phases()));
    assert!(with > without + 5.0, "{with} dB against {without} dB");
}

#[test]
fn frames_average_their_light() {
    let run = |frames| {
        let problem = problem(Detector::Supersampled, 1, frames);
        let phases = InitialPhase::Random { range_rad: 6.0 }.phases(&problem, &setup(12e-3), 1).unwrap();
        finished(Optimization::start(problem, HologramOptions::new(HologramMethod::Lbfgs, 40), phases).unwrap())
    };
    let ((one, _), (four, optimization)) = (run(1), run(4));
    assert!(four < one / 2.0, "{four} with four frames, {one} with one");
    // The mean light of the frames is compared with a sum over single frames.
    let shown = plane(12e-3, Detector::Pixel, 0);
    let frames = optimization.phases().chunks_exact(HEIGHT_PX * WIDTH_PX);
    let frames: Vec<_> =
        frames.map(|phase| Plane::try_from_vec(HEIGHT_PX, WIDTH_PX, phase.to_vec()).unwrap()).collect();
    let mean = light_of_frames(&shown.engine, &frames).unwrap();
    let by_hand: f32 = frames.iter().map(|phase| shown.engine.light(phase).unwrap().at(40, 60)).sum::<f32>() / 4.0;
    assert!((mean.at(40, 60) - by_hand).abs() < 1e-6 * by_hand.abs());
}

/// The phases that a display with these levels shows.
fn rounded(levels: &Levels, phases: &[f32]) -> Vec<f32> {
    let mut shown = vec![0.0; phases.len()];
    for (y, (shown, phase)) in shown.chunks_exact_mut(WIDTH_PX).zip(phases.chunks_exact(WIDTH_PX)).enumerate() {
        levels.show_row(y, phase, shown);
    }
    shown
}

/// With many levels the error of rounding is small, and steps are worth more without it.
#[test]
fn optimizing_through_levels_is_not_worse_than_rounding() {
    for (method, bit_depth, iterations, distance_m) in [
        (HologramMethod::Lbfgs, 8, 20, 12e-3),
        (HologramMethod::Lbfgs, 8, 60, 12e-3),
        (HologramMethod::Lbfgs, 8, 60, 30e-3),
        (HologramMethod::Lbfgs, 8, 200, 30e-3),
        (HologramMethod::Lbfgs, 6, 40, 12e-3),
        (HologramMethod::Lbfgs, 6, 80, 20e-3),
        (ADAM, 8, 60, 12e-3),
    ] {
        let levels = coarse(bit_depth);
        let shown_loss = |aware: bool| {
            let options =
                HologramOptions { levels: aware.then(|| levels.clone()), ..HologramOptions::new(method, iterations) };
            let problem = || {
                HologramProblem::with_planes(
                    vec![plane(distance_m, Detector::Pixel, 5)],
                    1,
                    RegionOfInterest::middle(&grid()),
                    Loss::default(),
                )
            };
            let (_, found) = finished(start(problem().unwrap(), options));
            problem().unwrap().measure(&rounded(&levels, found.phases()), 1.0).best_loss
        };
        let (plain, aware) = (shown_loss(false), shown_loss(true));
        assert!(aware < 1.02 * plain, "{method:?}, {bit_depth} bits, {iterations} steps: {aware} against {plain}");
    }
}

#[test]
fn optimizing_through_levels_loses_less_than_rounding() {
    let options = HologramOptions::new(HologramMethod::Lbfgs, 90);
    let (free, plain) = finished(start(problem(Detector::Point, 1, 1), options.clone()));
    for bit_depth in [4, 6] {
        let levels = coarse(bit_depth);
        let naive = problem(Detector::Point, 1, 1).measure(&rounded(&levels, plain.phases()), 1.0).best_loss;
        let aware = HologramOptions { levels: Some(levels.clone()), ..options.clone() };
        let (aware, found) = finished(start(problem(Detector::Point, 1, 1), aware));
        assert!(aware < 0.8 * naive, "{bit_depth} bits: {aware} against {naive}, free {free}");
        // Rounding the phases to the display's levels again does not change them.
        let again = rounded(&levels, found.phases());
        assert!(found.phases().iter().zip(&again).all(|(a, b)| (a - b).abs() < 1e-4));
    }
}

#[test]
fn initial_phases_match_their_definitions() {
    let problem = problem(Detector::Point, 1, 2);
    let setup = setup(12e-3);
    let phases = |initial: InitialPhase| initial.phases(&problem, &setup, 5).unwrap();
    let random = phases(InitialPhase::Random { range_rad: 2.0 });
    let (one, other) = random.split_at(HEIGHT_PX * WIDTH_PX);
    assert!(random.iter().all(|phase| (0.0..2.0).contains(phase)) && one != other);
    assert!(phases(InitialPhase::Constant { phase_rad: 1.5 }).iter().all(|&phase| phase == 1.5));
    let lens = phases(InitialPhase::Quadratic { focal_length_m: Some(0.01) });
    let at = |y: usize, x: usize| f64::from(lens[y * WIDTH_PX + x]);
    // Expected difference −π (r₁² − r₀²) / (λ f) between neighbours at 0.5 px and 1.5 px from the middle.
    let expected = -std::f64::consts::PI * (8e-6_f64).powi(2) * (1.5_f64.powi(2) - 0.5_f64.powi(2)) / (515e-9 * 0.01);
    let found = at(45, 65) - at(45, 64);
    assert!((found - expected).sin().abs() < 1e-5, "{found} {expected}");
    // Back-propagating the target gives a lower loss than random phases.
    let loss = |initial: Vec<f32>| {
        let mut problem = self::problem(Detector::Point, 1, 2);
        problem.measure(&initial, 1.0).best_loss
    };
    let back = loss(phases(InitialPhase::BackPropagated { range_rad: 0.0 }));
    assert!(back < 0.7 * loss(phases(InitialPhase::Random { range_rad: 6.0 })), "{back}");
    let given = Plane::from_fn(2 * HEIGHT_PX, WIDTH_PX, |y, x| (y + x) as f32);
    assert_eq!(phases(InitialPhase::Given(given.clone())), given.values());
    for bad in [
        InitialPhase::Random { range_rad: 7.0 },
        InitialPhase::Constant { phase_rad: f64::NAN },
        InitialPhase::Quadratic { focal_length_m: Some(0.0) },
        InitialPhase::Given(Plane::filled(HEIGHT_PX, WIDTH_PX, 0.0)),
        InitialPhase::Given(Plane::filled(2 * HEIGHT_PX, WIDTH_PX, f32::NAN)),
    ] {
        assert!(bad.phases(&problem, &setup, 5).is_err(), "{bad:?}");
    }
}

#[test]
fn invalid_options_are_refused() {
    let refused = |options: HologramOptions| {
        let problem = problem(Detector::Point, 1, 1);
        let phases = vec![0.0; problem.parameters()];
        Optimization::start(problem, options, phases).unwrap_err().to_string()
    };
    assert!(
        refused(HologramOptions::new(HologramMethod::Adam { learning_rate: 0.0 }, 1)).starts_with("learning_rate is 0")
    );
    let levels = Some(coarse(8));
    assert!(
        refused(HologramOptions { levels, ..HologramOptions::new(HologramMethod::DoublePhase, 1) })
            .contains("adam and lbfgs")
    );
    let short = Optimization::start(problem(Detector::Point, 1, 1), HologramOptions::new(ADAM, 1), vec![0.0; 5]);
    assert!(short.is_err());
}

#[test]
fn the_preview_is_the_light_of_the_evaluated_phases() {
    for (method, detector, frames) in [
        (HologramMethod::Lbfgs, Detector::Pixel, 1),
        (HologramMethod::Lbfgs, Detector::Supersampled, 1),
        (HologramMethod::GerchbergSaxton, Detector::Pixel, 1),
        (ADAM, Detector::Pixel, 2),
    ] {
        let mut optimization = start(problem(detector, 2, frames), HologramOptions::new(method, 3));
        let phases = optimization.phases().to_vec();
        optimization.step();
        assert_previews(&mut optimization, detector, &phases);
    }
}

/// A method that keeps no light computes it for the preview, and goes on as if nobody had looked.
#[test]
fn the_preview_of_a_method_without_light_changes_nothing() {
    let begin = || start(problem(Detector::Pixel, 2, 1), HologramOptions::new(ADAM, 3));
    let (mut watched, mut alone) = (begin(), begin());
    for _ in 0..3 {
        let phases = watched.phases().to_vec();
        assert_previews(&mut watched, Detector::Pixel, &phases);
        watched.step();
        alone.step();
        assert_eq!(watched.phases(), alone.phases());
    }
}

/// Checks that the preview is the light of `phases`.
fn assert_previews(optimization: &mut Optimization, detector: Detector, phases: &[f32]) {
    let phases: Vec<Plane<f32>> = phases
        .chunks_exact(HEIGHT_PX * WIDTH_PX)
        .map(|phase| Plane::try_from_vec(HEIGHT_PX, WIDTH_PX, phase.to_vec()).unwrap())
        .collect();
    let shown = optimization.light_preview(1000);
    let wanted = light_of_frames(&plane(12e-3, detector, 0).engine, &phases).unwrap();
    let difference: f32 = shown.values().iter().zip(wanted.values()).map(|(a, b)| (a - b).powi(2)).sum();
    let size: f32 = wanted.values().iter().map(|light| light.powi(2)).sum();
    assert!(difference < 1e-8 * size, "{difference} of {size}");
    let small = optimization.light_preview(32);
    assert_eq!((small.height_px(), small.width_px()), (23, 32));
}
