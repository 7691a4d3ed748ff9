//! Aligning a dataset's photographs with its display.

use super::pairs::refused;
use super::to_wire;
use crate::api::Api;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use lightpath_domain::access::Caller;
use lightpath_domain::dataset::{self, Alignment, AlignmentMethod, Dataset, Pair};
use lightpath_media::captures::{self, CaptureError, Solved};
use lightpath_media::pictures;
use lightpath_optics::Plane;
use lightpath_optics::alignment::{DotGrid, PointPair};
use lightpath_proto::v1;
use lightpath_proto::v1::align_dataset_request::Source;

/// Pairs that an alignment is refined by, at most, and how much memory their pictures may take \[bytes\].
const ALIGNED_BY_MAX: usize = 8;
const ALIGNED_BY_BYTES_MAX: usize = 384 << 20;

impl Api {
    pub(crate) async fn create_calibration_target(
        &self,
        caller: &Caller,
        request: v1::CreateCalibrationTargetRequest,
    ) -> Result<v1::CalibrationTarget, ApiError> {
        let field = Field::new("display");
        let display = self.display_named(caller, &field, &request.display).await?;
        let grid = DotGrid::of_display(display.height_px as usize, display.width_px as usize);
        let grid = grid.map_err(|error| field.invalid(format!("({}): {error}", display.id)))?;
        let file = pictures::grey_png_srgb(&grid.target()).map_err(|error| field.invalid(error))?;
        let (columns, rows) = grid.size();
        let target = self.keep(caller, file).await?;
        Ok(v1::CalibrationTarget { target, columns: columns as u32, rows: rows as u32 })
    }

    pub(crate) async fn align_dataset(
        &self,
        caller: &Caller,
        request: v1::AlignDatasetRequest,
    ) -> Result<v1::Dataset, ApiError> {
        let id = names::dataset_id(&Field::new("name"), &request.name)?;
        let mut dataset = self.dataset_named(caller, &Field::new("name"), &id).await?;
        require_open(&dataset)?;
        let alignment = match Field::new("source").required(request.source)? {
            Source::Points(points) => Some(self.align_by_points(caller, &dataset, points).await?),
            Source::DotsPhoto(photo) => Some(self.align_by_dots(caller, &dataset, &photo).await?),
            Source::Pairs(true) => {
                self.check_again(&mut dataset).await?;
                Some(self.align_by_pairs(caller, &dataset).await?.ok_or_else(|| not_alignable(&id))?)
            }
            Source::None(true) => None,
            Source::Pairs(false) => return Err(Field::new("pairs").invalid("is false, but must be true")),
            Source::None(false) => return Err(Field::new("none").invalid("is false, but must be true")),
        };
        self.expect_sizes(&dataset, alignment.as_ref()).await?;
        let mut dataset = self.store.align_dataset(&id, alignment.as_ref()).await?;
        self.check_again(&mut dataset).await?;
        Ok(to_wire::dataset(dataset))
    }

    /// The alignment that given points make.
    async fn align_by_points(
        &self,
        caller: &Caller,
        dataset: &Dataset,
        points: v1::AlignmentPoints,
    ) -> Result<Alignment, ApiError> {
        let field = Field::new("points");
        let side = 1..=pictures::SIDE_PX_MAX;
        let width_px = field.at("photo_width_px").integer(points.photo_width_px, side.clone())?;
        let height_px = field.at("photo_height_px").integer(points.photo_height_px, side)?;
        let pairs: Vec<PointPair> = points
            .points
            .iter()
            .map(|point| PointPair {
                display: [point.display_x_px, point.display_y_px],
                camera: [point.photo_x_px, point.photo_y_px],
            })
            .collect();
        let captures = self.captures(dataset).await?;
        let solved = captures::from_points(&captures, &pairs)
            .map_err(|error| field.at("points").invalid(format!("fix no alignment: {error}")))?;
        self.alignment(caller, AlignmentMethod::Points, solved, (height_px, width_px), String::new()).await
    }

    /// The alignment that the photograph of the displayed dots shows.
    async fn align_by_dots(&self, caller: &Caller, dataset: &Dataset, digest: &str) -> Result<Alignment, ApiError> {
        let field = Field::new("dots_photo");
        let digest = field.digest(digest)?;
        let bytes = self.picture_bytes(caller, &field, &digest).await?;
        let captures = self.captures(dataset).await?;
        let solve = move || {
            let photo = captures.camera(&Pair::default(), &bytes)?;
            let size = (photo.height_px() as u32, photo.width_px() as u32);
            Ok::<_, CaptureError>((captures::from_dots(&captures, &photo)?, size))
        };
        let solved = self.decoding.run(solve).await?;
        let (solved, size) = solved.map_err(|error| field.invalid(format!("({digest}): {error}")))?;
        self.alignment(caller, AlignmentMethod::Dots, solved, size, digest).await
    }

