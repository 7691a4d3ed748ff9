//! Computes the alignment of a dataset, and pictures that show it.

use super::reading::{CaptureError, Captures, size_error};
use super::{SHIFT_PX_MAX, STRETCH_PX_MAX, TURN_PX_MAX};
use crate::figures;
use crate::pictures::{SATURATED, SATURATION};
use lightpath_camera::alignment::{
    AlignmentError, CameraFit, CameraMap, DotGrid, Homography, Point, PointPair, Registration, warp,
};
use lightpath_domain::dataset;
use lightpath_optics::numerics::tiles::Tiles;
use lightpath_optics::{Plane, RegionOfInterest};

/// A computed alignment, with pictures.
#[derive(Clone, Debug)]
pub struct FoundAlignment {
    /// Map from pixels of the display to pixels of the photographs.
    pub map: CameraMap,
    /// Number of points, dots or tiles from which the alignment was computed.
    pub points: usize,
    /// Root mean square distance of the points from the alignment \[px of the display\].
    pub residual_px: f64,
    /// Root mean square displacement of the alignment from the previous one \[px of the display\].
    pub corrected_px: f64,
    /// Root mean square displacement by scale and shear that was left in the photographs \[px of the display\].
    pub left_px: f64,
    /// What was corrected and what was left, in words; empty for points and dots.
    pub explanation: String,
    /// PNG of a photograph before the alignment; empty if there is no photograph.
    pub before: Vec<u8>,
    /// PNG of the same photograph after the alignment, on the display's grid; empty if there is no photograph.
    pub after: Vec<u8>,
}

/// What an alignment from pairs corrects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Correction {
    /// The whole affine map: everything is taken for the camera's.
    Affine,
    /// The turn and the shift, if the turn is clearly there or the shift is more than learning can be expected to find.
    /// Scale and shear are corrected only above [`STRETCH_PX_MAX`], because they may be due to the modulator's surface.
    Camera,
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

/// A map, as a dataset stores it.
#[must_use]
pub fn stored_map(map: &CameraMap) -> dataset::CameraMap {
    dataset::CameraMap { homography: map.homography().entries(), distortion: map.distortion() }
}

/// Computes the alignment from points with their positions on the display and in photographs of the given rows and
/// columns. Many points tell the distortion of the lens, too.
///
/// # Errors
///
/// [`AlignmentError`] for fewer than 4 points, or points that do not determine a homography.
pub fn from_points(
    captures: &Captures,
    points: &[PointPair],
    photo_px: [usize; 2],
) -> Result<FoundAlignment, CaptureError> {
    let fit = CameraMap::from_points(points, [captures.height_px(), captures.width_px()], photo_px)?;
    Ok(fitted(captures, &fit, photo_px))
}

/// The alignment of a fit to points, without pictures.
fn fitted(captures: &Captures, fit: &CameraFit, photo_px: [usize; 2]) -> FoundAlignment {
    FoundAlignment {
        map: fit.map,
        points: fit.inliers,
        residual_px: fit.residual_px,
        corrected_px: moved_px(captures, &fit.map, photo_px),
        left_px: 0.0,
        explanation: String::new(),
        before: Vec::new(),
        after: Vec::new(),
    }
}

/// Computes the alignment from the photograph of the displayed grid of dots.
///
/// # Errors
///
/// [`AlignmentError`] for a photograph in which the grid is not found.
pub fn from_dots(captures: &Captures, photo: &Plane<f32>) -> Result<FoundAlignment, CaptureError> {
    let (height_px, width_px) = (captures.height_px(), captures.width_px());
    let found = DotGrid::of_display(height_px, width_px)?.find(photo)?;
    let photo_px = [photo.height_px(), photo.width_px()];
    let fit = CameraMap::from_points(&found.dots, [height_px, width_px], photo_px)?;
    let on_grid = warp(photo, &fit.map, height_px, width_px, SATURATION, SATURATED);
    let marks = |of: fn(&PointPair) -> Point| -> Vec<Point> { found.dots.iter().map(of).collect() };
    let before = figures::marked(photo, &marks(|dot| dot.camera), PICTURE_WIDTH_PX_MAX);
    let after = figures::marked(&on_grid, &marks(|dot| dot.display), PICTURE_WIDTH_PX_MAX);
    Ok(FoundAlignment { before: png(&before)?, after: png(&after)?, ..fitted(captures, &fit, photo_px) })
}

