//! Compares models with photographs: of the test pairs, and of new holograms optimized through each model.

use super::lab::Lab;
use super::options::{Failure, Options};
use super::photographed::{PhotographedPairs, phase};
use lightpath_camera::alignment::{Registration, warp};
use lightpath_optics::learning::{PairSource, compare};
use lightpath_optics::metrics::{Gain, psnr_db};
use lightpath_optics::numerics::tiles::Tiles;
use lightpath_optics::{Detector, DisplayModel, Engine, Plane};

/// Measures the quality of models with the photographs of a lab.
pub(crate) struct ModelEvaluation<'a> {
    lab: &'a Lab,
    test: &'a PhotographedPairs,
    targets: Vec<Plane<f32>>,
    iterations: u32,
    judges_light: bool,
    aligns: bool,
}

/// Measured quality of a model.
pub(crate) struct ModelScore {
    /// Mean squared error in the region over the test pairs. Gain and black level are fitted to each pair.
    pub(crate) test_loss: f64,
    /// PSNR of the photographs of new holograms \[dB\], one value for each target.
    pub(crate) captured_db: Vec<f64>,
    /// The same after the affine move that aligns each photograph with its target \[dB\]. Empty: they were not aligned.
    pub(crate) aligned_db: Vec<f64>,
}

impl<'a> ModelEvaluation<'a> {
    pub(crate) fn new(lab: &'a Lab, test: &'a PhotographedPairs, options: &Options) -> Result<Self, Failure> {
        let targets = (0..options.targets).map(|i| lab.new_target(i)).collect::<Result<_, _>>()?;
        Ok(Self {
            lab,
            test,
            targets,
            iterations: options.iterations,
            judges_light: options.judges_light,
            aligns: options.aligns,
        })
    }

    pub(crate) fn score(&self, model: &DisplayModel) -> Result<ModelScore, Failure> {
        let engine = Engine::new(model, Detector::Pixel, None)?;
        let mut test_loss = 0.0;
        for index in 0..self.test.len() {
            test_loss += compare(&engine, &self.test.pair(index)?, self.lab.region())?.fitted_loss();
        }
        let test_loss = test_loss / self.test.len() as f64;
        let hologram = |target: &Plane<f32>, seed| self.lab.hologram(&engine, target, 1.0, seed, self.iterations);
        self.captured(test_loss, hologram, |light| self.lab.corrected(light))
    }

    /// The score of holograms that are optimized through the bench itself. It has no held-out error. They suit the
    /// camera as it stands, so their photographs are not corrected.
    pub(crate) fn best_score(&self, range_rad: f64) -> Result<ModelScore, Failure> {
        let hologram = |target: &Plane<f32>, seed| self.lab.best_hologram(target, range_rad, seed, self.iterations);
        self.captured(f64::NAN, hologram, |light| light)
    }

    fn captured(
        &self,
        test_loss: f64,
        levels: impl Fn(&Plane<f32>, u64) -> Result<Plane<u8>, Failure>,
        corrected: impl Fn(Plane<f32>) -> Plane<f32>,
    ) -> Result<ModelScore, Failure> {
        let mut score = ModelScore { test_loss, captured_db: Vec::new(), aligned_db: Vec::new() };
        for (target, seed) in self.targets.iter().zip(1..) {
            let (bench, shown) = (self.lab.bench(), phase(&levels(target, seed)?)?);
            let light = match self.judges_light {
                true => bench.light(&shown)?,
                false => bench.capture(&shown, 1_000_000 + seed)?.map(|level| f32::from(level) / 255.0),
            };
            let light = corrected(light);
            let region = self.lab.region();
            let captured_db = psnr_db(&light, target, region, Gain::Fitted)?;
            score.captured_db.push(captured_db);
            if self.aligns {
                let mut tiles = Tiles::cover(region).ok_or("--align needs a larger display")?;
                tiles.add(target, &light, f32::INFINITY);
                let moved = Registration::of(&tiles, region).map(|found| {
                    warp(&light, &found.correction, target.height_px(), target.width_px(), f32::INFINITY, 0.0)
                });
                let moved_db = moved.map(|moved| psnr_db(&moved, target, region, Gain::Fitted)).transpose()?;
                // Where the picture is in its place already, resampling only blurs it.
                score.aligned_db.push(moved_db.unwrap_or(captured_db).max(captured_db));
            }
        }
        Ok(score)
    }
}
