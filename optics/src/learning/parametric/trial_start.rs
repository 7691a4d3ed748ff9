//! Starts of the trials of [blocks](Block) that would not find the optimum from nothing.

use super::ParametricLearner;
use crate::display::parts::{Block, ModelPart};
use crate::learning::course::Round;
use crate::learning::ghost_search::GhostSearch;
use crate::learning::pair::{BoxError, PairSource};
use crate::numerics::chebyshev::ChebyshevBasis;
use crate::numerics::gaussian_blur::sigma_px_of_ratio;
use std::f64::consts::{PI, SQRT_2, TAU};

/// Least distance of each mode's image from the image so far, at the start of a trial \[px\].
const MODE_RADIUS_PX: f64 = 0.5;
/// Direction of the first mode's image, so that none lies on an axis \[turns\].
const MODE_TURN: f64 = 0.04;
/// Defocus of the further modes, to either side, at the start of a trial: half their phase at the end of the band
/// \[rad\].
const MODE_DEFOCUS_RAD: f64 = 0.3;

impl ParametricLearner {
    /// Prepares the trial that begins, if one does. False if nothing is seen of its block.
    pub(super) fn prepare_trial(&mut self, pairs: &dyn PairSource) -> Result<bool, BoxError> {
        match self.state.course.round().and_then(Round::added) {
            Some(Block::PartialCoherence) => self.separate_modes(),
            Some(Block::Ghost) => return self.start_from_seen_ghost(pairs),
            _ => (),
        }
        Ok(true)
    }

    /// Gives the modes of light a start: three images of the same light around the image so far, at slightly different
    /// distances. If the light blurs, the images are as far apart as the blur is wide, and the blur starts anew,
    /// because the modes may describe better what it describes.
    fn separate_modes(&mut self) {
        let layout = self.joint.layout;
        let blur = layout.blocks.contains(Block::LightBlur).then_some(layout.start(ModelPart::LightBlur));
        let radii_px = blur.map_or([MODE_RADIUS_PX; 2], |start| {
            let theta = self.joint.plane_parameters(0, &self.state.fitted.parameters);
            (0..2).for_each(|axis| self.joint.set_shared(&mut self.state.fitted.parameters, start + axis, 0.0));
            // Three places on a circle have half the square of its radius as their variance along each axis.
            [0, 1].map(|axis| (SQRT_2 * sigma_px_of_ratio(theta[start + axis])).max(MODE_RADIUS_PX))
        });
        let place_px = |mode: usize| {
            let angle = TAU * (mode as f64 / (layout.modes + 1) as f64 + MODE_TURN);
            [radii_px[0] * angle.cos(), radii_px[1] * angle.sin()]
        };
        let mut add = |start: usize, basis: ChebyshevBasis, degrees: (usize, usize), by: f64| {
            if let Some(term) = basis.degrees().position(|of_term| of_term == degrees) {
                let position = start + basis.terms() + term;
                self.joint.add_to_all_planes(&mut self.state.fitted.parameters, position, by);
            }
        };
        let first = place_px(0);
        for (axis, degrees) in [(1, 0), (0, 1)].into_iter().enumerate() {
            add(0, layout.kernel, degrees, PI * first[axis]);
            for m in 0..layout.modes {
                let shift_px = place_px(m + 1)[axis] - first[axis];
                add(layout.mode_errors(m), layout.mode, degrees, PI * shift_px);
            }
        }
        for (m, degrees) in (0..layout.modes).flat_map(|m| [(m, (2, 0)), (m, (0, 2))]) {
            let side = if m % 2 == 0 { 1.0 } else { -1.0 };
            add(layout.mode_errors(m), layout.mode, degrees, side * MODE_DEFOCUS_RAD);
        }
    }

    /// Starts from the ghost that is seen in the photographs. False if there is none.
    fn start_from_seen_ghost(&mut self, pairs: &dyn PairSource) -> Result<bool, BoxError> {
        let mut search = GhostSearch::new(self.fit.engine.height_px(), self.fit.engine.width_px());
        let theta = self.state.fitted.parameters.clone();
        self.each_in_use(pairs, &theta, |fit, _, example, _| {
            fit.add_to_search(example, &mut search);
            0.0
        })?;
        let Some(ghost) = search.found() else { return Ok(false) };
        for (i, number) in ghost.numbers().into_iter().enumerate() {
            self.joint.set_shared(
                &mut self.state.fitted.parameters,
                self.joint.layout.start(ModelPart::Ghost) + i,
                number,
            );
        }
        Ok(true)
    }
}
