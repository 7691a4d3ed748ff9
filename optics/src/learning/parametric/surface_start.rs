//! A start for uneven modulators.
//!
//! ```text
//! d = K ∇φ + d₀,   K = λz / (2πΔ²)
//! ```
//!
//! A modulator whose surface adds the phase φ \[rad\] sends its light in the direction of φ's slope \[rad/px\], so the
//! picture is displaced by d \[px\] there, as in a sensor of Shack and Hartmann (B. C. Platt and R. Shack, J. Refract.
//! Surg. 17, S573 (2001)). Bends of some waves displace it by more pixels than its details measure, and then the loss
//! has no slope towards the right φ. The displacements of tiles of the photographs from what their holograms should
//! show determine φ up to such pixels. d₀, the shift of the whole picture, becomes a tilt of the kernel. λ wavelength
//! \[m\], z distance \[m\], Δ pixel pitch \[m\].
//!
//! Where the surface is bent by several waves, most tiles show no clear displacement. Then a fit
//! [from coarse to fine details](super::coarse_to_fine) goes on.
//!
//! Tiles see details of low frequencies best, which holograms of a narrow range of phases have.

use super::ParametricLearner;
use super::pairs_in_use::few;
use crate::display::parts::Block;
use crate::learning::pair::{BoxError, PairSource, SATURATION};
use crate::numerics::RegionOfInterest;
use crate::numerics::chebyshev::{ChebyshevBasis, polynomials, position};
use crate::numerics::least_squares::NormalEquations;
use crate::numerics::tiles::Tiles;
use std::f64::consts::{PI, TAU};

/// Highest total degrees of φ in the rounds: each round starts from the result of the one before.
const ORDERS: [usize; 4] = [2, 4, 8, 8];
/// Number of terms of the highest order.
const TERMS: usize = 44;
/// Most pairs that are compared.
const PAIRS_MAX: usize = 16;
/// Distance of a tile's displacement from the fit at which it counts half \[px\].
const HALF_PX: f64 = 1.0;
/// Number of fits, each with the weights of the fit before.
const REWEIGHTED: usize = 8;
/// Damping of the fit: coefficients that hardly displace any tile stay near 0.
const DAMPING: f64 = 1e-2;
/// Least relative decrease of the loss by which a start is kept.
const GAIN_MIN: f64 = 0.03;
/// Least relative decrease of the loss by which the fine terms of a start are kept.
const FINE_GAIN_MIN: f64 = 0.1;

impl ParametricLearner {
    /// Finds a start for the surface of the modulator and the shift of the picture, and writes it to the `parameters`,
    /// which are those of the ideal display. They stay as they are if the loss hardly falls.
    pub(super) fn start_from_displacements(
        &mut self,
        pairs: &dyn PairSource,
        parameters: &mut Vec<f64>,
    ) -> Result<(), BoxError> {
        if !Block::FineSource.belongs_to(self.options.model) {
            return Ok(());
        }
        let coarse = self.joint.clone();
        let blocks = coarse.layout.blocks.with(Block::FineSource);
        let fine = coarse.with_layout(self.layout_of(coarse.layout.kernel.order(), blocks));
        self.change_layout(fine.clone());
        let mut best = coarse.converted(parameters, &fine);
        let before = self.start_loss(pairs, &best)?;
        let mut lowest = before;
        for order in ORDERS {
            let Some(moved) = self.moved_towards_photographs(pairs, &best, order)? else { break };
            let loss = self.start_loss(pairs, &moved)?;
            // A round of a higher order may correct what a lower one could not describe.
            if loss >= lowest {
                continue;
            }
            (best, lowest) = (moved, loss);
        }
        let is_kept = lowest <= before * (1.0 - GAIN_MIN);
        let without_fine_terms = fine.converted(&best, &coarse);
        let is_fine = is_kept
            && lowest
                <= (1.0 - FINE_GAIN_MIN) * self.start_loss(pairs, &coarse.converted(&without_fine_terms, &fine))?;
        let usual = match (is_kept, is_fine) {
            (true, true) => best.clone(),
            (true, false) => coarse.converted(&without_fine_terms, &fine),
            (false, _) => coarse.converted(parameters, &fine),
        };
        if let Some(found) = self.found_coarse_to_fine(pairs, &usual)? {
            *parameters = found;
            return Ok(());
        }
        if is_fine {
            *parameters = best;
            return Ok(());
        }
        self.change_layout(coarse);
        if is_kept {
            *parameters = without_fine_terms;
        }
        Ok(())
    }

