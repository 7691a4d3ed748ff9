//! Conversion of the terms of the optics engine into messages.

use crate::enumerations::OnWire as _;
use lightpath_optics::hologram::{DetectorQuality, Quality};
use lightpath_optics::second_opinion::SecondOpinion;
use lightpath_optics::{RegionOfInterest, ValidityReport};
use lightpath_proto::v1;

/// Converts a validity report into its message.
pub(crate) fn validity_report(report: ValidityReport) -> v1::ValidityReport {
    let window = v1::ImageWindow {
        width_px: report.window.width_px() as u32,
        height_px: report.window.height_px() as u32,
        pitch_x_m: report.window.pitch_x_m(),
        pitch_y_m: report.window.pitch_y_m(),
        centre_x_m: report.window.centre_x_m(),
        centre_y_m: report.window.centre_y_m(),
    };
    let warnings = report.warnings.into_iter();
    let warnings =
        warnings.map(|warning| v1::PropagationWarning { code: warning.code.as_str().to_owned(), text: warning.text });
    v1::ValidityReport {
        method: report.method.to_wire(),
        explanation: report.explanation,
        window: Some(window),
        critical_distance_x_m: report.critical_distance_x_m,
        critical_distance_y_m: report.critical_distance_y_m,
        band_kept_x: report.band_kept_x,
        band_kept_y: report.band_kept_y,
        band_kept_area: report.band_kept_area,
        fresnel_number: report.fresnel_number,
        diffraction_angle_rad: report.diffraction_angle_rad,
        spread_m: report.spread_m,
        full_cone_x_m: report.full_cone_x_m,
        full_cone_y_m: report.full_cone_y_m,
        neglected_phase_rad: report.neglected_phase_rad,
        warnings: warnings.collect(),
    }
}

/// Converts a region of interest into its message.
pub(crate) fn region_message(region: RegionOfInterest) -> v1::RegionOfInterest {
    let [x_px, y_px, width_px, height_px] =
        [region.x_px(), region.y_px(), region.width_px(), region.height_px()].map(|px| px as u32);
    v1::RegionOfInterest { x_px, y_px, width_px, height_px }
}

pub(crate) fn second_opinion(opinion: SecondOpinion) -> v1::SecondOpinion {
    let SecondOpinion { rows, engine_psnr_db, independent_psnr_db } = opinion;
    v1::SecondOpinion { rows, engine_psnr_db, independent_psnr_db, contradicts: opinion.is_contradiction() }
}

pub(crate) fn quality(quality: Quality) -> v1::Quality {
    let Quality { point, pixel, supersampled } = quality;
    v1::Quality { point: Some(seen(point)), pixel: Some(seen(pixel)), supersampled: Some(seen(supersampled)) }
}

fn seen(seen: DetectorQuality) -> v1::SeenQuality {
    let DetectorQuality { psnr_db, ssim, ms_ssim, diffraction_efficiency, frame_efficiency, speckle_contrast } = seen;
    v1::SeenQuality { psnr_db, ssim, ms_ssim, diffraction_efficiency, frame_efficiency, speckle_contrast }
}
