//! A start for modulators that are bent by several waves, from coarse to fine details.
//!
//! ```text
//! min over φ, a, τ of  mean over pairs of L_σ,     σ = 32, 16, 8, 4, 2 px
//! ```
//!
//! Such a surface displaces the picture by many pixels, and by different ones within each tile of the photographs, so
//! that the [tiles](super::surface_start) find no displacement. L_σ compares details of σ pixels only
//! ([`BandPass`]): where these are displaced by less than they measure, their loss has a slope towards the right
//! surface. Each stage starts from the one before, and its finer details see finer terms of the phase φ.
//!
//! The logarithm of the source's amplitude, a, is fitted together with φ. Uneven light on the modulator and light that
//! a bent modulator gathers look the same in coarse details, and with a fixed at 0, φ would have to explain both. The
//! tilts τ of the kernel move the picture as a whole.
//!
//! Light is sampled once for each pixel here. That is too rarely only for its details of less than two pixels.

use super::ParametricLearner;
use super::surface_start::Compared;
use crate::display::Detector;
use crate::display::parts::layout::SOURCE_ORDER;
use crate::learning::band_pass::{BandPass, FilteredPhoto};
use crate::learning::fit::Fit;
use crate::learning::pair::{BoxError, Example, PairSource};
use crate::learning::screening::median;
use crate::numerics::chebyshev::ChebyshevBasis;
use crate::numerics::optimizer::limited_memory::{LimitedMemory, Workspace};

/// A stage of the fit.
#[derive(Clone, Copy, Debug)]
struct Stage {
    /// Side of the cells of the band pass: half of σ.
    cell_px: usize,
    /// Highest total degree of φ.
    order: usize,
    /// Most evaluations of all pairs.
    evaluations: u32,
}

/// The stages, from coarse to fine.
const STAGES: [Stage; 5] = [
    Stage { cell_px: 16, order: 4, evaluations: 12 },
    Stage { cell_px: 8, order: 6, evaluations: 12 },
    Stage { cell_px: 4, order: 8, evaluations: 15 },
    Stage { cell_px: 2, order: 10, evaluations: 15 },
    Stage { cell_px: 1, order: 10, evaluations: 15 },
];
/// Distance from the median of all displacements up to which a tile is in its place \[px\].
const IN_PLACE_PX: f64 = 0.5;
/// Least part of the tiles that are in their place on a display whose surface is known well enough.
const IN_PLACE_MIN: f64 = 0.7;

/// Least relative decrease of the loss of the sharp photographs by which the result is kept.
const GAIN_MIN: f64 = 0.1;

impl ParametricLearner {
    /// θ after all stages, from the start `theta`. `None` if most tiles are in their place with `theta` already, or if
    /// the loss hardly falls. The layout must have a fine source.
    pub(super) fn found_coarse_to_fine(
        &mut self,
        pairs: &dyn PairSource,
        theta: &[f64],
    ) -> Result<Option<Vec<f64>>, BoxError> {
        if !self.is_displaced(pairs, theta)? {
            return Ok(None);
        }
        let found = self.fitted_coarse_to_fine(pairs, theta)?;
        let (before, after) = (self.start_loss(pairs, theta)?, self.start_loss(pairs, &found)?);
        Ok((after <= before * (1.0 - GAIN_MIN)).then_some(found))
    }

    /// Whether few tiles of the photographs show their details in the place where the display θ has them.
    fn is_displaced(&mut self, pairs: &dyn PairSource, theta: &[f64]) -> Result<bool, BoxError> {
        let Some(tiles) = self.compared_tiles(pairs, theta)? else { return Ok(false) };
        let displacements: Vec<[f64; 2]> = tiles.displacements().into_iter().map(|(_, by)| by).collect();
        let middle = [0, 1].map(|axis| median(displacements.iter().map(|by| by[axis]).collect()));
        let in_place = |by: &&[f64; 2]| (by[0] - middle[0]).hypot(by[1] - middle[1]) <= IN_PLACE_PX;
        Ok((displacements.iter().filter(in_place).count() as f64) < IN_PLACE_MIN * tiles.count() as f64)
    }

    /// θ after all stages.
    fn fitted_coarse_to_fine(&mut self, pairs: &dyn PairSource, theta: &[f64]) -> Result<Vec<f64>, BoxError> {
        let region = self.options.region;
        let compared = Compared::of(pairs, region);
        let setups = vec![self.fit.setups[0]];
        let mut fit = Fit::<f32>::new(setups, self.joint.layout, Detector::Point, self.options.carrier)?;
        let examples: Vec<Example<f32>> = (0..compared.len())
            .map(|index| Ok(Example::new(&compared.pair(index)?, &fit.engine, region)?))
            .collect::<Result<_, BoxError>>()?;
        let mut theta = theta.to_vec();
        for stage in STAGES {
            let (start, free) = (self.joint.plane_parameters(0, &theta), self.free_parameters(stage));
            let changes = stage.fitted_changes(&mut fit, &examples, &start, &free);
            for (&position, by) in free.iter().zip(changes) {
                self.joint.add_to_plane(&mut theta, 0, position, by.into());
            }
        }
        Ok(theta)
    }

