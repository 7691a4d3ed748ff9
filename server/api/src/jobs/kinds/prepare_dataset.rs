//! Dataset jobs, which align or finalize a dataset.

use crate::api::Api;
use crate::datasets::to_wire::{alignment, finding, split_counts};
use crate::names;
use lightpath_camera::alignment::{Homography, PointPair};
use lightpath_domain::dataset::Finalization;
use lightpath_domain::job::{AlignBy, Job, PrepareDataset, PrepareResult, PrepareStep};
use lightpath_media::pictures;
use lightpath_proto::v1;
use lightpath_proto::v1::prepare_dataset::align::{self, Source};
use lightpath_proto::v1::prepare_dataset::{Align, Finalize, Step};
use lightpath_service::{Call, Field, Result};

/// Limit on the fraction of the pairs that are held out: some pairs must remain for learning.
const HELD_OUT_FRACTION_MAX: f64 = 0.8;
/// Fraction of the pairs that is held out for validation by default.
const VALIDATION_FRACTION_DEFAULT: f64 = 0.2;
/// Fraction of the pairs that is held out for the test by default.
const TEST_FRACTION_DEFAULT: f64 = 0.2;
/// Limit on the points of an alignment: far more than a homography needs.
const POINTS_MAX: usize = 10_000;

/// Checks a request and converts it. Refuses it if the dataset can no longer be prepared in this way. `before` is
/// the job of an earlier submission of the same request. Returns also the memory for decoding its picture \[bytes\].
pub(super) async fn from_wire(
    api: &Api,
    call: &Call,
    message: v1::PrepareDataset,
    field: &Field,
    before: Option<&Job>,
) -> Result<(PrepareDataset, u64)> {
    let dataset_field = field.at("dataset");
    let id = names::dataset_id(&dataset_field, &message.dataset)?;
    let dataset = api.service.datasets.named(call, &dataset_field, &id).await?;
    let step = match field.at("step").required(message.step)? {
        Step::Align(align) => PrepareStep::Align(align_by(api, call, align, &field.at("align")).await?),
        Step::Finalize(finalize) => PrepareStep::Finalize(finalization(&finalize, &field.at("finalize"))?),
    };
    api.service.jobs.complete_preparation(call, field, (dataset, step), before).await
}

async fn align_by(api: &Api, call: &Call, align: Align, field: &Field) -> Result<AlignBy> {
    match field.at("source").required(align.source)? {
        Source::Points(points) => align_by_points(&points, &field.at("points")),
        Source::DotsPhoto(digest) => {
            let field = field.at("dots_photo");
            let photo = field.digest(&digest)?;
            api.service.files.require_picture(call, &field, &photo).await?;
            Ok(AlignBy::Dots { photo })
        }
        Source::Pairs(align::ByPairs {}) => Ok(AlignBy::Pairs),
        Source::None(align::NoAlignment {}) => Ok(AlignBy::None),
    }
}

fn align_by_points(points: &v1::AlignmentPoints, field: &Field) -> Result<AlignBy> {
    let side = 1..=pictures::SIDE_PX_MAX;
    let photo_width_px = field.at("photo_width_px").integer(points.photo_width_px, side.clone())?;
    let photo_height_px = field.at("photo_height_px").integer(points.photo_height_px, side)?;
    let (field, count) = (field.at("points"), points.points.len());
    if count > POINTS_MAX {
        return Err(field.but(format!("has {count} entries"), format!("at most {POINTS_MAX} are accepted")));
    }
    let given = points.points.iter().map(|point| PointPair {
        display: [point.display_x_px, point.display_y_px],
        camera: [point.photo_x_px, point.photo_y_px],
    });
    let points: Vec<PointPair> = given.collect();
    Homography::from_points(&points)
        .map_err(|error| field.invalid(format!("does not define an alignment: {error}"), "give other points"))?;
    Ok(AlignBy::Points { photo_width_px, photo_height_px, points })
}

fn finalization(finalize: &Finalize, field: &Field) -> Result<Finalization> {
    let allowed = 0.0..=HELD_OUT_FRACTION_MAX;
    let validation_field = field.at("validation_fraction");
    let test_fraction =
        field.at("test_fraction").number_or(finalize.test_fraction, TEST_FRACTION_DEFAULT, allowed.clone())?;
    let validation_fraction = match finalize.validation_fraction {
        Some(given) => validation_field.number(given, allowed)?,
        None => VALIDATION_FRACTION_DEFAULT.min(HELD_OUT_FRACTION_MAX - test_fraction),
    };
    if finalize.validation_fraction.is_some() && validation_fraction + test_fraction > HELD_OUT_FRACTION_MAX {
        return Err(validation_field.but(
            format!("and test_fraction are {validation_fraction} and {test_fraction}"),
            "must sum to at most 0.8",
        ));
    }
    let Finalize { seed, keep_alignment, .. } = *finalize;
    Ok(Finalization { validation_fraction, test_fraction, seed, keep_alignment })
}

/// Converts the request, with its defaults, into its message.
pub(super) fn to_wire(spec: PrepareDataset) -> v1::PrepareDataset {
    let step = match spec.step {
        PrepareStep::Align(by) => Step::Align(Align { source: Some(source(by)) }),
        PrepareStep::Finalize(finalization) => {
            let Finalization { validation_fraction, test_fraction, seed, keep_alignment } = finalization;
            let (validation_fraction, test_fraction) = (Some(validation_fraction), Some(test_fraction));
            Step::Finalize(Finalize { validation_fraction, test_fraction, seed, keep_alignment })
        }
    };
    v1::PrepareDataset { dataset: format!("datasets/{}", spec.dataset), step: Some(step) }
}

fn source(by: AlignBy) -> Source {
    match by {
        AlignBy::Points { photo_width_px, photo_height_px, points } => {
            let points = points.into_iter().map(|point| v1::AlignmentPoint {
                display_x_px: point.display[0],
                display_y_px: point.display[1],
                photo_x_px: point.camera[0],
                photo_y_px: point.camera[1],
            });
            Source::Points(v1::AlignmentPoints { photo_width_px, photo_height_px, points: points.collect() })
        }
        AlignBy::Dots { photo } => Source::DotsPhoto(photo),
        AlignBy::Pairs => Source::Pairs(align::ByPairs {}),
        AlignBy::None => Source::None(align::NoAlignment {}),
    }
}

/// Converts the result into its message.
pub(super) fn result(result: PrepareResult) -> v1::PrepareDatasetResult {
    v1::PrepareDatasetResult {
        alignment: result.alignment.map(alignment),
        findings: result.findings.into_iter().map(finding).collect(),
        split_counts: result.split_counts.map(split_counts),
        digest: result.dataset_digest.unwrap_or_default(),
    }
}
