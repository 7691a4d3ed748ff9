//! Checks of the pictures in a request for holograms, before the request is answered.

use crate::call::Call;
use crate::error::Result;
use crate::field::Field;
use crate::jobs::Jobs;
use crate::wrong_fields::collect_all;
use lightpath_domain::dataset::Encoding;
use lightpath_domain::display::Display;
use lightpath_domain::job::{Fit, ImagePlane, OptimizeHologram, nearest_planes, pixels_of_planes};
use lightpath_media::pictures::{self, Placement};
use lightpath_optics::{InitialPhase, Plane, RegionOfInterest};

/// Largest ratio of the shapes, width by height, of a target and a depth map that belong together: a smaller map has its
/// sides rounded to whole pixels.
const SHAPE_RATIO_MAX: f64 = 1.02;

/// The pictures of one request, and the settings for their checks.
#[derive(Debug)]
pub(super) struct PictureChecks<'a> {
    pub(super) jobs: &'a Jobs,
    pub(super) call: &'a Call,
    pub(super) spec: &'a OptimizeHologram,
    pub(super) display: &'a Display,
}

impl PictureChecks<'_> {
    /// Decodes every picture, so that a wrong picture is refused now. `field` is the path of the request. Returns the
    /// largest memory for decoding one of them \[bytes\].
    pub(super) async fn check(&self, field: &Field) -> Result<u64> {
        let mut checks = Vec::new();
        for (p, plane) in self.spec.planes.iter().enumerate() {
            // With a depth map the planes usually have the same target.
            if !self.spec.planes[..p].iter().any(|before| before.target == plane.target) {
                let field = field.at("planes").index(p).at("target");
                checks.push(self.check_light(&field, &plane.target, self.spec.target_encoding, "black").await);
            }
        }
        if let Some(map) = &self.spec.depth_map {
            checks.push(self.check_depth_map(&field.at("depth_map"), map).await);
        }
        if let Some(mask) = &self.spec.weight_mask {
            checks.push(self.check_light(&field.at("weight_mask"), mask, Encoding::Linear, "a black mask").await);
        }
        if let InitialPhase::Given(phases) = &self.spec.initial_phase {
            for (i, phase) in phases.iter().enumerate() {
                let field = field.at("initial_phase").at("given").at("phases").index(i);
                checks.push(self.check_phase(&field, phase, phases.len()).await.map(|()| 0));
            }
        }
        Ok(collect_all(checks)?.into_iter().max().unwrap_or(0))
    }

    /// Refuses a picture that is black everywhere in the region of interest. `dark` describes such a picture in the
    /// error. Returns the memory for decoding it \[bytes\].
    async fn check_light(&self, field: &Field, digest: &str, encoding: Encoding, dark: &str) -> Result<u64> {
        let (placement, region) = (self.placement(), self.spec.region_of_interest);
        let key = format!("{digest} {encoding:?} {placement:?} {region:?}");
        if let Some(bytes) = self.jobs.checked_targets.decoding_bytes(&key) {
            self.jobs.files.require_picture(self.call, field, digest).await?;
            return Ok(bytes);
        }
        let decode = move |bytes: &[u8]| {
            let target = pictures::target_intensity(bytes, encoding, &placement)?;
            Ok(has_light(&target, region))
        };
        let (is_lit, decoding_bytes) = self.jobs.files.decoded(self.call, field, (digest, self.px()), decode).await?;
        if is_lit {
            self.jobs.checked_targets.insert(key, decoding_bytes);
            return Ok(decoding_bytes);
        }
        let problem = format!("({digest}): the picture is {dark} everywhere in the region of interest");
        Err(field.but(problem, "must have light"))
    }

    /// Refuses a depth map that is not a picture, that has another shape than a target, or that gives all pixels to one
    /// plane. Returns the memory for decoding it \[bytes\].
    async fn check_depth_map(&self, field: &Field, digest: &str) -> Result<u64> {
        let placement = self.placement();
        let (planes, region) = (self.spec.planes.clone(), self.spec.region_of_interest);
        let decode = move |bytes: &[u8]| {
            let depth = pictures::target_intensity(bytes, Encoding::Linear, &placement)?;
            Ok((pictures::picture_size(bytes)?, one_plane(&depth, &planes, region)))
        };
        let ((size, problem), decoding_bytes) =
            self.jobs.files.decoded(self.call, field, (digest, self.px()), decode).await?;
        if matches!(placement.fit, Fit::Contain | Fit::Cover) {
            self.require_shape(field, digest, size).await?;
        }
        match problem {
            Some(problem) => Err(field.invalid(format!("({digest}): {problem}"), DEPTHS_QUESTION)),
            None => Ok(decoding_bytes),
        }
    }

    /// Refuses a depth map whose pixels would not lie on those of a target, because their shapes differ.
    async fn require_shape(&self, field: &Field, digest: &str, (width_px, height_px): (u32, u32)) -> Result<()> {
        let mut checked: Vec<&str> = Vec::new();
        for plane in &self.spec.planes {
            if checked.contains(&plane.target.as_str()) {
                continue;
            }
            checked.push(&plane.target);
            let decoded = self.jobs.files.decoded(self.call, field, (&plane.target, self.px()), pictures::picture_size);
            let ((target_width_px, target_height_px), _) = decoded.await?;
            let ratio = (f64::from(width_px) * f64::from(target_height_px))
                / (f64::from(height_px) * f64::from(target_width_px));
            if !(1.0 / SHAPE_RATIO_MAX..=SHAPE_RATIO_MAX).contains(&ratio) {
                let problem = format!(
                    "({digest}): the depth map has {width_px}×{height_px} px, but the target has \
                     {target_width_px}×{target_height_px} px, so their pixels do not belong together"
                );
                let fix = "give a map of the target's shape, or target_fit STRETCH if both show the same view";
                return Err(field.invalid(problem, fix));
            }
        }
        Ok(())
    }

    /// Refuses an initial phase, one of `files`, that is no hologram of the display's size. One file for each wavelength
    /// has all its subframes.
    async fn check_phase(&self, field: &Field, digest: &str, files: usize) -> Result<()> {
        let ((height_px, width_px), bit_depth) = (self.size_px(), self.display.bit_depth);
        let frames = self.spec.subframes as usize * self.spec.wavelengths.len() / files;
        let decode =
            move |bytes: &[u8]| pictures::hologram_of_frames(bytes, bit_depth, frames, [height_px, width_px]).map(drop);
        let fitted_px = self.px() * frames as u64;
        self.jobs.files.decoded(self.call, field, (digest, fitted_px), decode).await.map(drop)
    }

    /// Where the pictures go on the display.
    fn placement(&self) -> Placement {
        let (height_px, width_px) = self.size_px();
        let area = self.spec.filled().map(Into::into);
        Placement { fit: self.spec.target_fit, area, height_px, width_px }
    }

    /// Number of pixels of the display.
    fn px(&self) -> u64 {
        u64::from(self.display.height_px) * u64::from(self.display.width_px)
    }

    /// Height and width of the display \[px\].
    fn size_px(&self) -> (usize, usize) {
        (self.display.height_px as usize, self.display.width_px as usize)
    }
}