/// Computes the alignment from pairs: the reconstruction of a hologram on the ideal display, and its photograph in its
/// own size. `None`: too few features were recognized, the previous alignment could not be improved, or there is
/// nothing that [`Correction::Camera`] corrects. The distortion of the lens stays as the previous alignment has it.
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
    correction: Correction,
    mut next_photo: impl FnMut(usize) -> Result<(), E>,
) -> Result<Option<FoundAlignment>, E> {
    let Some((first_expected, first_photo)) = pairs.first() else { return Ok(None) };
    require_equal_sizes(pairs)?;
    let region = RegionOfInterest::middle(&captures.setup().grid());
    let photo_px = [first_photo.height_px(), first_photo.width_px()];
    let before = previous_map(captures, photo_px)?;
    let on_grid = |photo: &Plane<f32>, map: &CameraMap| {
        warp(photo, map, captures.height_px(), captures.width_px(), SATURATION, SATURATED)
    };
    let mut uses = 0;
    let mut register = |map: &CameraMap| -> Result<Option<Registration>, E> {
        let Some(mut tiles) = Tiles::cover(region) else { return Ok(None) };
        for (expected, photo) in pairs {
            next_photo(uses)?;
            uses += 1;
            tiles.add(expected, &on_grid(photo, map), SATURATION);
        }
        Ok(Registration::of(&tiles, region))
    };
    let Some(first) = register(&before)? else { return Ok(None) };
    let mut rounds = Rounds::begin(&before, first, correction);
    for _ in 1..ROUNDS_MAX {
        let Some(next) = register(&rounds.map)? else { return Ok(None) };
        if rounds.has_settled(next) {
            break;
        }
    }
    if !rounds.are_worth_it() {
        return Ok(None);
    }
    let picture = |map| png(&figures::overlay(first_expected, &on_grid(first_photo, map), PICTURE_WIDTH_PX_MAX));
    Ok(Some(FoundAlignment {
        points: rounds.last.tiles,
        residual_px: rounds.off_px(&rounds.last),
        corrected_px: moved_px(captures, &rounds.map, photo_px),
        left_px: if rounds.is_affine() { 0.0 } else { rounds.last.stretch_px },
        explanation: rounds.explanation(),
        before: picture(&before)?,
        after: picture(&rounds.map)?,
        map: rounds.map,
    }))
}

/// The rounds of an alignment from pairs.
struct Rounds {
    /// What was asked for.
    asked: Correction,
    first: Registration,
    last: Registration,
    map: CameraMap,
    /// Sum of the corrected turns \[px\].
    turn_px: f64,
}

impl Rounds {
    fn begin(before: &CameraMap, first: Registration, asked: Correction) -> Self {
        let mut rounds = Self { asked, first, last: first, map: *before, turn_px: 0.0 };
        rounds.correct(first);
        rounds
    }

    /// Takes in the registration of another round. True: there is nothing left to correct.
    fn has_settled(&mut self, next: Registration) -> bool {
        self.last = next;
        let settled = self.off_px(&next) < SETTLED_PX;
        if !settled {
            self.correct(next);
        }
        settled
    }

    fn correct(&mut self, found: Registration) {
        let step = if self.is_affine() { found.correction } else { found.rigid };
        self.map = self.map.after(&step);
        self.turn_px += found.turn_px;
    }

    /// Whether scale and shear are corrected.
    fn is_affine(&self) -> bool {
        self.asked == Correction::Affine || self.first.stretch_px > STRETCH_PX_MAX
    }

