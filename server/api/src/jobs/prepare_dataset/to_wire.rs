//! Conversion of the requests and results of dataset jobs into messages.

use crate::datasets::to_wire::{alignment, finding};
use lightpath_domain::dataset::Finalization;
use lightpath_domain::job::{AlignBy, PrepareDataset, PrepareResult, PrepareStep};
use lightpath_proto::v1;
use lightpath_proto::v1::prepare_dataset::align::Source;
use lightpath_proto::v1::prepare_dataset::{Align, Finalize, Step};

/// Converts the request, with its defaults, into its message.
pub(crate) fn spec(spec: PrepareDataset) -> v1::PrepareDataset {
    let step = match spec.step {
        PrepareStep::Align(by) => Step::Align(Align { source: Some(source(by)) }),
        PrepareStep::Finalize(finalization) => {
            let Finalization { validation_fraction, test_fraction, seed, keep_alignment } = finalization;
            let validation_fraction = Some(validation_fraction);
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
        AlignBy::Pairs => Source::Pairs(true),
        AlignBy::None => Source::None(true),
    }
}

/// Converts the result into its message.
pub(crate) fn result(result: PrepareResult) -> v1::PrepareResult {
    v1::PrepareResult {
        alignment: result.alignment.map(alignment),
        findings: result.findings.into_iter().map(finding).collect(),
        digest: result.dataset_digest.unwrap_or_default(),
        train_pairs: result.splits.train,
        validation_pairs: result.splits.validation,
        test_pairs: result.splits.test,
        left_out_pairs: result.splits.left_out,
    }
}
