//! A simulated lab: a display with a camera, and the mistakes of the person who takes the photographs.

use super::camera_mistakes::{overexposed, rotated_and_shifted};
use super::options::{Failure, Options};
use super::photographed::{PhotographedPairs, phase};
use lightpath_bench::{SimulatedBench, SimulatedDisplay, TestCard};
use lightpath_camera::alignment::{CameraMap, DotGrid, Registration, warp};
use lightpath_optics::display::phase_response::PhaseResponse;
use lightpath_optics::hologram::{HologramMethod, HologramOptions, initial_phase};
use lightpath_optics::numerics::tiles::Tiles;
use lightpath_optics::{
    Detector, DisplayModel, Engine, Grid, HologramProblem, KernelShape, OpticalSetup, Optimization, Plane,
    RegionOfInterest,
};
use num_complex::Complex32;
use std::f64::consts::TAU;

/// Cards that are kept out of the training holograms.
const HELD_OUT: [TestCard; 4] = [TestCard::Portrait, TestCard::Planet, TestCard::Leaf, TestCard::Clouds];

/// A simulated display on a bench, with the mistakes made in its photographs.
#[derive(Clone)]
pub(crate) struct Lab {
    bench: SimulatedDisplay,
    region: RegionOfInterest,
    iterations: u32,
    seed: u64,
    wrong: usize,
    saturated: f64,
    rotation_deg: f64,
    jitter_px: f64,
    /// The camera's map, if it was measured. Photographs are corrected by it.
    camera: Option<CameraMap>,
}

/// Level from which a pixel of a photograph counts as saturated.
const SATURATION: f32 = 254.5 / 255.0;

impl Lab {
    pub(crate) fn draw(options: &Options, seed: u64) -> Result<Self, Failure> {
        let (width_px, height_px) = options.size_px;
        let (pitch_m, wavelength_m) = (8e-6, 515e-9);
        let grid = Grid::try_new(height_px, width_px, pitch_m)?;
        let critical_m = 2.0 * width_px.min(height_px) as f64 * pitch_m * pitch_m / wavelength_m;
        let distance_m = if options.distance_m > 0.0 { options.distance_m } else { 0.6 * critical_m };
        let setup = OpticalSetup::try_new(grid, wavelength_m, distance_m)?.with_orders(options.orders)?.planned()?.0;
        let mut lab = Self {
            bench: SimulatedDisplay::draw(setup, None, SimulatedBench { seed, ..options.bench })?,
            region: RegionOfInterest::middle(&grid),
            iterations: options.training_iterations,
            seed,
            wrong: options.wrong,
            saturated: options.saturated,
            rotation_deg: options.rotation_deg,
            jitter_px: options.jitter_px,
            camera: None,
        };
        if options.calibrates {
            let taken = lab.photograph(8, 3)?;
            let mut map = lab.calibrated()?;
            for _ in 0..2 {
                map = lab.refined(map, &taken)?;
            }
            lab.camera = Some(map);
        }
        Ok(lab)
    }

    /// The camera's map, fitted to the photograph of a grid of dots that is displayed through the ideal kernel.
    fn calibrated(&self) -> Result<CameraMap, Failure> {
        let grid = self.setup().grid();
        let dots = DotGrid::of_display(grid.height_px(), grid.width_px())?;
        let engine = Engine::new(&DisplayModel::ideal(self.setup()), Detector::Pixel, None)?;
        let seed = self.seed * 1000 + 800;
        let levels = self.hologram(&engine, &dots.target(), TAU, seed, self.iterations)?;
        let photo = self.bench.capture(&phase(&levels)?, seed)?.map(|level| f32::from(level) / 255.0);
        let size_px = [grid.height_px(), grid.width_px()];
        let fit = CameraMap::from_points(&dots.find(&photo)?.dots, size_px, size_px)?;
        eprintln!("camera: {} dots, {:.3} px off, distortion {:?}", fit.inliers, fit.residual_px, fit.map.distortion());
        Ok(fit.map)
    }

    /// The camera's map, moved affinely to where tiles of photographs are expected with the ideal kernel.
    fn refined(&self, map: CameraMap, taken: &PhotographedPairs) -> Result<CameraMap, Failure> {
        let mut tiles = Tiles::cover(self.region).ok_or("--calibrate needs a larger display")?;
        let engine = Engine::new(&DisplayModel::ideal(self.setup()), Detector::Pixel, None)?;
        for (levels, photo) in taken.levels.iter().zip(&taken.photos) {
            let photo = photo.map(|level| f32::from(level) / 255.0);
            tiles.add(&engine.light(&phase(levels)?)?, &on_grid(&photo, &map), SATURATION);
        }
        let found = Registration::of(&tiles, self.region).ok_or("--calibrate: too few tiles show what they should")?;
        eprintln!("camera: {} tiles, {:.3} px off", found.tiles, found.misalignment_px);
        Ok(map.after(&found.correction))
    }

    /// A photograph on the display's pixels, if the camera's map was measured, or else as it is.
    pub(crate) fn corrected(&self, photo: Plane<f32>) -> Plane<f32> {
        match &self.camera {
            Some(map) => on_grid(&photo, map),
            None => photo,
        }
    }

    /// The same bench, without mistakes in the photographs.
    pub(crate) fn clean(&self) -> Self {
        Self { wrong: 0, saturated: 0.0, rotation_deg: 0.0, jitter_px: 0.0, ..self.clone() }
    }

    pub(crate) fn setup(&self) -> OpticalSetup {
        self.bench.setup()
    }

    pub(crate) fn region(&self) -> RegionOfInterest {
        self.region
    }