    /// Mean of the losses of the pairs that are compared.
    pub(super) fn start_loss(&mut self, pairs: &dyn PairSource, theta: &[f64]) -> Result<f64, BoxError> {
        let compared = Compared::of(pairs, self.options.region);
        let each = self.measure_each(&compared, theta)?;
        Ok(each.iter().map(crate::engine::photometry::Sums::fitted_loss).sum::<f64>() / each.len() as f64)
    }

    /// Compares tiles of the photographs with what the display θ shows. `None` where the region is too small for tiles.
    pub(super) fn compared_tiles(&mut self, pairs: &dyn PairSource, theta: &[f64]) -> Result<Option<Tiles>, BoxError> {
        let Some(mut tiles) = Tiles::cover(self.options.region) else { return Ok(None) };
        let compared = Compared::of(pairs, self.options.region);
        self.fit.set(0, &self.joint.plane_parameters(0, theta));
        for index in 0..compared.len() {
            let pair = compared.pair(index)?;
            let light = self.fit.engine.light(&pair.phase)?;
            tiles.add(&light, &pair.photo, SATURATION);
        }
        Ok(Some(tiles))
    }

    /// θ with the surface and the shift by which the photographs are displaced. `None` without enough tiles.
    fn moved_towards_photographs(
        &mut self,
        pairs: &dyn PairSource,
        theta: &[f64],
        order: usize,
    ) -> Result<Option<Vec<f64>>, BoxError> {
        let setup = self.fit.setups[0];
        let Some(tiles) = self.compared_tiles(pairs, theta)? else { return Ok(None) };
        let (height_px, width_px) = (setup.grid().height_px(), setup.grid().width_px());
        let pitch_m = setup.grid().pixel_pitch_m();
        let px_per_slope = setup.wavelength_m() * setup.distance_m() / (TAU * pitch_m * pitch_m);
        let basis = ChebyshevBasis::new(order);
        let equations: Vec<([f64; TERMS], f64)> = tiles
            .displacements()
            .into_iter()
            .flat_map(|([x, y], [dx, dy])| {
                let (along_x, along_y) = (slopes(order, x, width_px), slopes(order, y, height_px));
                let row = |of: &dyn Fn(usize, usize) -> f64| {
                    let mut row = [0.0; TERMS];
                    row.iter_mut().zip(basis.degrees()).for_each(|(a, (i, j))| *a = px_per_slope * of(i, j));
                    row
                };
                let by_x = row(&|i, j| along_x[i].1 * along_y[j].0);
                let by_y = row(&|i, j| along_x[i].0 * along_y[j].1);
                [(by_x, dx), (by_y, dy)]
            })
            .collect();
        if equations.len() < 3 * basis.terms() {
            return Ok(None);
        }
        let Some(found) = robust_fit(&equations) else { return Ok(None) };
        let (mut moved, layout) = (theta.to_vec(), self.joint.layout);
        let mut add = |start: usize, of: ChebyshevBasis, degrees: (usize, usize), by: f64| {
            if let Some(term) = of.degrees().position(|of_term| of_term == degrees) {
                self.joint.add_to_plane(&mut moved, 0, start + of.terms() + term, by);
            }
        };
        for (degrees, coefficient) in basis.degrees().zip(found) {
            match degrees {
                // The kernel's factor exp(iτx), x = 2Δfx, moves the picture by −τ/π px.
                (1, 0) => add(0, layout.kernel, degrees, -PI * px_per_slope * coefficient * 2.0 / width_px as f64),
                (0, 1) => add(0, layout.kernel, degrees, -PI * px_per_slope * coefficient * 2.0 / height_px as f64),
                _ => add(layout.source(), layout.source, degrees, coefficient),
            }
        }
        Ok(Some(moved))
    }
}

