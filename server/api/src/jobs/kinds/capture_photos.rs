//! Jobs that photograph patterns at the bench of a display.

use crate::api::Api;
use crate::names;
use crate::optics::from_wire::distance;
use crate::optics::to_wire::place;
use crate::time::timestamp;
use lightpath_domain::job::{CapturePhotos, CapturePhotosResult, CapturedPhoto, NamedPattern, Retaken};
use lightpath_proto::v1::{self, capture_photos, capture_photos_result};
use lightpath_service::{Call, Field, Result, collect_all};
use std::collections::HashSet;

/// Limit on the patterns of a job. Each result names all of its photographs.
const PATTERNS_MAX: usize = 500;
/// Limit on the exposures of a photograph.
const EXPOSURES_MAX: u32 = 100;
/// Shortest and longest exposure \[s\]; the rig may allow less.
const EXPOSURE_RANGE_S: std::ops::RangeInclusive<f64> = 1e-6..=3600.0;

/// Checks a request, looks up the named resources, fills in defaults, and converts the request.
pub(super) async fn from_wire(
    api: &Api,
    call: &Call,
    message: v1::CapturePhotos,
    field: &Field,
) -> Result<CapturePhotos> {
    let at = |name| field.at(name);
    let display = api.display_named(call, &at("display"), &message.display).await?;
    let aligned_by = match message.aligned_by.as_str() {
        "" => None,
        name => {
            let id = names::dataset_id(&at("aligned_by"), name)?;
            Some(api.service.datasets.named(call, &at("aligned_by"), &id).await?)
        }
    };
    let exposure_s = message.exposure_s.map(|exposure_s| at("exposure_s").number(exposure_s, EXPOSURE_RANGE_S));
    let spec = CapturePhotos {
        wavelength: at("wavelength_m").wavelength_of(message.wavelength_m, &display)?,
        distance: distance(&at("place"), message.place.as_ref())?,
        patterns: patterns(&at("patterns"), message.patterns)?,
        aligned_by: aligned_by.as_ref().map(|dataset| dataset.id.clone()),
        exposure_s: exposure_s.transpose()?,
        exposures: at("exposure_count").integer_or(message.exposure_count, 1, 1..=EXPOSURES_MAX)?,
        display: display.id.clone(),
    };
    api.service.jobs.require_photographable(call, field, &spec, (&display, aligned_by.as_ref())).await?;
    Ok(spec)
}

fn patterns(field: &Field, patterns: Vec<capture_photos::Pattern>) -> Result<Vec<NamedPattern>> {
    if !(1..=PATTERNS_MAX).contains(&patterns.len()) {
        return Err(field.but(format!("has {} entries", patterns.len()), format!("must have 1 to {PATTERNS_MAX}")));
    }
    let mut ids = HashSet::new();
    collect_all(patterns.into_iter().enumerate().map(|(index, capture_photos::Pattern { id, pattern })| {
        let field = field.index(index);
        let id = names::pair_id(&field.at("id"), &id)?;
        if !ids.insert(id.clone()) {
            return Err(field.at("id").invalid(format!("is {id:?}, as of an earlier pattern"), "give each its own"));
        }
        Ok(NamedPattern { id, pattern: field.at("pattern").digest(&pattern)? })
    }))
}

/// Converts the request, with its defaults, into its message.
pub(super) fn to_wire(spec: CapturePhotos) -> v1::CapturePhotos {
    let pattern = |NamedPattern { id, pattern }| capture_photos::Pattern { id, pattern };
    v1::CapturePhotos {
        display: format!("displays/{}", spec.display),
        wavelength_m: Some(spec.wavelength.m()),
        place: place(spec.distance),
        patterns: spec.patterns.into_iter().map(pattern).collect(),
        aligned_by: spec.aligned_by.map(|id| format!("datasets/{id}")).unwrap_or_default(),
        exposure_s: spec.exposure_s,
        exposure_count: Some(spec.exposures),
    }
}

/// Converts the result into its message.
pub(super) fn result(result: CapturePhotosResult) -> v1::CapturePhotosResult {
    let CapturePhotosResult { rig, black_level, photos, retaken } = result;
    let retaken = retaken.into_iter().map(|Retaken { id, reason }| capture_photos_result::Retaken { id, reason });
    let (photos, retaken) = (photos.into_iter().map(photo).collect(), retaken.collect());
    v1::CapturePhotosResult { rig, black_level, photos, retaken }
}

fn photo(taken: CapturedPhoto) -> capture_photos_result::Photo {
    let CapturedPhoto { id, photo, frame, exposure_time_ms, exposure_s, correlation, other_correlation, temperature_c } =
        taken;
    capture_photos_result::Photo {
        id,
        photo,
        frame,
        exposure_time: Some(timestamp(exposure_time_ms)),
        exposure_s,
        correlation,
        other_correlation,
        temperature_c,
    }
}
