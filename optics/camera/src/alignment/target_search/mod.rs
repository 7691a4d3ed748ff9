//! Search for a target picture in a photograph.
//!
//! [`find_target`] needs no start. It searches the reduced photograph at every scale, at several turns and for all
//! mirror images (`coarse`). It refines the best places on finer and finer details of both pictures (`refinement`):
//! first an affine map, then the perspective, then the lens's distortion ([`CameraMap`]). Details are blurred a little
//! and have no slow changes, so neither speckle nor gain, offset and uneven light decide.
//!
//! The target may cover a part of the photograph, or the photograph most of the target.

mod blocks;
mod coarse;
mod pyramid;
mod refinement;
#[cfg(test)]
mod tests;

pub use blocks::{BlockDisplacement, block_displacements};

use super::error::{AlignmentError, CORRELATION_MIN, TARGET_SIDE_MIN};
use crate::alignment::camera_map::CameraMap;
use lightpath_optics::Plane;
use pyramid::{Pyramid, last_step};
use rayon::prelude::*;
use refinement::{Fit, Freedom, refined};

/// The place of a target in a photograph.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundTarget {
    /// Map from the target's pixels to the camera's.
    pub map: CameraMap,
    /// Normalized correlation of the details of target and photograph, −1 to 1.
    pub correlation: f64,
}

/// Longer side of the target in the first refinement \[px\].
const FIRST_PX: f64 = 64.0;
/// Distance of nearly equal places, in longer sides of the target, and part by which their magnifications differ.
const SAME: f64 = 0.02;
/// Largest ratio of the magnifications in the target's centre and in a corner.
const SHRINKING_MAX: f64 = 2.0;
/// Parameters of the first refinements, one set after the other, and the number of places that are kept after each.
const STAGES: [(&[Freedom], usize); 3] =
    [(&[Freedom::Affine], 4), (&[Freedom::Perspective, Freedom::Distorted], 2), (&[Freedom::Distorted], 1)];

/// Finds a target in a photograph.
///
/// # Errors
///
/// [`AlignmentError::PictureTooSmall`] for a side below [`TARGET_SIDE_MIN`], and [`AlignmentError::TargetNotFound`] if
/// the best place has a correlation below [`CORRELATION_MIN`].
pub fn find_target(photo: &Plane<f32>, target: &Plane<f32>) -> Result<FoundTarget, AlignmentError> {
    for (name, picture) in [("photograph", photo), ("target", target)] {
        let (width_px, height_px) = (picture.width_px(), picture.height_px());
        if width_px.min(height_px) < TARGET_SIDE_MIN {
            return Err(AlignmentError::PictureTooSmall { name, width_px, height_px });
        }
    }
    let (photo, target) = (Pyramid::of(photo), Pyramid::of(target));
    let places = coarse::places(&target, &photo);
    let best = refine(&photo, &target, places);
    let correlation = best.map_or(0.0, |fit| fit.correlation);
    match best {
        Some(Fit { map, .. }) if correlation >= CORRELATION_MIN => Ok(FoundTarget { map, correlation }),
        _ => Err(AlignmentError::TargetNotFound { correlation }),
    }
}

/// Refines the places, step by step on finer details, and drops the worst of them.
fn refine(photo: &Pyramid, target: &Pyramid, places: Vec<CameraMap>) -> Option<Fit> {
    let (height, width) = (target.whole().height_px(), target.whole().width_px());
    let longer = height.max(width);
    let (first, last) = (target.step_near(longer as f64 / FIRST_PX), last_step(longer));
    let mut fits: Vec<Fit> = places.into_iter().map(|map| Fit { map, correlation: 0.0 }).collect();
    // A small target has fewer steps than there are stages, which then share its finest step.
    for stage in 0..STAGES.len().max(first.saturating_sub(last) + 1) {
        let (freedoms, kept) = STAGES[stage.min(STAGES.len() - 1)];
        let step = first.saturating_sub(stage).max(last.min(first));
        let details = target.details(step);
        let refine = |fit: Fit| {
            let camera_px = details.px() * fit.map.magnification(fit.map.target_centre());
            let photo = photo.details(photo.step_near(camera_px));
            freedoms.iter().fold(fit, |fit, &freedom| refined(&details, &photo, &fit.map, freedom))
        };
        fits = fits.into_par_iter().map(refine).filter(|fit| is_possible(&fit.map, [width, height])).collect();
        fits.sort_by(|a, b| b.correlation.total_cmp(&a.correlation));
        fits = distinct(&fits, kept, longer as f64);
    }
    fits.first().copied()
}

/// The first `kept` fits that are not nearly the same as a better one. `longer_px` is the target's longer side.
fn distinct(fits: &[Fit], kept: usize, longer_px: f64) -> Vec<Fit> {
    let place = |fit: &Fit| {
        let centre = fit.map.target_centre();
        (fit.map.apply(centre), fit.map.magnification(centre))
    };
    let mut others: Vec<Fit> = Vec::new();
    for fit in fits {
        let (at, magnification) = place(fit);
        let same = |other: &Fit| {
            let (there, scale) = place(other);
            let apart = (at[0] - there[0]).hypot(at[1] - there[1]) / (longer_px * scale);
            apart < SAME
                && (magnification / scale - 1.0).abs() < SAME
                && fit.map.is_mirrored() == other.map.is_mirrored()
        };
        if others.len() < kept && !others.iter().any(same) {
            others.push(*fit);
        }
    }
    others
}

/// Whether a camera can see a target of this size so: no corner lies at infinity, and no part is turned over or
/// strongly shrunk.
fn is_possible(map: &CameraMap, [width, height]: [usize; 2]) -> bool {
    let (right, bottom) = (width as f64 - 1.0, height as f64 - 1.0);
    let corners = [[0.0, 0.0], [right, 0.0], [0.0, bottom], [right, bottom]];
    let middle = map.magnification(map.target_centre());
    let alike = |magnification: f64| magnification > middle / SHRINKING_MAX && magnification < middle * SHRINKING_MAX;
    middle > 0.0 && corners.iter().all(|&corner| alike(map.magnification(corner)))
}
