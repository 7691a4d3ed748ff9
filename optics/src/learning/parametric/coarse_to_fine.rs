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
use crate::alignment::Tiles;
use crate::learning::band_pass::{BandPass, FilteredPhoto};
use crate::learning::fit::Fit;
use crate::learning::layout::SOURCE_ORDER;
use crate::learning::pair::{BoxError, Example, SATURATION};
use crate::learning::{Pair, PairSource};
use crate::optimizer::limited_memory::{LimitedMemory, Workspace};
use crate::Detector;

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

impl ParametricLearner {
    /// Whether few tiles of the photographs show their details in the place where the display θ has them.
    pub(super) fn is_displaced(&mut self, pairs: &dyn PairSource, theta: &[f64]) -> Result<bool, BoxError> {
        let Some(tiles) = self.compared_tiles(pairs, theta)? else { return Ok(false) };
        let displacements: Vec<[f64; 2]> = tiles.displacements().into_iter().map(|(_, by)| by).collect();
        let middle = [0, 1].map(|axis| median(displacements.iter().map(|by| by[axis]).collect()));
        let in_place = |by: &&[f64; 2]| (by[0] - middle[0]).hypot(by[1] - middle[1]) <= IN_PLACE_PX;
        let share = displacements.iter().filter(in_place).count() as f64 / tiles.len() as f64;
        if std::env::var_os("SHOW").is_some() { eprintln!("in place {share}"); }
        Ok(share < IN_PLACE_MIN)
    }

    /// Compares tiles of the photographs with what the display θ shows. `None` where the region is too small for tiles.
    pub(super) fn compared_tiles(&mut self, pairs: &dyn PairSource, theta: &[f64]) -> Result<Option<Tiles>, BoxError> {
        let Some(mut tiles) = Tiles::cover(self.options.region) else { return Ok(None) };
        let compared = Compared::of(pairs);
        self.fit.set(0, &self.joint.plane_parameters(0, theta));
        for index in 0..compared.len() {
            let pair = compared.pair(index)?;
            let light = self.fit.engine.light(&pair.phase)?;
            tiles.add(&light, &pair.photo, SATURATION);
        }
        Ok(Some(tiles))
    }

    /// θ after all stages. The layout must be that of a fine source.
    pub(super) fn fitted_coarse_to_fine(
        &mut self,
        pairs: &dyn PairSource,
        theta: &[f64],
    ) -> Result<Vec<f64>, BoxError> {
        let compared = Compared::with_most_px(pairs, self.options.region);
        let compared: Vec<Pair> = (0..compared.len()).map(|index| compared.pair(index)).collect::<Result<_, _>>()?;
        let layout = self.joint.layout;
        let mut fit = Fit::<f32>::new(vec![self.fit.setups[0]], layout, Detector::Point, self.options.carrier)?;
        let mut theta = theta.to_vec();
        for stage in STAGES {
            let start = self.joint.plane_parameters(0, &theta);
            let free = self.free_parameters(stage);
            let band = BandPass::new(self.options.region, stage.cell_px);
            let example = |pair: &Pair, fit: &Fit<f32>| Example::new(pair, &fit.engine, self.options.region);
            let photos: Vec<FilteredPhoto> =
                compared.iter().map(|pair| Ok(band.photo(&example(pair, &fit)?))).collect::<Result<_, BoxError>>()?;
            let (mut search, mut workspace) = (LimitedMemory::new(vec![0.0; free.len()]), Workspace::default());
            let mut failed = None;
            while search.counts.evaluations < stage.evaluations && !search.counts.converged {
                search.advance(&mut workspace, |changes, gradient| {
                    let mut moved = start.clone();
                    free.iter().zip(changes).for_each(|(&position, &by)| moved[position] += f64::from(by));
                    fit.set(0, &moved);
                    let (mut loss, share) = (0.0, 1.0 / compared.len() as f64);
                    let mut sums = vec![0.0; free.len()];
                    for (pair, photo) in compared.iter().zip(&photos) {
                        let example = match example(pair, &fit) {
                            Ok(example) => example,
                            Err(error) => {
                                failed = Some(error);
                                return f64::NAN;
                            }
                        };
                        let (of_pair, own) = fit
                            .evaluate_light(&example, |light, slopes| band.compare(&example, photo, light, slopes));
                        loss += share * of_pair;
                        sums.iter_mut().zip(&free).for_each(|(sum, &position)| *sum += share * own[position]);
                    }
                    gradient.iter_mut().zip(sums).for_each(|(gradient, sum)| *gradient = sum as f32);
                    loss
                });
                if std::env::var_os("SHOW").is_some() { eprintln!("{stage:?} {} {}", search.counts.evaluations, search.loss); }
            }
            if let Some(error) = failed {
                return Err(error.into());
            }
            for (&position, &by) in free.iter().zip(&search.point) {
                self.joint.add_to_plane(&mut theta, 0, position, f64::from(by));
            }
        }
        Ok(theta)
    }

    /// Positions of a stage's parameters in the θ of a plane. The linear terms of φ move the picture as the kernel's
    /// tilts do, and are left out.
    fn free_parameters(&self, stage: Stage) -> Vec<usize> {
        let layout = self.joint.layout;
        let (source, kernel) = (layout.source, layout.kernel);
        let of = |start: usize, degrees: &dyn Fn(usize) -> bool, basis: crate::chebyshev::ChebyshevBasis| {
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

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
