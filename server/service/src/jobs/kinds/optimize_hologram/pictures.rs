//! Checks of the pictures in a request for holograms, before the request is answered.

use crate::call::Call;
use crate::error::Result;
use crate::field::Field;
use crate::jobs::Jobs;
use crate::wrong_fields::collect_all;
use lightpath_domain::dataset::Encoding;
use lightpath_domain::display::Display;
use lightpath_domain::job::OptimizeHologram;
use lightpath_media::pictures;
use lightpath_optics::{InitialPhase, Plane, RegionOfInterest};

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
                checks.push(self.check_phase(&field, phase).await.map(|()| 0));
            }
        }
        Ok(collect_all(checks)?.into_iter().max().unwrap_or(0))
    }

    /// Refuses a picture that is black everywhere in the region of interest. `dark` describes such a picture in the
    /// error. Returns the memory for decoding it \[bytes\].
    async fn check_light(&self, field: &Field, digest: &str, encoding: Encoding, dark: &str) -> Result<u64> {
        let (height_px, width_px) = self.size_px();
        let (fit, region) = (self.spec.target_fit, self.spec.region_of_interest);
        let key = format!("{digest} {encoding:?} {fit:?} {width_px}×{height_px} {region:?}");
        if let Some(bytes) = self.jobs.checked_targets.decoding_bytes(&key) {
            self.jobs.files.require_picture(self.call, field, digest).await?;
            return Ok(bytes);
        }
        let decode = move |bytes: &[u8]| {
            let target = pictures::target_intensity(bytes, encoding, fit, height_px, width_px)?;
            Ok(has_light(&target, region))
        };
        let (is_lit, decoding_bytes) = self.jobs.files.decoded(self.call, field, (digest, self.px()), decode).await?;
        if is_lit {
            self.jobs.checked_targets.insert(key, decoding_bytes);
            return Ok(decoding_bytes);
        }
        let problem =
            format!("({digest}): the picture is {dark} everywhere in the region of interest, but must have light");
        Err(field.invalid(problem))
    }

    /// Refuses a depth map that is not a picture. Returns the memory for decoding it \[bytes\].
    async fn check_depth_map(&self, field: &Field, digest: &str) -> Result<u64> {
        let ((height_px, width_px), fit) = (self.size_px(), self.spec.target_fit);
        let decode =
            move |bytes: &[u8]| pictures::target_intensity(bytes, Encoding::Linear, fit, height_px, width_px).map(drop);
        let ((), decoding_bytes) = self.jobs.files.decoded(self.call, field, (digest, self.px()), decode).await?;
        Ok(decoding_bytes)
    }

    /// Refuses an initial phase that is not an array of the display's size, with one frame after the other.
    async fn check_phase(&self, field: &Field, digest: &str) -> Result<()> {
        let ((height_px, width_px), frames) = (self.size_px(), self.spec.frames as usize);
        let decode = move |bytes: &[u8]| pictures::phase_npy(bytes, frames * height_px, width_px).map(drop);
        let fitted_px = self.px() * u64::from(self.spec.frames);
        self.jobs.files.decoded(self.call, field, (digest, fitted_px), decode).await.map(drop)
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

/// Whether a pixel in the region is not black.
fn has_light(target: &Plane<f32>, region: RegionOfInterest) -> bool {
    let mut rows = 0..target.height_px();
    rows.any(|y| region.columns(y).is_some_and(|columns| target.row(y)[columns].iter().any(|&v| v > 0.0)))
}
