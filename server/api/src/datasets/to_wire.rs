//! Datasets as messages.

use crate::time::timestamp;
use lightpath_domain::dataset::{
    Alignment, AlignmentMethod, Dataset, Encoding, Finding, FindingKind, Pair, PairChecks, Split,
};
use lightpath_media::captures;
use lightpath_proto::v1;

/// The dataset as clients see it.
pub(crate) fn dataset(dataset: Dataset) -> v1::Dataset {
    let finalized = dataset.digest.is_some();
    let state = if finalized { v1::dataset::State::Finalized } else { v1::dataset::State::Open };
    let findings = captures::findings(&dataset);
    v1::Dataset {
        name: format!("datasets/{}", dataset.id),
        display: format!("displays/{}", dataset.display),
        wavelength_m: dataset.wavelength.m(),
        distance_m: dataset.distance.m(),
        photo_encoding: encoding(dataset.photo_encoding),
        state: state.into(),
        pairs: dataset.pairs.into_iter().map(|found| pair(found, finalized)).collect(),
        digest: dataset.digest.unwrap_or_default(),
        create_time: Some(timestamp(dataset.create_time_ms)),
        finalize_time: dataset.finalize_time_ms.map(timestamp),
        pair_count: dataset.pair_count,
        alignment: dataset.alignment.map(alignment),
        photo_bit_depth: dataset.photo_bit_depth,
        findings: findings.into_iter().map(finding).collect(),
    }
}

fn pair(pair: Pair, finalized: bool) -> v1::Pair {
    let excluded = finalized && pair.split.is_none();
    v1::Pair {
        id: pair.id,
        phase: pair.phase,
        photo: pair.photo,
        split: if excluded { v1::Split::Excluded.into() } else { split(pair.split) },
        black_level: pair.exposure.black_level,
        exposure_s: pair.exposure.exposure_s,
        camera_gain: pair.exposure.camera_gain,
        checks: pair.checks.map(checks),
    }
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
        distortion_px: checks.distortion_px,
        photo_width_px: checks.photo_px[0],
        photo_height_px: checks.photo_px[1],
    }
}

pub(crate) fn finding(finding: Finding) -> v1::Finding {
    let kind = match finding.kind {
        FindingKind::Black => v1::finding::Kind::Black,
        FindingKind::Saturated => v1::finding::Kind::Saturated,
        FindingKind::BlackClipped => v1::finding::Kind::BlackClipped,
        FindingKind::LowContrast => v1::finding::Kind::LowContrast,
        FindingKind::Duplicate => v1::finding::Kind::Duplicate,
        FindingKind::WrongHologram => v1::finding::Kind::WrongHologram,
        FindingKind::Misaligned => v1::finding::Kind::Misaligned,
        FindingKind::Vignetting => v1::finding::Kind::Vignetting,
        FindingKind::ExposureUnknown => v1::finding::Kind::ExposureUnknown,
    };
    v1::Finding { pair: finding.pair, kind: kind.into(), excludes: finding.excludes, message: finding.message }
}

fn alignment(alignment: Alignment) -> v1::Alignment {
    let method = match alignment.method {
        AlignmentMethod::Points => v1::alignment::Method::Points,
        AlignmentMethod::Dots => v1::alignment::Method::Dots,
        AlignmentMethod::Pairs => v1::alignment::Method::Pairs,
    };
    v1::Alignment {
        method: method.into(),
        homography: alignment.homography.to_vec(),
        photo_width_px: alignment.photo_width_px,
        photo_height_px: alignment.photo_height_px,
        points: alignment.points,
        residual_px: alignment.residual_px,
        corrected_px: alignment.corrected_px,
        photo: alignment.photo,
        before: alignment.before,
        after: alignment.after,
    }
}

pub(crate) fn encoding(encoding: Encoding) -> i32 {
    match encoding {
        Encoding::Linear => v1::Encoding::Linear.into(),
        Encoding::Srgb => v1::Encoding::Srgb.into(),
    }
}

pub(crate) fn split(split: Option<Split>) -> i32 {
    match split {
        None => v1::Split::Unspecified.into(),
        Some(Split::Train) => v1::Split::Train.into(),
        Some(Split::Validation) => v1::Split::Validation.into(),
        Some(Split::Test) => v1::Split::Test.into(),
    }
}