    /// Root mean square of the displacement that is to be corrected.
    fn off_px(&self, found: &Registration) -> f64 {
        if self.is_affine() { found.misalignment_px } else { found.shift_px.hypot(found.turn_px) }
    }

    fn are_worth_it(&self) -> bool {
        let is_turned = self.turn_px.abs() > TURN_PX_MAX.max(self.last.turn_uncertainty_px);
        let is_needed = self.is_affine() || is_turned || self.first.shift_px > SHIFT_PX_MAX;
        is_needed && self.off_px(&self.last) < self.off_px(&self.first)
    }

    fn explanation(&self) -> String {
        let Registration { shift_px, stretch_px, .. } = self.first;
        let (turn_px, uncertainty_px) = (self.turn_px.abs(), self.last.turn_uncertainty_px);
        let rigid = format!("a shift of {shift_px:.2} px and a turn of {turn_px:.2} ± {uncertainty_px:.2} px");
        let affine = format!("corrects {rigid}, and {stretch_px:.2} px of scale and shear");
        match (self.asked, self.is_affine()) {
            (Correction::Affine, _) => format!("{affine}, which are taken for the camera's, as asked"),
            (Correction::Camera, true) => format!(
                "{affine}, which are taken for the camera's because they are more than the {STRETCH_PX_MAX} px that \
                 learning can be expected to find"
            ),
            (Correction::Camera, false) => format!(
                "corrects {rigid}; leaves {:.2} px of scale and shear to learning, because they may be the camera's or the \
                 modulator's surface",
                self.last.stretch_px
            ),
        }
    }
}

/// Gives the error of a photograph whose size differs from that of the first one.
fn require_equal_sizes(pairs: &[(Plane<f32>, Plane<f32>)]) -> Result<(), CaptureError> {
    let size = |photo: &Plane<f32>| (photo.height_px(), photo.width_px());
    let Some(expected) = pairs.first().map(|(_, photo)| size(photo)) else { return Ok(()) };
    match pairs.iter().map(|(_, photo)| size(photo)).find(|size| *size != expected) {
        Some(actual) => Err(size_error(expected, actual, "the first photograph of the dataset has this size")),
        None => Ok(()),
    }
}

/// The map of the alignment so far. Without one, a camera pixel is a pixel of the display.
fn previous_map(captures: &Captures, photo_px: [usize; 2]) -> Result<CameraMap, CaptureError> {
    let display_px = [captures.height_px(), captures.width_px()];
    let same = || CameraMap::try_new(&Homography::IDENTITY, [0.0; 4], display_px, photo_px);
    Ok(captures.map().map_or_else(same, Ok)?)
}

/// Root mean square displacement of a new alignment from the previous one, over the region of interest \[px of the
/// display\].
fn moved_px(captures: &Captures, map: &CameraMap, photo_px: [usize; 2]) -> f64 {
    let Ok(before) = previous_map(captures, photo_px) else { return f64::NAN };
    let region = RegionOfInterest::middle(&captures.setup().grid());
    const STEPS: usize = 8;
    let along = |start: usize, length: usize, i: usize| start as f64 + (length - 1) as f64 * i as f64 / STEPS as f64;
    let squared = |i: usize| {
        let x = along(region.x_px(), region.width_px(), i % (STEPS + 1));
        let y = along(region.y_px(), region.height_px(), i / (STEPS + 1));
        let (old, new) = (before.apply([x, y]), map.apply([x, y]));
        (((new[0] - old[0]).powi(2)) + (new[1] - old[1]).powi(2)) / before.magnification([x, y]).powi(2)
    };
    let count = (STEPS + 1) * (STEPS + 1);
    ((0..count).map(squared).sum::<f64>() / count as f64).sqrt()
}

