//! Scoring a photograph of a target.

use super::to_wire;
use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use crate::optics::from_wire::region_inside;
use lightpath_camera::alignment::AlignmentError;
use lightpath_camera::photo_score::ScoreError;
use lightpath_domain::dataset::Encoding;
use lightpath_media::photo_scores::{self, EncodedPicture, PhotoScoreError, ScoredPhoto};
use lightpath_optics::{Grid, RegionOfInterest};
use lightpath_proto::v1;

/// Limit on the pixels of a photograph: those of common cameras.
const PHOTO_PIXELS_MAX: u64 = 32_000_000;
/// Limit on the pixels of a target: those of the largest displays. The figures are computed for each of them.
const TARGET_PIXELS_MAX: u64 = 16_000_000;
/// Memory for each pixel of the photograph \[bytes\]: three channels, their mean, its reductions and their details.
const PHOTO_BYTES_PER_PX: u64 = 3 * 4 + 4 + 6 + 16;
/// Memory for each pixel of the target \[bytes\]: three channels twice, their mean, reductions and details, the aligned
/// channels, and the three complex planes of a transform in double precision.
const TARGET_BYTES_PER_PX: u64 = 2 * 3 * 4 + 4 + 6 + 16 + 4 * 4 + 3 * 16 + 8;
/// Memory for the pictures of the answer \[bytes\].
const PICTURES_BYTES: u64 = 32 << 20;
/// Any pitch: only the pixels of the target's grid count.
const PITCH_M: f64 = 1e-6;

/// What a computation needs of a request.
struct Work {
    photo: String,
    target: String,
    photo_encoding: Encoding,
    target_encoding: Encoding,
    region: Option<v1::RegionOfInterest>,
}

impl Api {
    /// Finds the target in the photograph, compares the two, and stores the pictures of the comparison.
    pub(crate) async fn score_photo(
        &self,
        call: &Call,
        request: v1::ScorePhotoRequest,
    ) -> Result<v1::PhotoScore, ApiError> {
        let (photo, target) = (Field::new("photo"), Field::new("target"));
        let encoding = |name: &str, number: i32| Field::new(name).enum_value::<Encoding>(number);
        let work = Work {
            photo: photo.digest(&request.photo)?,
            target: target.digest(&request.target)?,
            photo_encoding: encoding("photo_encoding", request.photo_encoding)?.unwrap_or(Encoding::Linear),
            target_encoding: encoding("target_encoding", request.target_encoding)?.unwrap_or(Encoding::Srgb),
            region: request.region_of_interest,
        };
        let photo_px = self.limited_pixels(call, &photo, &work.photo, PHOTO_PIXELS_MAX).await?;
        let target_px = self.limited_pixels(call, &target, &work.target, TARGET_PIXELS_MAX).await?;
        let need_bytes = self.reading_bytes(call, &photo, &work.photo, 0).await?
            + self.reading_bytes(call, &target, &work.target, 0).await?
            + PHOTO_BYTES_PER_PX * photo_px
            + TARGET_BYTES_PER_PX * target_px
            + PICTURES_BYTES;
        let artifacts = self.artifacts.clone();
        let compute = move || -> Result<(ScoredPhoto, RegionOfInterest), ApiError> {
            let (photo, target) = (artifacts.read_blocking(&work.photo)?, artifacts.read_blocking(&work.target)?);
            scored(&work, &photo, &target)
        };
        let (scored, region) = self.accounts.compute(call, need_bytes, compute).await??;
        let score = to_wire::photo_score(&scored, region);
        let aligned = self.store_artifact(call, scored.aligned_png).await?;
        let error = self.store_artifact(call, scored.error_png).await?;
        Ok(v1::PhotoScore { aligned, error, ..score })
    }

    /// Number of pixels of a picture, which must not have more than `pixels_max`.
    async fn limited_pixels(&self, call: &Call, field: &Field, digest: &str, pixels_max: u64) -> Result<u64, ApiError> {
        let pixels = self.picture_pixels(call, field, digest).await?;
        if pixels > pixels_max {
            return Err(field.invalid(format!(
                "({digest}): the picture has {pixels} px, but at most {pixels_max} are accepted here; send a smaller one"
            )));
        }
        Ok(pixels)
    }
}

/// Decodes both pictures and scores the photograph.
fn scored(work: &Work, photo: &[u8], target: &[u8]) -> Result<(ScoredPhoto, RegionOfInterest), ApiError> {
    let read = |name: &str, digest: &str, bytes: &[u8], encoding| {
        let picture = EncodedPicture::read(bytes, encoding);
        picture.map_err(|error| Field::new(name).invalid(format!("({digest}): {error}")))
    };
    let target = read("target", &work.target, target, work.target_encoding)?;
    let field = Field::new("region_of_interest");
    let (height_px, width_px) = target.size_px();
    let grid = Grid::try_new(height_px, width_px, PITCH_M).map_err(|error| Field::new("target").invalid(error))?;
    let region = region_inside(&field, work.region, &grid, "the target")?;
    let photo = read("photo", &work.photo, photo, work.photo_encoding)?;
    let scored = photo_scores::score(&photo, &target, region).map_err(|error| refusal(&work.photo, error))?;
    Ok((scored, region))
}

/// The error for a photograph that cannot be scored.
fn refusal(photo: &str, error: PhotoScoreError) -> ApiError {
    let (name, problem) = match &error {
        PhotoScoreError::Score(ScoreError::Alignment(AlignmentError::PictureTooSmall { name, .. })) => {
            (if *name == "target" { "target" } else { "photo" }, error.to_string())
        }
        PhotoScoreError::Score(ScoreError::RegionOutside { .. } | ScoreError::Metric(_)) => {
            ("region_of_interest", format!("cannot be compared: {error}"))
        }
        _ => ("photo", format!("({photo}): {error}")),
    };
    Field::new(name).invalid(problem)
}
