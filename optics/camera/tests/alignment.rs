//! Alignment by pairs on simulated displays whose surface bends the light.
#![allow(clippy::unwrap_used)]

use lightpath_bench::{SimulatedBench, SimulatedDisplay, TestCard};
use lightpath_camera::alignment::{Homography, Registration, warp};
use lightpath_optics::hologram::{HologramMethod, HologramOptions, ImagePlane, Loss, initial_phase};
use lightpath_optics::numerics::tiles::Tiles;
use lightpath_optics::{
    Detector, DisplayModel, Engine, Grid, HologramProblem, OpticalSetup, Optimization, Plane, RegionOfInterest,
};
use std::f64::consts::TAU;

const HEIGHT_PX: usize = 360;
const WIDTH_PX: usize = 640;
/// As many pairs as an alignment uses.
const PAIRS: usize = 8;

/// Holograms for the ideal display, with the light that it would make of them. Half of them start from a random phase.
struct Holograms {
    setup: OpticalSetup,
    region: RegionOfInterest,
    shown: Vec<(Plane<f32>, Plane<f32>)>,
}

impl Holograms {
    fn optimized() -> Self {
        let grid = Grid::try_new(HEIGHT_PX, WIDTH_PX, 8e-6).unwrap();
        let (setup, _) = OpticalSetup::try_new(grid, 515e-9, 0.08).unwrap().planned().unwrap();
        let engine = Engine::new(&DisplayModel::ideal(setup), Detector::Pixel, None).unwrap();
        let region = RegionOfInterest::middle(&grid);
        let one = |n: usize| {
            let target = TestCard::ALL[n].render(HEIGHT_PX, WIDTH_PX, n as u64).unwrap();
            let plane = ImagePlane { engine: engine.clone(), target, weight: None, share: 1.0 };
            let problem = HologramProblem::with_planes(vec![plane], 1, region, Loss::default()).unwrap();
            let start = initial_phase(HEIGHT_PX, WIDTH_PX, if n.is_multiple_of(2) { 1.0 } else { TAU }, 1).unwrap();
            let options = HologramOptions::new(HologramMethod::Lbfgs, 30);
            let mut optimization = Optimization::start(problem, options, start.into_vec()).unwrap();
            while optimization.step().is_some() {}
            let phase = Plane::try_from_vec(HEIGHT_PX, WIDTH_PX, optimization.phases().to_vec()).unwrap();
            let light = engine.light(&phase).unwrap();
            (phase, light)
        };
        Self { setup, region, shown: (0..PAIRS).map(one).collect() }
    }

    /// The registration of the bench's photographs, and the shift and the turn that it finds in some rounds.
    fn registered(&self, bench: SimulatedBench) -> (Registration, Homography) {
        let display = SimulatedDisplay::draw(self.setup, None, bench).unwrap();
        let photos: Vec<Plane<f32>> = (0..)
            .zip(&self.shown)
            .map(|(seed, (phase, _))| display.capture(phase, seed).unwrap().map(|level| f32::from(level) / 255.0))
            .collect();
        let register = |camera: &Homography| {
            let mut tiles = Tiles::cover(self.region).unwrap();
            for ((_, expected), photo) in self.shown.iter().zip(&photos) {
                tiles.add(expected, &warp(photo, camera, HEIGHT_PX, WIDTH_PX, 0.999, 1.0), 0.999);
            }
            Registration::of(&tiles, self.region).unwrap()
        };
        let first = register(&Homography::IDENTITY);
        let mut camera = first.rigid;
        for _ in 0..3 {
            camera = camera.after(&register(&camera).rigid);
        }
        (first, camera)
    }
}

/// Root mean square displacement over the region by a turn.
fn turn_px(region: RegionOfInterest, angle_rad: f64) -> f64 {
    let [along_x, along_y] = [region.width_px(), region.height_px()].map(|side| side as f64 / 2.0 / 3.0_f64.sqrt());
    angle_rad * along_x.hypot(along_y)
}

#[test]
fn uneven_surface_is_no_turn_and_turned_camera_is_turned_back() {
    let holograms = Holograms::optimized();
    let region = holograms.region;
    let uneven =
        SimulatedBench { crosstalk_px: 0.45, crosstalk_y_px: 0.35, surface_waves: 1.5, ..SimulatedBench::FAIR };
    for seed in 1..=2 {
        for rotation_rad in [0.0, 8.7e-3] {
            let (first, camera) = holograms.registered(SimulatedBench { seed, rotation_rad, ..uneven });
            // A camera that turns one way sees the image turn the other way.
            let truth = -turn_px(region, rotation_rad);
            let [cosine, _, _, sine, ..] = camera.entries();
            let error = (turn_px(region, sine.atan2(cosine)) - truth).abs();
            assert!(error < 0.1, "seed {seed}, {rotation_rad} rad: {error} px off; {first:?}");
            let is_clear = first.turn_px.abs() > first.turn_uncertainty_px;
            assert_eq!(is_clear, rotation_rad != 0.0, "seed {seed}, {rotation_rad} rad: {first:?}");
            assert!(first.stretch_px > 0.3, "the surface displaces the image: {first:?}");
        }
    }
    // Where the surface bends so much that many tiles have several images, the turn is uncertain, and not taken for the
    // camera's.
    let (first, _) = holograms.registered(SimulatedBench { seed: 4, ..uneven });
    assert!(first.turn_px.abs() < first.turn_uncertainty_px, "{first:?}");
}