    /// The alignment that the pairs' photographs ask for; `None` where they tell too little, or are aligned as well as that
    /// can be told.
    pub(crate) async fn align_by_pairs(
        &self,
        caller: &Caller,
        dataset: &Dataset,
    ) -> Result<Option<Alignment>, ApiError> {
        let findings = captures::findings(dataset);
        let excluded = |pair: &&Pair| !findings.iter().any(|finding| finding.excludes && finding.pair == pair.id);
        let good: Vec<&Pair> = dataset.pairs.iter().filter(excluded).collect();
        let Some(size) = good.first().and_then(|pair| pair.checks.as_ref()).map(|checks| checks.photo_px) else {
            return Ok(None);
        };
        let captures = self.captures(dataset).await?;
        let display_px = captures.height_px() * captures.width_px();
        let pair_bytes = size_of::<f32>() * (display_px + size[0] as usize * size[1] as usize);
        let count = (ALIGNED_BY_BYTES_MAX / pair_bytes).clamp(1, ALIGNED_BY_MAX).min(good.len());
        // Evenly over all, since neighbours may be alike.
        let chosen = (0..count).map(|i| good[i * good.len() / count]);
        let mut files = Vec::with_capacity(count);
        for pair in chosen {
            let phase = self.artifacts.read_all(&pair.phase).await?;
            files.push((pair.clone(), phase, self.artifacts.read_all(&pair.photo).await?));
        }
        let (last, of) = (self.last_reconstructor.clone(), dataset.clone());
        let solve = move || {
            let Some(reconstructor) = last.of(&of, &captures) else { return Ok(None) };
            let mut seen: Vec<(Plane<f32>, Plane<f32>)> = Vec::with_capacity(files.len());
            for (pair, phase, photo) in &files {
                seen.push((reconstructor.light(&captures.phase(phase)?)?, captures.camera(pair, photo)?));
            }
            captures::from_pairs(&captures, &seen)
        };
        let solved: Result<Option<Solved>, CaptureError> = self.decoding.run(solve).await?;
        let Some(solved) = solved.map_err(|error| refused("", &error))? else { return Ok(None) };
        let alignment =
            self.alignment(caller, AlignmentMethod::Pairs, solved, (size[1], size[0]), String::new()).await?;
        Ok(Some(alignment))
    }

    async fn alignment(
        &self,
        caller: &Caller,
        method: AlignmentMethod,
        solved: Solved,
        (photo_height_px, photo_width_px): (u32, u32),
        photo: String,
    ) -> Result<Alignment, ApiError> {
        Ok(Alignment {
            method,
            homography: solved.homography.entries(),
            photo_height_px,
            photo_width_px,
            points: solved.points as u32,
            residual_px: solved.residual_px,
            corrected_px: solved.corrected_px,
            photo,
            before: self.keep(caller, solved.before).await?,
            after: self.keep(caller, solved.after).await?,
        })
    }

    /// The photographs that are there must fit the new alignment.
    async fn expect_sizes(&self, dataset: &Dataset, alignment: Option<&Alignment>) -> Result<(), ApiError> {
        let (display, _) = self.store.display(&dataset.display).await?;
        let expected = match alignment {
            Some(alignment) => [alignment.photo_width_px, alignment.photo_height_px],
            None => [display.width_px, display.height_px],
        };
        let photo_px = |pair: &dataset::Pair| pair.checks.as_ref().map(|checks| checks.photo_px);
        match dataset.pairs.iter().find(|pair| photo_px(pair).is_some_and(|size| size != expected)) {
            None => Ok(()),
            Some(pair) => {
                let [width, height] = photo_px(pair).unwrap_or_default();
                let message = format!(
                    "pair \"{}\" has a photograph of {width}×{height} px, but the alignment is for {}×{} px; align with \
                     photographs of the size that the dataset has",
                    pair.id, expected[0], expected[1]
                );
                Err(ApiError::Precondition { reason: "ALIGNMENT_SIZE", message })
            }
        }
    }
}

fn require_open(dataset: &Dataset) -> Result<(), ApiError> {
    if dataset.digest.is_none() {
        return Ok(());
    }
    let message = format!("datasets/{} is finalized, and its alignment with it; create another dataset", dataset.id);
    Err(ApiError::Precondition { reason: "DATASET_FINALIZED", message })
}

fn not_alignable(id: &str) -> ApiError {
    let message = format!(
        "the pairs of datasets/{id} say too little about their alignment: add some with fine structure, or photograph the \
         displayed dots (lightpath dataset calibration --help)"
    );
    ApiError::Precondition { reason: "NOT_ALIGNABLE", message }
}
