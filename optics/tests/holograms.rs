//! How well holograms show test cards: by each method, on cameras with small pixels, and through light that blurs.
#![allow(clippy::unwrap_used)]

use lightpath_bench::TestCard;
use lightpath_optics::hologram::{HologramOptions, ShownLight, initial_phase, quality};
use lightpath_optics::{
    Detector, DisplayModel, Engine, Grid, HologramMethod, HologramProblem, InitialPhase, LightBlur, OpticalSetup,
    Optimization, Plane, RegionOfInterest,
};
use rayon::ThreadPoolBuilder;

const ADAM: HologramMethod = HologramMethod::Adam { learning_rate: 0.1 };

/// PSNR of a hologram of a card after some steps.
fn psnr_db(method: HologramMethod, detector: Detector, iterations: u32) -> f64 {
    let grid = Grid::try_new(90, 128, 8e-6).unwrap();
    let setup = OpticalSetup::try_new(grid, 515e-9, 12e-3).unwrap();
    let engine = Engine::new(&DisplayModel::ideal(setup), detector, None).unwrap();
    let target = TestCard::Portrait.render(90, 128, 3).unwrap();
    let problem = HologramProblem::new(engine, target, RegionOfInterest::middle(&grid)).unwrap();
    let start = InitialPhase::Random { range_rad: 1.0 }.phases(&problem, &setup, 1).unwrap();
    let mut optimization = Optimization::start(problem, HologramOptions::new(method, iterations), start).unwrap();
    while optimization.step().is_some() {}
    let phases = optimization.phases().to_vec();
    -10.0 * optimization.measure(&phases).unwrap().best_loss.log10()
}

#[test]
fn methods_reach_expected_quality() {
    let one_step = psnr_db(ADAM, Detector::Point, 1);
    let [adam, lbfgs, gs, wgs] =
        [ADAM, HologramMethod::Lbfgs, HologramMethod::GerchbergSaxton, HologramMethod::WeightedGerchbergSaxton]
            .map(|method| psnr_db(method, Detector::Point, 60));
    assert!(gs > 14.0 && gs > one_step + 5.0, "gs {gs} dB, after one step {one_step} dB");
    assert!(wgs > gs, "wgs {wgs} dB, gs {gs} dB");
    assert!(adam > gs && lbfgs > adam + 3.0, "adam {adam} dB, lbfgs {lbfgs} dB");
}

#[test]
fn lbfgs_beats_adam_with_every_detector() {
    for detector in Detector::ALL {
        let (adam, lbfgs) = (psnr_db(ADAM, detector, 60), psnr_db(HologramMethod::Lbfgs, detector, 60));
        assert!(lbfgs > adam, "{detector:?}: adam {adam} dB, lbfgs {lbfgs} dB");
    }
}

/// Runs all steps and returns the phase.
fn finished(mut optimization: Optimization, grid: Grid) -> Plane<f32> {
    while optimization.step().is_some() {}
    Plane::try_from_vec(grid.height_px(), grid.width_px(), optimization.phases().to_vec()).unwrap()
}

#[test]
fn holograms_are_optimized_for_what_the_camera_sees() {
    let grid = Grid::try_new(64, 96, 8e-6).unwrap();
    let (setup, _) = OpticalSetup::try_new(grid, 515e-9, 15e-3).unwrap().planned().unwrap();
    let (target, region) = (TestCard::Portrait.render(64, 96, 3).unwrap(), RegionOfInterest::middle(&grid));
    let engine = |part: f64| {
        let model = DisplayModel::ideal(setup.with_camera_fill_factor(part).unwrap());
        Engine::new(&model, Detector::Pixel, None).unwrap()
    };
    let seen_by_small_pixels = |optimized_for: f64| {
        let problem = HologramProblem::new(engine(optimized_for), target.clone(), region).unwrap();
        let start = initial_phase(64, 96, 0.5, 4).unwrap().into_vec();
        let options = HologramOptions::new(HologramMethod::Lbfgs, 40);
        let phase = finished(Optimization::start(problem, options, start).unwrap(), grid);
        let shown = ShownLight::of_frames(&engine(0.5), &[phase]).unwrap();
        shown.quality((&target, region).into()).unwrap().pixel.psnr_db
    };
    let (for_small, for_whole) = (seen_by_small_pixels(0.5), seen_by_small_pixels(1.0));
    assert!(for_small > for_whole + 3.0, "{for_small} {for_whole}");
}

#[test]
fn holograms_through_a_blur_are_sharper_and_do_not_depend_on_threads() {
    let grid = Grid::try_new(90, 128, 8e-6).unwrap();
    let setup = OpticalSetup::try_new(grid, 515e-9, 12e-3).unwrap();
    let (target, region) = (TestCard::Spheres.render(90, 128, 3).unwrap(), RegionOfInterest::middle(&grid));
    let sharp = DisplayModel::ideal(setup);
    let blurred = DisplayModel { light_blur: LightBlur::of_sigma_px([0.9, 0.6]), ..sharp.clone() };
    let [sharp, blurred] = [sharp, blurred].map(|model| Engine::new(&model, Detector::Pixel, None).unwrap());
    let run = |engine: &Engine, method: HologramMethod, threads: usize| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let problem = HologramProblem::new(engine.clone(), target.clone(), region).unwrap();
            let start = InitialPhase::Random { range_rad: 1.0 }.phases(&problem, &setup, 1).unwrap();
            finished(Optimization::start(problem, HologramOptions::new(method, 60), start).unwrap(), grid)
        })
    };
    let photographed_db = |phase: &Plane<f32>| quality(&blurred, phase, &target, region).unwrap().pixel.psnr_db;
    for method in
        [ADAM, HologramMethod::Lbfgs, HologramMethod::GerchbergSaxton, HologramMethod::WeightedGerchbergSaxton]
    {
        let through = run(&blurred, method, 2);
        let (with, without) = (photographed_db(&through), photographed_db(&run(&sharp, method, 2)));
        assert!(with > without + 0.5, "{method:?}: {with} dB through the blur, {without} dB without it");
        assert_eq!(through, run(&blurred, method, 8), "{method:?}");
    }
}
