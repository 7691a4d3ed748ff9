//! Conversion of datasets into messages.

use crate::enumerations::OnWire;
use crate::optics::to_wire::place;
use crate::time::timestamp;
use lightpath_domain::dataset::{Alignment, Dataset, Finding, LargestValue, Pair, PairChecks, SplitCounts};
use lightpath_proto::v1;

/// Converts a dataset into its message.
pub(crate) fn dataset(dataset: Dataset) -> v1::Dataset {
    let finalized = dataset.digest.is_some();
    let state = if finalized { v1::dataset::State::Finalized } else { v1::dataset::State::Open };
    v1::Dataset {
        name: format!("datasets/{}", dataset.id),
        display: format!("displays/{}", dataset.display),
        wavelength_m: Some(dataset.wavelength.m()),
        place: place(dataset.distance),
        photo_encoding: dataset.photo_encoding.to_wire(),
        state: state.into(),
        split_counts: dataset.split_counts.map(split_counts),
        digest: dataset.digest.unwrap_or_default(),
        create_time: Some(timestamp(dataset.create_time_ms)),
        finalize_time: dataset.finalize_time_ms.map(timestamp),
        pair_count: dataset.pair_count,
        alignment: dataset.alignment.map(alignment),
        photo_bit_depth: (dataset.photo_bit_depth > 0).then_some(dataset.photo_bit_depth),
        findings: dataset.findings.into_iter().map(finding).collect(),
    }
}

pub(crate) fn split_counts(counts: SplitCounts) -> v1::SplitCounts {
    let SplitCounts { train, validation, test, excluded } = counts;
    v1::SplitCounts { train, validation, test, excluded }
}

/// Converts a pair of a dataset and its findings into their message.
pub(crate) fn pair((pair, findings): (Pair, Vec<Finding>), dataset: &Dataset) -> v1::Pair {
    let excluded = dataset.digest.is_some() && pair.split.is_none();
    v1::Pair {
        id: pair.id,
        pattern: pair.pattern,
        photo: pair.photo,
        split: if excluded { v1::Split::Excluded.into() } else { pair.split.map_or(0, OnWire::to_wire) },
        black_level: pair.exposure.black_level,
        exposure_s: known(pair.exposure.exposure_s),
        camera_gain: known(pair.exposure.camera_gain),
        checks: pair.checks.map(checks),
        findings: findings.into_iter().map(finding).collect(),
    }
}

/// A property of the camera; the dataset has 0 for one that is unknown.
fn known(value: f64) -> Option<f64> {
    (value > 0.0).then_some(value)
}

fn checks(checks: PairChecks) -> v1::PairChecks {
    v1::PairChecks {
        saturated: checks.saturated,
        black: checks.black,
        brightest: checks.brightest,
        contrast: checks.contrast,
        correlation: checks.correlation,
        vignetting: checks.vignetting,
        misalignment_px: checks.misalignment_px,
        shift_px: checks.shift_px,
        turn_px: checks.turn_px,
        turn_uncertainty_px: checks.turn_uncertainty_px,
        stretch_px: checks.stretch_px,
        photo_width_px: checks.photo_px[0],
        photo_height_px: checks.photo_px[1],
        largest: checks.largest.map(largest),
    }
}

fn largest(largest: LargestValue) -> v1::LargestValue {
    let LargestValue { value, full_scale, share, share_below } = largest;
    v1::LargestValue { value, full_scale, share, share_below }
}

pub(crate) fn finding(finding: Finding) -> v1::Finding {
    v1::Finding {
        pair: finding.pair,
        kind: finding.kind.to_wire(),
        excludes: finding.excludes,
        message: finding.message,
    }
}

pub(crate) fn alignment(alignment: Alignment) -> v1::Alignment {
    let [k1, k2, p1, p2] = alignment.map.distortion;
    v1::Alignment {
        method: alignment.method.to_wire(),
        homography: alignment.map.homography.to_vec(),
        k1,
        k2,
        p1,
        p2,
        photo_width_px: alignment.photo_width_px,
        photo_height_px: alignment.photo_height_px,
        points: alignment.points,
        residual_px: alignment.residual_px,
        corrected_px: alignment.corrected_px,
        photo: alignment.photo,
        before: alignment.before,
        after: alignment.after,
        left_px: alignment.left_px,
        explanation: alignment.explanation,
    }
}