/// T_i and its derivative by the pixel, at a place on an axis of `side_px` pixels.
fn slopes(order: usize, at_px: f64, side_px: usize) -> Vec<(f64, f64)> {
    let per_px = 2.0 / side_px as f64;
    let x = position(0, side_px) + per_px * at_px;
    let values = polynomials(order, x);
    // Polynomials of the second kind: T_i′ = i U_{i−1}.
    let (mut before, mut second) = (0.0, 1.0);
    let derivative = |(i, value): (usize, f64)| {
        if i == 0 {
            return (value, 0.0);
        }
        let slope = i as f64 * second;
        (before, second) = (second, 2.0 * x * second - before);
        (value, slope * per_px)
    };
    values.into_iter().enumerate().map(derivative).collect()
}

/// Least squares in which equations far from the fit count little.
fn robust_fit(equations: &[([f64; TERMS], f64)]) -> Option<[f64; TERMS]> {
    let mut found = [0.0; TERMS];
    let mut weights = vec![1.0; equations.len()];
    for _ in 0..REWEIGHTED {
        let mut normal = NormalEquations::<TERMS>::none();
        for ((row, value), weight) in equations.iter().zip(&weights) {
            normal.add(row, *value, *weight);
        }
        found = normal.damped(TERMS, DAMPING).solve()?;
        for ((row, value), weight) in equations.iter().zip(&mut weights) {
            let rest = value - row.iter().zip(&found).map(|(a, x)| a * x).sum::<f64>();
            *weight = 1.0 / (1.0 + (rest / HALF_PX).powi(2));
        }
    }
    Some(found)
}

/// The first pairs of the first distance. Of large photographs some suffice.
pub(super) struct Compared<'a> {
    pairs: &'a dyn PairSource,
    len: usize,
}

impl<'a> Compared<'a> {
    pub(super) fn of(pairs: &'a dyn PairSource, region: RegionOfInterest) -> Self {
        let of_first = (0..pairs.len()).take_while(|&index| pairs.plane(index) == 0).count();
        Self { pairs, len: of_first.min(PAIRS_MAX).min(few(region)) }
    }
}