fn png(canvas: &figures::Canvas) -> Result<Vec<u8>, CaptureError> {
    canvas.png().map_err(|error| crate::pictures::PictureError::Encode(error.to_string()).into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_bench::TestCard;
    use lightpath_domain::dataset::{Dataset, Encoding};
    use lightpath_domain::display::Display;
    use lightpath_domain::units::{Distance, Wavelength};

    const SIZE_PX: [usize; 2] = [216, 384];

    fn lab() -> Display {
        Display {
            id: "lab".into(),
            width_px: SIZE_PX[1] as u32,
            height_px: SIZE_PX[0] as u32,
            pixel_pitch_m: 8e-6,
            bit_depth: 8,
            wavelengths: vec![Wavelength::from_m(515e-9).unwrap()],
            phase_response_rad: None,
            carrier: None,
            orders: Default::default(),
            camera_fill_factor: 1.0,
            notes: String::new(),
            simulated_bench: None,
        }
    }

    fn dataset_of_lab() -> Dataset {
        let (wavelength, distance) = (Wavelength::from_m(515e-9).unwrap(), Distance::from_m(0.05).unwrap());
        Dataset::empty("d".into(), "lab".into(), wavelength, distance, Encoding::Linear)
    }

    fn captures() -> Captures {
        Captures::of(&lab(), &dataset_of_lab()).unwrap()
    }

    /// Cards, and photographs of them by a camera that is turned and shifted, and makes everything larger.
    fn aligned(degrees: f64, scale: f64, shift_px: f64, correction: Correction) -> Option<FoundAlignment> {
        let centre = [191.5, 107.5];
        let map = Homography::similarity(centre, degrees.to_radians(), scale, [shift_px, 0.0]);
        let pairs: Vec<_> = (0..4)
            .map(|n| {
                let card =
                    TestCard::ALL[n].render(SIZE_PX[0], SIZE_PX[1], n as u64).unwrap().map(|light| 0.1 + 0.7 * light);
                let photo = warp(&card, &map.inverse(), SIZE_PX[0], SIZE_PX[1], 9.0, 0.1);
                (card, photo)
            })
            .collect();
        from_pairs::<CaptureError>(&captures(), &pairs, correction, |_| Ok(())).unwrap()
    }

    #[test]
    fn camera_alignment_corrects_turn_and_shift_and_leaves_scale() {
        let found = aligned(0.6, 1.01, 1.0, Correction::Camera).unwrap();
        let [cosine, minus_sine, _, sine, ..] = found.map.homography().entries();
        assert!((cosine - 1.0).abs() < 1e-3 && (sine + minus_sine).abs() < 1e-9, "{:?}", found.map);
        assert!((sine.to_degrees() - 0.6).abs() < 0.03, "{:?}", found.map);
        assert!((found.left_px - 1.0).abs() < 0.15, "{}", found.left_px);
        assert!(
            found.explanation.contains("leaves 1.0") || found.explanation.contains("leaves 0.9"),
            "{}",
            found.explanation
        );
        let whole = aligned(0.6, 1.01, 1.0, Correction::Affine).unwrap();
        let point = whole.map.apply([300.0, 60.0]);
        let truth = Homography::similarity([191.5, 107.5], 0.6_f64.to_radians(), 1.01, [1.0, 0.0]).apply([300.0, 60.0]);
        assert!((point[0] - truth[0]).hypot(point[1] - truth[1]) < 0.1 && whole.left_px == 0.0, "{point:?}, {truth:?}");
    }

    /// The map from a photograph's pixels to the display's, of a lens that moves corners by 1.2 % of their distance.
    fn back_through_lens() -> CameraMap {
        let turn = Homography::similarity([191.5, 107.5], 0.01, 0.97, [1.0, -2.0]);
        CameraMap::try_new(&turn, [0.012, 0.0, 0.0, 0.0], SIZE_PX, SIZE_PX).unwrap()
    }

    fn off_px(map: &CameraMap) -> f64 {
        [[40.0, 22.0], [344.0, 22.0], [191.5, 107.5], [40.0, 194.0], [344.0, 194.0]]
            .map(|place| {
                let found = map.apply(back_through_lens().apply(place));
                (found[0] - place[0]).hypot(found[1] - place[1])
            })
            .into_iter()
            .fold(0.0, f64::max)
    }

    #[test]
    fn dots_tell_the_distortion_of_the_lens() {
        let dots = target(SIZE_PX[0], SIZE_PX[1]).unwrap();
        let photo = warp(&dots, &back_through_lens(), SIZE_PX[0], SIZE_PX[1], 9.0, 0.0);
        let found = from_dots(&captures(), &photo).unwrap();
        // A dot is found within a tenth of a pixel.
        assert!(off_px(&found.map) < 0.12, "{} px off", off_px(&found.map));
        let dots = DotGrid::of_display(SIZE_PX[0], SIZE_PX[1]).unwrap().find(&photo).unwrap().dots;
        let given = from_points(&captures(), &dots, SIZE_PX).unwrap();
        assert_eq!((given.map, given.points), (found.map, found.points));
        let straight: Vec<PointPair> = dots.iter().map(|dot| PointPair { camera: dot.display, ..*dot }).collect();
        assert_eq!(from_points(&captures(), &straight, SIZE_PX).unwrap().map.distortion(), [0.0; 4]);
    }

    #[test]
    fn alignment_from_pairs_keeps_the_distortion() {
        let dots = target(SIZE_PX[0], SIZE_PX[1]).unwrap();
        let photo = warp(&dots, &back_through_lens(), SIZE_PX[0], SIZE_PX[1], 9.0, 0.0);
        let found = from_dots(&captures(), &photo).unwrap();
        // Someone has pushed the camera since.
        let pushed = found.map.after(&Homography::similarity([0.0; 2], 0.0, 1.0, [3.0, 1.0]));
        let mut dataset = dataset_of_lab();
        dataset.alignment = Some(dataset::Alignment {
            method: dataset::AlignmentMethod::Dots,
            map: stored_map(&pushed),
            photo_height_px: SIZE_PX[0] as u32,
            photo_width_px: SIZE_PX[1] as u32,
            points: 100,
            residual_px: 0.0,
            corrected_px: 0.0,
            left_px: 0.0,
            explanation: String::new(),
            photo: String::new(),
            before: String::new(),
            after: String::new(),
        });
        let captures = Captures::of(&lab(), &dataset).unwrap();
        assert_eq!(captures.stored_map(), dataset.camera_map());
        let pairs: Vec<_> = (0..4)
            .map(|n| {
                let card =
                    TestCard::ALL[n].render(SIZE_PX[0], SIZE_PX[1], n as u64).unwrap().map(|light| 0.1 + 0.7 * light);
                let photo = warp(&card, &back_through_lens(), SIZE_PX[0], SIZE_PX[1], 9.0, 0.1);
                (card, photo)
            })
            .collect();
        let again = from_pairs::<CaptureError>(&captures, &pairs, Correction::Camera, |_| Ok(())).unwrap().unwrap();
        assert_eq!(again.map.distortion(), found.map.distortion());
        assert!(off_px(&pushed) > 2.5 && off_px(&again.map) < 0.1, "{} px off", off_px(&again.map));
    }

    #[test]
    fn camera_alignment_needs_a_clear_turn_or_a_large_shift() {
        assert!(aligned(0.0, 1.01, 1.0, Correction::Camera).is_none());
        assert!(aligned(0.0, 1.01, 1.0, Correction::Affine).is_some());
        let shifted = aligned(0.0, 1.01, 2.5, Correction::Camera).unwrap();
        assert!((shifted.map.homography().entries()[0] - 1.0).abs() < 1e-3, "{:?}", shifted.map);
        // A scale that no surface makes.
        let enlarged = aligned(0.0, 1.05, 0.0, Correction::Camera).unwrap();
        assert!((enlarged.map.homography().entries()[0] - 1.05).abs() < 2e-3, "{:?}", enlarged.map);
        assert!(enlarged.explanation.contains("because they are more than the 2 px"), "{}", enlarged.explanation);
    }
}
