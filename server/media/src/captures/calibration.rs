//! A dataset's alignment: found, and shown.

use super::reading::{CaptureError, Captures, LEFT_OUT};
use crate::figures;
use crate::pictures::SATURATED;
use lightpath_optics::alignment::{AlignmentError, DotGrid, Homography, Point, PointPair, Registration, Tiles, warp};
use lightpath_optics::{Plane, RegionOfInterest};

/// An alignment, with pictures.
#[derive(Clone, Debug)]
pub struct Solved {
    /// From the display's pixels to the photographs'.
    pub homography: Homography,
    /// Points, dots or tiles that it rests on.
    pub points: usize,
    /// Root mean square distance of those from it \[px of the display\].
    pub residual_px: f64,
    /// Root mean square displacement from the alignment before \[px of the display\].
    pub corrected_px: f64,
    /// PNG of a photograph as it is; empty where there is none.
    pub before: Vec<u8>,
    /// PNG of it on the display's grid.
    pub after: Vec<u8>,
}

/// Rounds of refinement: each leaves about a tenth of the error before.
pub const ROUNDS_MAX: usize = 6;
/// A correction below this is none \[px\].
const SETTLED_PX: f64 = 0.01;
/// Pictures are no wider than this \[px\].
const PICTURE_WIDTH_PX_MAX: u32 = 960;

/// The picture whose hologram is displayed for calibration: linear light.
///
/// # Errors
///
/// [`AlignmentError::DisplayTooSmall`].
pub fn target(height_px: usize, width_px: usize) -> Result<Plane<f32>, AlignmentError> {
    Ok(DotGrid::of_display(height_px, width_px)?.target())
}

/// From points of the display and where the photographs show them.
///
/// # Errors
///
/// [`AlignmentError`] for fewer than 4 points, or points that fix no homography.
pub fn from_points(captures: &Captures, points: &[PointPair]) -> Result<Solved, CaptureError> {
    let fit = Homography::from_points(points)?;
    Ok(Solved {
        points: fit.inliers,
        residual_px: fit.residual_px,
        corrected_px: moved_px(captures, &fit.homography),
        homography: fit.homography,
        before: Vec::new(),
        after: Vec::new(),
    })
}

/// From the photograph of the displayed grid of dots.
///
/// # Errors
///
/// [`AlignmentError`] where the grid is not found in it.
pub fn from_dots(captures: &Captures, photo: &Plane<f32>) -> Result<Solved, CaptureError> {
    let (height_px, width_px) = (captures.height_px(), captures.width_px());
    let found = DotGrid::of_display(height_px, width_px)?.find(photo)?;
    let homography = found.fit.homography;
    let on_grid = warp(photo, &homography, height_px, width_px, LEFT_OUT, SATURATED);
    let marks = |of: fn(&PointPair) -> Point| -> Vec<Point> { found.dots.iter().map(of).collect() };
    let before = figures::marked(photo, &marks(|dot| dot.camera), PICTURE_WIDTH_PX_MAX);
    let after = figures::marked(&on_grid, &marks(|dot| dot.display), PICTURE_WIDTH_PX_MAX);
    Ok(Solved {
        points: found.fit.inliers,
        residual_px: found.fit.residual_px,
        corrected_px: moved_px(captures, &homography),
        homography,
        before: png(&before)?,
        after: png(&after)?,
    })
}

/// From what holograms should show on the ideal display, each with the photograph of it in its own size. `None` where too
/// little is recognized, or nothing is gained. Before a photograph is looked at, `next_photo` is
/// told how many times that was done, [`ROUNDS_MAX`] times for each photograph at most.
///
/// # Errors
///
/// [`CaptureError::Size`] for photographs of different sizes; what `next_photo` says.
pub fn from_pairs<E: From<CaptureError>>(
    captures: &Captures,
    pairs: &[(Plane<f32>, Plane<f32>)],
    mut next_photo: impl FnMut(usize) -> Result<(), E>,
) -> Result<Option<Solved>, E> {
    let Some((first_expected, first_photo)) = pairs.first() else { return Ok(None) };
    let (height_px, width_px) = (first_photo.height_px(), first_photo.width_px());
    for (_, photo) in pairs {
        // Refuses what does not fit the alignment before.
        if (photo.height_px(), photo.width_px()) != (height_px, width_px) {
            captures.realigned(Homography::IDENTITY, height_px, width_px).on_grid(photo.clone()).map_err(E::from)?;
        }
    }
    let region = RegionOfInterest::middle(&captures.setup().grid());
    let before = captures.homography().unwrap_or(Homography::IDENTITY);
    let seen = |photo: &Plane<f32>, homography: &Homography| {
        warp(photo, homography, captures.height_px(), captures.width_px(), LEFT_OUT, SATURATED)
    };
    let mut looked_at = 0;
    let mut register = |homography: &Homography| -> Result<Option<Registration>, E> {
        let Some(mut tiles) = Tiles::cover(region) else { return Ok(None) };
        for (expected, photo) in pairs {
            next_photo(looked_at)?;
            looked_at += 1;
            tiles.add(expected, &seen(photo, homography), LEFT_OUT);
        }
        Ok(tiles.register(region))
    };
    let Some(first) = register(&before)? else { return Ok(None) };
    let (mut homography, mut last) = (before.after(&first.correction), first);
    for _ in 1..ROUNDS_MAX {
        let Some(next) = register(&homography)? else { return Ok(None) };
        last = next;
        if next.misalignment_px < SETTLED_PX {
            break;
        }
        homography = homography.after(&next.correction);
    }
    if last.misalignment_px >= first.misalignment_px {
        return Ok(None);
    }
    let picture =
        |homography| png(&figures::overlay(first_expected, &seen(first_photo, homography), PICTURE_WIDTH_PX_MAX));
    Ok(Some(Solved {
        points: last.tiles,
        residual_px: last.misalignment_px,
        corrected_px: moved_px(captures, &homography),
        before: picture(&before)?,
        after: picture(&homography)?,
        homography,
    }))
}

/// Root mean square displacement that a new alignment makes \[px of the display\], over the region of interest.
fn moved_px(captures: &Captures, homography: &Homography) -> f64 {
    let before = captures.homography().unwrap_or(Homography::IDENTITY).inverse();
    let region = RegionOfInterest::middle(&captures.setup().grid());
    const STEPS: usize = 8;
    let along = |start: usize, length: usize, i: usize| start as f64 + (length - 1) as f64 * i as f64 / STEPS as f64;
    let squared = |i: usize| {
        let x = along(region.x_px(), region.width_px(), i % (STEPS + 1));
        let y = along(region.y_px(), region.height_px(), i / (STEPS + 1));
        let moved = before.apply(homography.apply([x, y]));
        (moved[0] - x).powi(2) + (moved[1] - y).powi(2)
    };
    let count = (STEPS + 1) * (STEPS + 1);
    ((0..count).map(squared).sum::<f64>() / count as f64).sqrt()
}

fn png(canvas: &figures::Canvas) -> Result<Vec<u8>, CaptureError> {
    canvas.png().map_err(|error| crate::pictures::PictureError::Encode(error.to_string()).into())
}