const DEPTHS_QUESTION: &str =
    "are they depths in another scale, such as millimetres in 16 bits? Then scale them to the whole range";

/// What is wrong with a depth map that gives all pixels of the region to one plane: it says nothing, or its depths are in
/// another scale, such as millimetres.
fn one_plane(depth: &Plane<f32>, planes: &[ImagePlane], region: RegionOfInterest) -> Option<String> {
    let pixels = pixels_of_planes(&nearest_planes(depth, planes), planes.len(), region);
    let (of_none, of_some): (Vec<_>, Vec<_>) = planes.iter().zip(pixels).partition(|(_, pixels)| *pixels == 0);
    let [(only, _)] = of_some[..] else { return None };
    let rows = (0..depth.height_px()).filter_map(|y| Some(&depth.row(y)[region.columns(y)?]));
    let values = rows.flatten().copied().fold([1.0, 0.0], |[least, most]: [f32; 2], v| [least.min(v), most.max(v)]);
    let empty: Vec<String> = of_none.iter().map(|(plane, _)| plane.distance.to_string()).collect();
    let [least, most] = values.map(|value| 100.0 * value);
    Some(format!(
        "all pixels belong to {}, and none to {}: the map's values are {least:.2} to {most:.2} % of full scale, where white \
         is the first distance and black the last",
        only.distance,
        empty.join(", ")
    ))
}

/// Whether a pixel in the region is not black.
fn has_light(target: &Plane<f32>, region: RegionOfInterest) -> bool {
    let mut rows = 0..target.height_px();
    rows.any(|y| region.columns(y).is_some_and(|columns| target.row(y)[columns].iter().any(|&v| v > 0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_domain::units::Distance;
    use lightpath_optics::Grid;

    #[test]
    fn depth_maps_that_give_all_pixels_to_one_plane_are_questioned() {
        let plane =
            |mm: f64| ImagePlane { distance: Distance::from_m(mm * 1e-3).unwrap(), target: String::new(), weight: 1.0 };
        let planes = [plane(20.0), plane(30.0), plane(40.0)];
        let region = RegionOfInterest::middle(&Grid::try_new(20, 20, 8e-6).unwrap());
        let questioned =
            |value: &dyn Fn(usize) -> f32| one_plane(&Plane::from_fn(20, 20, |y, _| value(y)), &planes, region);
        // 600 to 1500 mm in 16 bits; white outside the region does not help.
        let millimetres = |y: usize| if y == 0 { 1.0 } else { (600.0 + 50.0 * y as f32) / 65535.0 };
        let problem = questioned(&millimetres).unwrap();
        assert!(
            problem.starts_with("all pixels belong to 40mm, and none to 20mm, 30mm: the map's values are"),
            "{problem}"
        );
        assert!(questioned(&|_| 1.0).unwrap().starts_with("all pixels belong to 20mm, and none to 30mm, 40mm"));
        assert_eq!(questioned(&|y| y as f32 / 19.0), None);
        assert_eq!(questioned(&|y| if y < 10 { 0.5 } else { 0.0 }), None);
    }
}
