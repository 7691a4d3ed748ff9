//! Scoring a photograph of a target.

use crate::call::Call;
use crate::computing::Computing;
use crate::error::{Result, ServiceError};
use crate::field::Field;
use crate::files::{Files, unreadable};
use crate::region::region_inside;
use lightpath_artifacts::Artifacts;
use lightpath_camera::alignment::AlignmentError;
use lightpath_camera::photo_score::ScoreError;
use lightpath_domain::dataset::Encoding;
use lightpath_media::photo_scores::{self, EncodedPicture, PhotoScoreError, ScoredPhoto};
use lightpath_optics::{Grid, RegionOfInterest};
use std::mem;

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

/// A photograph to be scored, and what it shows.
#[derive(Clone, Debug)]
pub struct ScoreRequest {
    /// Artifact digest of the photograph.
    pub photo: String,
    /// Artifact digest of the picture that it shows.
    pub target: String,
    /// Encoding of the photograph's light.
    pub photo_encoding: Encoding,
    /// Encoding of the target's light.
    pub target_encoding: Encoding,
    /// Where the two are compared: first column and row, width and height \[px\]; `None`: in the middle.
    pub region_px: Option<[u32; 4]>,
}

/// A photograph that was scored.
#[derive(Clone, Debug)]
pub struct PhotoScore {
    /// The figures. Their pictures are stored.
    pub scored: ScoredPhoto,
    /// Where the two were compared.
    pub region: RegionOfInterest,
    /// Artifact digest of the photograph as the target sees it.
    pub aligned: String,
    /// Artifact digest of the picture of the error.
    pub error: String,
}

/// Photographs of pictures that displays show.
#[derive(Clone, Debug)]
pub struct Photos {
    artifacts: Artifacts,
    computing: Computing,
    files: Files,
}

impl Photos {
    pub(crate) fn new(artifacts: Artifacts, computing: Computing, files: Files) -> Self {
        Self { artifacts, computing, files }
    }

    /// Finds the target in the photograph, compares the two, and stores the pictures of the comparison.
    pub async fn score(&self, call: &Call, request: ScoreRequest) -> Result<PhotoScore> {
        let (photo, target) = (Field::new("photo"), Field::new("target"));
        let photo_px = self.limited_pixels(call, &photo, &request.photo, PHOTO_PIXELS_MAX).await?;
        let target_px = self.limited_pixels(call, &target, &request.target, TARGET_PIXELS_MAX).await?;
        let need_bytes = self.files.reading_bytes(call, &photo, &request.photo, 0).await?
            + self.files.reading_bytes(call, &target, &request.target, 0).await?
            + PHOTO_BYTES_PER_PX * photo_px
            + TARGET_BYTES_PER_PX * target_px
            + PICTURES_BYTES;
        let artifacts = self.artifacts.clone();
        let compute = move || -> Result<(ScoredPhoto, RegionOfInterest)> {
            let (photo, target) = (artifacts.read_blocking(&request.photo)?, artifacts.read_blocking(&request.target)?);
            scored(&request, &photo, &target)
        };
        let (mut scored, region) = self.computing.run(call, need_bytes, compute).await??;
        let aligned = self.files.store(call, mem::take(&mut scored.aligned_png)).await?;
        let error = self.files.store(call, mem::take(&mut scored.error_png)).await?;
        Ok(PhotoScore { scored, region, aligned, error })
    }

    /// Number of pixels of a picture, which must not have more than `pixels_max`.
    async fn limited_pixels(&self, call: &Call, field: &Field, digest: &str, pixels_max: u64) -> Result<u64> {
        let pixels = self.files.picture_pixels(call, field, digest).await?;
        if pixels > pixels_max {
            let problem =
                format!("({digest}): the picture has {pixels} px, but at most {pixels_max} are accepted here");
            return Err(field.invalid(problem, "send a smaller one"));
        }
        Ok(pixels)
    }
}

/// Decodes both pictures and scores the photograph.
fn scored(request: &ScoreRequest, photo: &[u8], target: &[u8]) -> Result<(ScoredPhoto, RegionOfInterest)> {
    let read = |name: &str, digest: &str, bytes: &[u8], encoding| {
        let picture = EncodedPicture::read(bytes, encoding);
        picture.map_err(|error| unreadable(&Field::new(name), digest, &error))
    };
    let target = read("target", &request.target, target, request.target_encoding)?;
    let field = Field::new("region");
    let (height_px, width_px) = target.size_px();
    let grid = Grid::try_new(height_px, width_px, PITCH_M)
        .map_err(|error| Field::new("target").invalid(error, "send a larger picture"))?;
    let region = region_inside(&field, request.region_px, &grid, "the target")?;
    let photo = read("photo", &request.photo, photo, request.photo_encoding)?;
    let scored = photo_scores::score(&photo, &target, region).map_err(|error| refusal(&request.photo, error))?;
    Ok((scored, region))
}

/// The error for a photograph that cannot be scored.
fn refusal(photo: &str, error: PhotoScoreError) -> ServiceError {
    let (name, problem) = match &error {
        PhotoScoreError::Score(ScoreError::Alignment(AlignmentError::PictureTooSmall { name, .. })) => {
            (if *name == "target" { "target" } else { "photo" }, error.to_string())
        }
        PhotoScoreError::Score(ScoreError::RegionOutside { .. } | ScoreError::Metric(_)) => {
            ("region", format!("cannot be compared: {error}"))
        }
        _ => ("photo", format!("({photo}): {error}")),
    };
    let fix = match name {
        "region_of_interest" => "give another region",
        "target" => "send a larger picture",
        _ => "photograph the target again: in focus, whole, and neither dark nor overexposed",
    };
    Field::new(name).invalid(problem, fix)
}