impl PairSource for Compared<'_> {
    fn len(&self) -> usize {
        self.len
    }

    fn pair(&self, index: usize) -> Result<crate::learning::Pair, BoxError> {
        self.pairs.pair(index)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::display::{Detector, DisplayModel, OpticalSetup};
    use crate::engine::Engine;
    use crate::hologram::{HologramMethod, HologramOptions, HologramProblem, Optimization, initial_phase};
    use crate::learning::options::{KernelModel, LearnOptions};
    use crate::learning::pair::Pair;
    use crate::numerics::{Grid, Plane};
    use crate::pictures_of_tests::picture;

    #[test]
    fn slopes_match_central_differences() {
        let at = |px: f64| slopes(8, px, 40);
        for px in [0.0, 3.7, 20.0, 39.0] {
            for ((i, (value, slope)), (after, before)) in
                at(px).into_iter().enumerate().zip(at(px + 1e-5).into_iter().zip(at(px - 1e-5)))
            {
                assert!((value - polynomials(8, position(0, 40) + px / 20.0)[i]).abs() < 1e-12);
                assert!((slope - (after.0 - before.0) / 2e-5).abs() < 1e-6, "T_{i} at {px} px");
            }
        }
    }

    #[test]
    fn fit_ignores_outliers() {
        let wanted: [f64; TERMS] = std::array::from_fn(|i| (i as f64).sin());
        let equations: Vec<_> = (0..400)
            .map(|k| {
                let row: [f64; TERMS] = std::array::from_fn(|i| (1.0 + (k * (i + 3)) as f64).sin());
                let value: f64 = row.iter().zip(&wanted).map(|(a, x)| a * x).sum();
                (row, if k % 10 == 0 { 30.0 } else { value })
            })
            .collect();
        let found = robust_fit(&equations).unwrap();
        assert!(found.iter().zip(&wanted).all(|(a, b)| (a - b).abs() < 0.1), "{found:?}");
    }

    /// Holograms of pictures, and their photographs on a display whose modulator is bent by some waves.
    pub(in super::super) fn pairs(setup: OpticalSetup, waves: f64) -> Vec<Pair> {
        let (height_px, width_px) = (setup.grid().height_px(), setup.grid().width_px());
        let region = RegionOfInterest::middle(&setup.grid());
        let engine = Engine::new(&DisplayModel::ideal(setup), Detector::Pixel, None).unwrap();
        let surface = surface(height_px, width_px, waves);
        let pair = |seed: u64| {
            let problem = HologramProblem::new(engine.clone(), picture(height_px, width_px, seed), region).unwrap();
            let start = initial_phase(height_px, width_px, 1.0, 3).unwrap().into_vec();
            let mut run = Optimization::start(problem, HologramOptions::new(HologramMethod::Lbfgs, 12), start).unwrap();
            while run.step().is_some() {}
            let phase = Plane::try_from_vec(height_px, width_px, run.phases().to_vec()).unwrap();
            let light = engine.light(&Plane::from_fn(height_px, width_px, |y, x| phase.at(y, x) + surface.at(y, x)));
            Pair { phase, photo: photographed(&light.unwrap(), seed) }
        };
        (0..4).map(pair).collect()
    }

    /// Phase \[rad\] of a surface with this height from peak to valley: cosines of up to 1.5 periods in each half of
    /// the longer side, the slow ones larger, without a tilt. No polynomial is exact for it.
    fn surface(height_px: usize, width_px: usize, waves: f64) -> Plane<f32> {
        let half_px = height_px.max(width_px) as f64 / 2.0;
        let at = |y: usize, x: usize| {
            let (x, y) = (x as f64 / half_px - 1.0, y as f64 / half_px - height_px as f64 / (2.0 * half_px));
            let cosine = |k: i32| {
                let (frequency, angle) = (0.1 + 0.12 * f64::from(k), 2.4 * f64::from(k));
                (TAU * frequency * (x * angle.cos() + y * angle.sin())).cos() / frequency.powf(1.5)
            };
            (0..12).map(cosine).sum::<f64>()
        };
        let shape = Plane::from_fn(height_px, width_px, at);
        let (low, high) = shape.values().iter().fold((f64::MAX, f64::MIN), |(low, high), &s| (low.min(s), high.max(s)));
        shape.map(|s| (TAU * waves * s / (high - low)) as f32)
    }

    /// What a camera of 8 bits with noise and a black level makes of the light.
    fn photographed(light: &Plane<f32>, seed: u64) -> Plane<f32> {
        let noise = initial_phase(light.height_px(), light.width_px(), 0.01, seed).unwrap();
        Plane::from_fn(light.height_px(), light.width_px(), |y, x| {
            let signal = 0.005 + 0.1 * light.at(y, x) + noise.at(y, x);
            (255.0 * signal.clamp(0.0, 1.0)).round() / 255.0
        })
    }

    #[test]
    fn start_lowers_the_loss_on_a_bent_modulator_only() {
        let setup = OpticalSetup::try_new(Grid::try_new(270, 480, 8e-6).unwrap(), 515e-9, 40e-3).unwrap();
        for (surface_waves, is_bent) in [(1.0, true), (0.0, false)] {
            let pairs = pairs(setup, surface_waves);
            let options = LearnOptions::new(KernelModel::Display, RegionOfInterest::middle(&setup.grid()));
            let mut learner = ParametricLearner::start(&[setup], options, &pairs).unwrap();
            let theta = learner.state.fitted.parameters.clone();
            assert_eq!(theta.iter().any(|&parameter| parameter != 0.0), is_bent, "{surface_waves} waves");
            let loss = |learner: &mut ParametricLearner, theta: &[f64]| learner.start_loss(&pairs, theta).unwrap();
            let (started, ideal) = (loss(&mut learner, &theta), loss(&mut learner, &vec![0.0; theta.len()]));
            assert!(!is_bent || started < 0.8 * ideal, "{started} against {ideal}");
        }
    }
}
