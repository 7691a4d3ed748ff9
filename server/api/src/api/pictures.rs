//! Checking pictures while their sender still listens.

use super::Api;
use super::error::ApiError;
use super::field::Field;
use lightpath_domain::dataset::Encoding;
use lightpath_domain::display::Display;
use lightpath_domain::job::{OptimizeHologram, Region};
use lightpath_media::pictures::{self, PictureError};
use lightpath_optics::Plane;
use std::sync::Arc;

impl Api {
    /// A target must be a picture with some light where it counts.
    pub(super) async fn check_target(
        &self,
        field: &Field,
        spec: &OptimizeHologram,
        digest: &str,
        display: &Display,
    ) -> Result<(), ApiError> {
        self.check_light(field, spec, digest, spec.target_encoding, display, "black").await
    }

    /// A mask must let some of the region of interest count.
    pub(super) async fn check_mask(
        &self,
        field: &Field,
        spec: &OptimizeHologram,
        digest: &str,
        display: &Display,
    ) -> Result<(), ApiError> {
        self.check_light(field, spec, digest, Encoding::Linear, display, "a black mask").await
    }

    /// Any picture.
    pub(super) async fn check_grey(
        &self,
        field: &Field,
        spec: &OptimizeHologram,
        digest: &str,
        display: &Display,
    ) -> Result<(), ApiError> {
        let ((height_px, width_px), fit) = (size_of(display), spec.target_fit);
        let decode =
            move |bytes: &[u8]| pictures::target_intensity(bytes, Encoding::Linear, fit, height_px, width_px).map(drop);
        self.decoded(field, digest, decode).await
    }

    /// An initial phase must be an array of the display's size, frame after frame.
    pub(super) async fn check_phase(
        &self,
        field: &Field,
        digest: &str,
        frames: u32,
        display: &Display,
    ) -> Result<(), ApiError> {
        let (height_px, width_px) = size_of(display);
        let decode = move |bytes: &[u8]| pictures::phase_npy(bytes, frames as usize * height_px, width_px).map(drop);
        self.decoded(field, digest, decode).await
    }

    async fn check_light(
        &self,
        field: &Field,
        spec: &OptimizeHologram,
        digest: &str,
        encoding: Encoding,
        display: &Display,
        dark: &str,
    ) -> Result<(), ApiError> {
        let (height_px, width_px) = size_of(display);
        let (fit, region) = (spec.target_fit, spec.region_of_interest);
        let what = format!("{digest} {encoding:?} {fit:?} {width_px}×{height_px} {region:?}");
        if self.lit.knows(&what) {
            return self.require_picture(field, digest).await;
        }
        let decode = move |bytes: &[u8]| {
            let target = pictures::target_intensity(bytes, encoding, fit, height_px, width_px)?;
            Ok(has_light(&target, region))
        };
        if self.decoded(field, digest, decode).await? {
            self.lit.remember(what);
            return Ok(());
        }
        let problem =
            format!("({digest}): the picture is {dark} everywhere in the region of interest, but must have light");
        Err(field.invalid(problem))
    }

    /// A hologram must be levels of the display, in its size.
    pub(super) async fn check_levels(&self, field: &Field, digest: &str, display: &Display) -> Result<(), ApiError> {
        let (height_px, width_px) = size_of(display);
        let bit_depth = display.bit_depth;
        let decode = move |bytes: &[u8]| pictures::levels(bytes, bit_depth, height_px, width_px).map(drop);
        self.decoded(field, digest, decode).await
    }

    /// The bytes of an artifact that must be there and no larger than a picture may be.
    pub(super) async fn picture_bytes(&self, field: &Field, digest: &str) -> Result<Vec<u8>, ApiError> {
        self.require_picture(field, digest).await?;
        Ok(self.artifacts.read_all(digest).await?)
    }

    async fn require_picture(&self, field: &Field, digest: &str) -> Result<(), ApiError> {
        let Some(record) = self.artifact_for_caller(digest).await? else {
            return Err(field.missing(format!("artifact {digest}"), "upload it first"));
        };
        if record.size_bytes > pictures::FILE_BYTES_MAX as u64 {
            let error = PictureError::FileTooLarge { bytes: record.size_bytes as usize };
            return Err(field.invalid(format!("({digest}): {error}")));
        }
        Ok(())
    }

    /// What `decode` makes of an artifact, on a thread that may block, few at a time.
    async fn decoded<T: Send + 'static>(
        &self,
        field: &Field,
        digest: &str,
        decode: impl FnOnce(&[u8]) -> Result<T, PictureError> + Send + 'static,
    ) -> Result<T, ApiError> {
        let bytes = self.picture_bytes(field, digest).await?;
        let _permit = Arc::clone(&self.decoders).acquire_owned().await.map_err(|_| ApiError::Stopping)?;
        let decoded = tokio::task::spawn_blocking(move || decode(&bytes)).await.map_err(ApiError::Task)?;
        decoded.map_err(|error| field.invalid(format!("({digest}): {error}")))
    }
}

fn size_of(display: &Display) -> (usize, usize) {
    (display.height_px as usize, display.width_px as usize)
}

fn has_light(target: &Plane<f32>, region: Region) -> bool {
    let rows = region.y_px as usize..(region.y_px + region.height_px) as usize;
    rows.into_iter().any(|y| target.row(y)[region.x_px as usize..][..region.width_px as usize].iter().any(|&v| v > 0.0))
}
