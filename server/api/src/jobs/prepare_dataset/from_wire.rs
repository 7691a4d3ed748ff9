//! Checks of requests to align or finalize datasets.

use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use lightpath_camera::alignment::{Homography, PointPair};
use lightpath_domain::dataset::{Dataset, Finalization};
use lightpath_domain::job::{AlignBy, Job, PrepareDataset, PrepareStep};
use lightpath_domain::reason::PreconditionReason;
use lightpath_media::pictures;
use lightpath_proto::v1;
use lightpath_proto::v1::prepare_dataset::align::Source;
use lightpath_proto::v1::prepare_dataset::{Align, Finalize, Step};

/// Limit on the fraction of the pairs that are held out: some pairs must remain for learning.
const HELD_OUT_FRACTION_MAX: f64 = 0.8;
/// Fraction of the pairs that is held out for validation by default.
const VALIDATION_FRACTION_DEFAULT: f64 = 0.2;
/// Fraction of the pairs that is held out for the test by default.
const TEST_FRACTION_DEFAULT: f64 = 0.2;
/// Limit on the points of an alignment: far more than a homography needs.
const POINTS_MAX: usize = 10_000;

impl Api {
    /// Checks a request and converts it. Refuses it if the dataset can no longer be prepared in this way. `before` is
    /// the job of an earlier submission of the same request.
    pub(crate) async fn prepare_dataset_spec(
        &self,
        call: &Call,
        message: v1::PrepareDataset,
        field: &Field,
        before: Option<&Job>,
    ) -> Result<PrepareDataset, ApiError> {
        let dataset_field = field.at("dataset");
        let id = names::dataset_id(&dataset_field, &message.dataset)?;
        let dataset = self.dataset_named(call, &dataset_field, &id).await?;
        let step = match field.at("step").required(message.step)? {
            Step::Align(align) => PrepareStep::Align(self.align_by(call, align, &field.at("align")).await?),
            Step::Finalize(finalize) => PrepareStep::Finalize(finalization(&finalize, &field.at("finalize"))?),
        };
        // A repeated request returns its job, even if the job has changed the dataset since.
        if before.is_none() {
            require_possible(&dataset_field, &dataset, &step)?;
        }
        Ok(PrepareDataset { dataset: id, display: dataset.display, step })
    }

    async fn align_by(&self, call: &Call, align: Align, field: &Field) -> Result<AlignBy, ApiError> {
        match field.at("source").required(align.source)? {
            Source::Points(points) => align_by_points(&points, &field.at("points")),
            Source::DotsPhoto(digest) => {
                let field = field.at("dots_photo");
                let photo = field.digest(&digest)?;
                self.require_picture(call, &field, &photo).await?;
                Ok(AlignBy::Dots { photo })
            }
            Source::Pairs(true) => Ok(AlignBy::Pairs),
            Source::None(true) => Ok(AlignBy::None),
            Source::Pairs(false) => Err(field.at("pairs").invalid("is false, but must be true")),
            Source::None(false) => Err(field.at("none").invalid("is false, but must be true")),
        }
    }
}

fn align_by_points(points: &v1::AlignmentPoints, field: &Field) -> Result<AlignBy, ApiError> {
    let side = 1..=pictures::SIDE_PX_MAX;
    let photo_width_px = field.at("photo_width_px").integer(points.photo_width_px, side.clone())?;
    let photo_height_px = field.at("photo_height_px").integer(points.photo_height_px, side)?;
    let (field, count) = (field.at("points"), points.points.len());
    if count > POINTS_MAX {
        return Err(field.invalid(format!("has {count} entries, but at most {POINTS_MAX} are accepted")));
    }
    let given = points.points.iter().map(|point| PointPair {
        display: [point.display_x_px, point.display_y_px],
        camera: [point.photo_x_px, point.photo_y_px],
    });
    let points: Vec<PointPair> = given.collect();
    Homography::from_points(&points)
        .map_err(|error| field.invalid(format!("does not define an alignment: {error}")))?;
    Ok(AlignBy::Points { photo_width_px, photo_height_px, points })
}

fn finalization(finalize: &Finalize, field: &Field) -> Result<Finalization, ApiError> {
    let allowed = 0.0..=HELD_OUT_FRACTION_MAX;
    let validation_field = field.at("validation_fraction");
    let test_fraction =
        field.at("test_fraction").number_or(finalize.test_fraction, TEST_FRACTION_DEFAULT, allowed.clone())?;
    let validation_fraction = match finalize.validation_fraction {
        Some(given) => validation_field.number(given, allowed)?,
        None => VALIDATION_FRACTION_DEFAULT.min(HELD_OUT_FRACTION_MAX - test_fraction),
    };
    if finalize.validation_fraction.is_some() && validation_fraction + test_fraction > HELD_OUT_FRACTION_MAX {
        return Err(validation_field.invalid(format!(
            "and test_fraction are {validation_fraction} and {test_fraction}, but must sum to at most 0.8"
        )));
    }
    let Finalize { seed, keep_alignment, .. } = *finalize;
    Ok(Finalization { validation_fraction, test_fraction, seed, keep_alignment })
}

/// Refuses a dataset that is finalized (unless in the same way), and one without pairs if the step needs pairs.
fn require_possible(field: &Field, dataset: &Dataset, step: &PrepareStep) -> Result<(), ApiError> {
    let id = &dataset.id;
    let (reason, problem) = match (&dataset.finalization, step) {
        (Some(before), PrepareStep::Finalize(wanted)) if before == wanted => return Ok(()),
        (Some(before), PrepareStep::Finalize(_)) => {
            let Finalization { validation_fraction, test_fraction, seed, keep_alignment } = before;
            let keep_alignment = if *keep_alignment { ", keep_alignment" } else { "" };
            let problem = format!(
                "is finalized with validation_fraction {validation_fraction}, test_fraction {test_fraction}, seed \
                 {seed}{keep_alignment}; create another dataset"
            );
            (PreconditionReason::DatasetFinalized, problem)
        }
        (Some(_), PrepareStep::Align(_)) => {
            let problem = "is finalized, so its alignment cannot change; create another dataset".to_owned();
            (PreconditionReason::DatasetFinalized, problem)
        }
        (None, PrepareStep::Finalize(_) | PrepareStep::Align(AlignBy::Pairs)) if dataset.pair_count == 0 => {
            (PreconditionReason::DatasetEmpty, "has no pairs; add some: lightpath dataset add --help".to_owned())
        }
        (None, _) => return Ok(()),
    };
    Err(ApiError::Precondition { reason, message: format!("{field}: datasets/{id} {problem}") })
}
