//! Computes the alignment of a dataset, and pictures that show it.

use super::reading::{CaptureError, Captures};
use crate::figures;
use crate::pictures::{SATURATED, SATURATION};
use lightpath_optics::alignment::{AlignmentError, DotGrid, Homography, Point, PointPair, Registration, Tiles, warp};
use lightpath_optics::{Plane, RegionOfInterest};

/// A computed alignment, with pictures.
#[derive(Clone, Debug)]
pub struct FoundAlignment {
    /// Map from pixels of the display to pixels of the photographs.
    pub homography: Homography,
    /// Number of points, dots or tiles from which the alignment was computed.
    pub points: usize,
    /// Root mean square distance of the points from the alignment \[px of the display\].
    pub residual_px: f64,
    /// Root mean square displacement of the alignment from the previous one \[px of the display\].
    pub corrected_px: f64,
    /// PNG of a photograph before the alignment; empty if there is no photograph.
    pub before: Vec<u8>,
    /// PNG of the same photograph after the alignment, on the display's grid; empty if there is no photograph.
    pub after: Vec<u8>,
}

/// Largest number of rounds of refinement. Each round leaves about a tenth of the error.
pub const ROUNDS_MAX: usize = 6;
/// Refinement ends when the correction is smaller than this \[px\].
const SETTLED_PX: f64 = 0.01;
/// Largest width of the pictures \[px\].
const PICTURE_WIDTH_PX_MAX: u32 = 960;

/// The calibration target, in linear light. Its hologram is displayed and photographed for an alignment.
///
/// # Errors
///
/// [`AlignmentError::DisplayTooSmall`] for a display that is too small for the dots.
pub fn target(height_px: usize, width_px: usize) -> Result<Plane<f32>, AlignmentError> {
    Ok(DotGrid::of_display(height_px, width_px)?.target())
}

/// Computes the alignment from points with their positions on the display and in the photographs.
///
/// # Errors
///
/// [`AlignmentError`] for fewer than 4 points, or points that do not determine a homography.
pub fn from_points(captures: &Captures, points: &[PointPair]) -> Result<FoundAlignment, CaptureError> {
    let fit = Homography::from_points(points)?;
    Ok(FoundAlignment {
        points: fit.inliers,
        residual_px: fit.residual_px,
        corrected_px: moved_px(captures, &fit.homography),
        homography: fit.homography,
        before: Vec::new(),
        after: Vec::new(),
    })
}

/// Computes the alignment from the photograph of the displayed grid of dots.
///
/// # Errors
///
/// [`AlignmentError`] for a photograph in which the grid is not found.
pub fn from_dots(captures: &Captures, photo: &Plane<f32>) -> Result<FoundAlignment, CaptureError> {
    let (height_px, width_px) = (captures.height_px(), captures.width_px());
    let found = DotGrid::of_display(height_px, width_px)?.find(photo)?;
    let homography = found.fit.homography;
    let on_grid = warp(photo, &homography, height_px, width_px, SATURATION, SATURATED);
    let marks = |of: fn(&PointPair) -> Point| -> Vec<Point> { found.dots.iter().map(of).collect() };
    let before = figures::marked(photo, &marks(|dot| dot.camera), PICTURE_WIDTH_PX_MAX);
    let after = figures::marked(&on_grid, &marks(|dot| dot.display), PICTURE_WIDTH_PX_MAX);
    Ok(FoundAlignment {
        points: found.fit.inliers,
        residual_px: found.fit.residual_px,
        corrected_px: moved_px(captures, &homography),
        homography,
        before: png(&before)?,
        after: png(&after)?,
    })
}

/// Computes the alignment from pairs: the reconstruction of a hologram on the ideal display, and its photograph in its
/// own size. `None`: too few features were recognized, or the previous alignment could not be improved.
///
/// Before each use of a photograph, `next_photo` is called with the number of uses so far. Each photograph is used at
/// most [`ROUNDS_MAX`] times.
///
/// # Errors
///
/// [`CaptureError::Size`] for photographs of different sizes, and errors of `next_photo`.
pub fn from_pairs<E: From<CaptureError>>(
    captures: &Captures,
    pairs: &[(Plane<f32>, Plane<f32>)],
    mut next_photo: impl FnMut(usize) -> Result<(), E>,
) -> Result<Option<FoundAlignment>, E> {
    let Some((first_expected, first_photo)) = pairs.first() else { return Ok(None) };
    let (height_px, width_px) = (first_photo.height_px(), first_photo.width_px());
    for (_, photo) in pairs {
        // Gives the error of a photograph whose size differs from that of the first one.
        if (photo.height_px(), photo.width_px()) != (height_px, width_px) {
            captures.realigned(Homography::IDENTITY, height_px, width_px).on_grid(photo.clone()).map_err(E::from)?;
        }
    }
    let region = RegionOfInterest::middle(&captures.setup().grid());
    let before = captures.homography().unwrap_or(Homography::IDENTITY);
    let on_grid = |photo: &Plane<f32>, homography: &Homography| {
        warp(photo, homography, captures.height_px(), captures.width_px(), SATURATION, SATURATED)
    };
    let mut uses = 0;
    let mut register = |homography: &Homography| -> Result<Option<Registration>, E> {
        let Some(mut tiles) = Tiles::cover(region) else { return Ok(None) };
        for (expected, photo) in pairs {
            next_photo(uses)?;
            uses += 1;
            tiles.add(expected, &on_grid(photo, homography), SATURATION);
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
        |homography| png(&figures::overlay(first_expected, &on_grid(first_photo, homography), PICTURE_WIDTH_PX_MAX));
    Ok(Some(FoundAlignment {
        points: last.tiles,
        residual_px: last.misalignment_px,
        corrected_px: moved_px(captures, &homography),
        before: picture(&before)?,
        after: picture(&homography)?,
        homography,
    }))
}

/// Root mean square displacement of a new alignment from the previous one, over the region of interest \[px of the
/// display\].
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