    /// Positions of a stage's parameters in the θ of a plane. The linear terms of φ move the picture as the kernel's
    /// tilts do, and are left out.
    fn free_parameters(&self, stage: Stage) -> Vec<usize> {
        let layout = self.joint.layout;
        let (source, kernel) = (layout.source, layout.kernel);
        let of = |start: usize, degrees: &dyn Fn(usize) -> bool, basis: ChebyshevBasis| {
            let terms = basis.degrees().enumerate().filter(|(_, (i, j))| degrees(i + j));
            terms.map(|(term, _)| start + term).collect::<Vec<_>>()
        };
        [
            of(kernel.terms(), &|degree| degree == 1, kernel),
            of(layout.source(), &|degree| degree <= SOURCE_ORDER, source),
            of(layout.source() + source.terms(), &|degree| (2..=stage.order).contains(&degree), source),
        ]
        .concat()
    }
}

impl Stage {
    /// Changes of the `free` parameters of a plane's θ, `start`, that fit the details of this stage.
    fn fitted_changes(self, fit: &mut Fit<f32>, examples: &[Example<f32>], start: &[f64], free: &[usize]) -> Vec<f32> {
        let Some(first) = examples.first() else { return vec![0.0; free.len()] };
        let (band, share) = (BandPass::new(first.region, self.cell_px), 1.0 / examples.len() as f64);
        let photos: Vec<FilteredPhoto> = examples.iter().map(|example| band.photo(example)).collect();
        let (mut search, mut workspace) = (LimitedMemory::new(vec![0.0; free.len()]), Workspace::default());
        while search.counts.evaluations < self.evaluations && !search.counts.converged {
            search.advance(&mut workspace, |changes, gradient| {
                let mut theta = start.to_vec();
                free.iter().zip(changes).for_each(|(&position, &by)| theta[position] += f64::from(by));
                fit.set(0, &theta);
                let (mut loss, mut sums) = (0.0, vec![0.0; free.len()]);
                for (example, photo) in examples.iter().zip(&photos) {
                    let (of_pair, own) =
                        fit.evaluate_light(example, |light, slopes| band.compare(example, photo, light, slopes));
                    loss += share * of_pair;
                    sums.iter_mut().zip(free).for_each(|(sum, &position)| *sum += share * own[position]);
                }
                gradient.iter_mut().zip(sums).for_each(|(gradient, sum)| *gradient = sum as f32);
                loss
            });
        }
        search.point
    }
}

#[cfg(test)]
mod tests {
    use super::super::state::{Fitted, ParametricState};
    use super::super::surface_start::tests::pairs;
    use super::*;
    use crate::display::OpticalSetup;
    use crate::display::parts::Block;
    use crate::display::parts::blocks::Blocks;
    use crate::learning::options::{KernelModel, LearnOptions};
    use crate::learning::pair::Pair;
    use crate::numerics::{Grid, RegionOfInterest};
    use rayon::ThreadPoolBuilder;

    /// The photographs of a display whose modulator is bent by some waves.
    fn bent(grid: Grid, distance_m: f64, surface_waves: f64) -> (OpticalSetup, LearnOptions, Vec<Pair>) {
        let setup = OpticalSetup::try_new(grid, 515e-9, distance_m).unwrap();
        let options = LearnOptions::new(KernelModel::Display, RegionOfInterest::middle(&grid));
        (setup, options, pairs(setup, surface_waves))
    }

    #[test]
    fn start_finds_surface_of_three_waves() {
        let (setup, options, pairs) = bent(Grid::try_new(270, 480, 8e-6).unwrap(), 40e-3, 3.0);
        let mut learner = ParametricLearner::start(&[setup], options, &pairs).unwrap();
        let theta = learner.state.fitted.parameters.clone();
        let started = learner.start_loss(&pairs, &theta).unwrap();
        let ideal = learner.start_loss(&pairs, &vec![0.0; theta.len()]).unwrap();
        assert!(started < 0.5 * ideal, "{started} against {ideal}");
        assert!(!learner.is_displaced(&pairs, &theta).unwrap());
    }

    #[test]
    fn fit_is_the_same_on_any_number_of_threads() {
        let (setup, options, pairs) = bent(Grid::try_new(48, 80, 8e-6).unwrap(), 5e-3, 2.0);
        let found = |threads| {
            ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
                let blocks = Blocks::NONE.with(Block::FineSource);
                let fitted = Fitted { order: 5, blocks, ..Fitted::default() };
                let state = ParametricState { fitted, ..ParametricState::default() };
                let mut learner = ParametricLearner::resume(&[setup], options.clone(), state).unwrap();
                let flat = vec![0.0; learner.joint.len()];
                learner.fitted_coarse_to_fine(&pairs, &flat).unwrap()
            })
        };
        let on_one = found(1);
        assert!(on_one.iter().any(|&parameter| parameter != 0.0));
        assert!([2, 8].into_iter().all(|threads| found(threads) == on_one));
    }
}