    pub(crate) fn bench(&self) -> &SimulatedDisplay {
        &self.bench
    }

    /// The display's true transfer function with a flat source, a linear response and no undiffracted light. `None` for
    /// a display that shows all orders, which no single transfer function describes.
    pub(crate) fn true_kernel(&self) -> Option<DisplayModel> {
        let setup = self.setup();
        if setup.orders().are_all() {
            return None;
        }
        let (rows, columns, pitch_m) =
            (setup.padded_height_px(), setup.padded_width_px(), setup.grid().pixel_pitch_m());
        let centred = |i: usize, n: usize| (i as f64 - (n / 2) as f64) / (n as f64 * pitch_m);
        let bins = Plane::from_fn(rows, columns, |y, x| {
            let value = self.bench.true_transfer(centred(x, columns), centred(y, rows));
            Complex32::new(value.re as f32, value.im as f32)
        });
        Some(DisplayModel { kernel: KernelShape::Bins(bins), ..DisplayModel::ideal(setup) })
    }

    /// Holograms optimized through the ideal kernel, and their photographs. Half of the holograms start from a random
    /// phase and half from a narrow one.
    pub(crate) fn photograph(&self, pairs: usize, set: u64) -> Result<PhotographedPairs, Failure> {
        let cards: Vec<TestCard> = TestCard::ALL.into_iter().filter(|card| !HELD_OUT.contains(card)).collect();
        let engine = Engine::new(&DisplayModel::ideal(self.setup()), Detector::Pixel, None)?;
        let mut photographed = PhotographedPairs { levels: Vec::new(), photos: Vec::new() };
        for i in 0..pairs {
            let seed = (self.seed * 16 + set) * 1000 + i as u64;
            // Each set takes its pictures from its own range of seeds.
            let target = self.card(cards[(i + set as usize * 5) % cards.len()], seed)?;
            let range_rad = if i % 2 == 0 { TAU } else { 1.0 };
            let levels = self.hologram(&engine, &target, range_rad, seed, self.iterations)?;
            let photo = self.photograph_with_mistakes(&self.bench.light(&phase(&levels)?)?, i, seed)?;
            photographed.photos.push(match &self.camera {
                Some(_) => self.corrected(photo.map(|level| f32::from(level) / 255.0)).map(to_level),
                None => photo,
            });
            photographed.levels.push(levels);
        }
        for i in 0..self.wrong.min(pairs / 2) {
            photographed.photos.swap(i, pairs - 1 - i);
        }
        Ok(photographed)
    }

    /// A target picture that no training hologram shows.
    pub(crate) fn new_target(&self, index: usize) -> Result<Plane<f32>, Failure> {
        self.card(HELD_OUT[index % HELD_OUT.len()], self.seed * 1000 + 900 + index as u64)
    }

    fn card(&self, card: TestCard, seed: u64) -> Result<Plane<f32>, Failure> {
        let grid = self.setup().grid();
        Ok(card.render(grid.height_px(), grid.width_px(), seed)?)
    }

    /// Grey levels of a hologram of the target, optimized through a model.
    pub(crate) fn hologram(
        &self,
        engine: &Engine,
        target: &Plane<f32>,
        range_rad: f64,
        seed: u64,
        iterations: u32,
    ) -> Result<Plane<u8>, Failure> {
        let (height_px, width_px) = (target.height_px(), target.width_px());
        let problem = HologramProblem::new(engine.clone(), target.clone(), self.region)?;
        let start = initial_phase(height_px, width_px, range_rad, seed)?;
        let options = HologramOptions::new(HologramMethod::Lbfgs, iterations);
        let mut optimization = Optimization::start(problem, options, start.into_vec())?;
        while optimization.step().is_some() {}
        let phase = Plane::try_from_vec(height_px, width_px, optimization.phases().to_vec())?;
        Ok(PhaseResponse::linear(8)?.quantize(&phase)?.map(|level| level as u8))
    }

    /// Grey levels of a hologram of the target, optimized through the bench itself.
    pub(crate) fn best_hologram(
        &self,
        target: &Plane<f32>,
        range_rad: f64,
        seed: u64,
        iterations: u32,
    ) -> Result<Plane<u8>, Failure> {
        let start = initial_phase(target.height_px(), target.width_px(), range_rad, seed)?;
        let phase = self.bench.optimize(target, self.region, &start, iterations)?;
        Ok(PhaseResponse::linear(8)?.quantize(&phase)?.map(|level| level as u8))
    }

    /// A photograph with the lab's mistakes: the camera is moved, rotated, and overexposed.
    fn photograph_with_mistakes(&self, light: &Plane<f32>, index: usize, seed: u64) -> Result<Plane<u8>, Failure> {
        // The direction of the movement differs from photograph to photograph.
        let angle = index as f64 * 2.4;
        let (dx, dy) = (self.jitter_px * angle.cos(), self.jitter_px * angle.sin());
        let rotation_rad = self.rotation_deg.to_radians() * (angle * 1.7).cos();
        let moved = if dx == 0.0 && dy == 0.0 && rotation_rad == 0.0 {
            light.clone()
        } else {
            rotated_and_shifted(light, rotation_rad, dx, dy)
        };
        let exposed = if self.saturated > 0.0 { overexposed(&moved, self.region, self.saturated) } else { moved };
        Ok(self.bench.expose(&exposed, seed))
    }
}

/// The level of a camera of 8 bits, for a value at full scale 1.
fn to_level(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// A photograph of the display's size, resampled to the display's pixels.
fn on_grid(photo: &Plane<f32>, map: &CameraMap) -> Plane<f32> {
    warp(photo, map, photo.height_px(), photo.width_px(), SATURATION, 1.0)
}
