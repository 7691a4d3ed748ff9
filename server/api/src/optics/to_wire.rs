//! Conversion of the terms of the optics engine into messages.

use crate::enumerations::OnWire as _;
use lightpath_domain::units::Distance;
use lightpath_optics::hologram::{DetectorQuality, Quality};
use lightpath_optics::second_opinion::SecondOpinion;
use lightpath_optics::{Detector, RegionOfInterest, ValidityReport};
use lightpath_proto::v1::{self, judgement, judgement::Stage};

/// Converts a validity report into its message.
pub(crate) fn validity_report(report: ValidityReport) -> v1::ValidityReport {
    let window = v1::ImageWindow {
        width_px: report.window.width_px() as u32,
        height_px: report.window.height_px() as u32,
        pitch_x_m: report.window.pitch_x_m(),
        pitch_y_m: Some(report.window.pitch_y_m()),
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

/// The place at a distance.
pub(crate) fn place(distance: Distance) -> Option<v1::Place> {
    Some(v1::Place::at_m(distance.m()))
}

/// Converts a region of interest into its message.
pub(crate) fn region_message(region: RegionOfInterest) -> v1::Region {
    let [x_px, y_px, width_px, height_px] =
        [region.x_px(), region.y_px(), region.width_px(), region.height_px()].map(|px| px as u32);
    v1::Region { x_px, y_px, width_px, height_px }
}

/// How well the display would show the phases, by the engine, for each detector.
pub(crate) fn engine_judgements(quality: Quality, stage: Stage) -> impl Iterator<Item = v1::Judgement> {
    let Quality { point, pixel, supersampled } = quality;
    let seen = [(Detector::Point, point), (Detector::Pixel, pixel), (Detector::Supersampled, supersampled)];
    seen.into_iter().map(move |(detector, seen)| {
        let DetectorQuality { psnr_db, ssim, ms_ssim, diffraction_efficiency, frame_efficiency, speckle_contrast } =
            seen;
        v1::Judgement {
            stage: stage.into(),
            ssim,
            ms_ssim,
            diffraction_efficiency: Some(diffraction_efficiency),
            frame_efficiency: Some(frame_efficiency),
            speckle_contrast,
            ..by_engine(detector, psnr_db)
        }
    })
}

/// How well a display of other orders would show the levels, by the engine.
pub(crate) fn other_orders(psnr_db: f64) -> v1::Judgement {
    v1::Judgement { orders: judgement::Orders::Other.into(), ..by_engine(Detector::Pixel, psnr_db) }
}

/// How well the display would show the levels on some rows: by the engine, and by the independent model.
pub(crate) fn opinions(opinion: SecondOpinion, detector: Detector) -> [v1::Judgement; 2] {
    let SecondOpinion { rows, engine_psnr_db, independent_psnr_db } = opinion;
    let engine = v1::Judgement { rows: Some(rows), ..by_engine(detector, engine_psnr_db) };
    let independent = v1::Judgement {
        model: judgement::Model::Independent.into(),
        psnr_db: Some(measure(independent_psnr_db)),
        contradicts: opinion.is_contradiction(),
        ..engine.clone()
    };
    [engine, independent]
}

fn by_engine(detector: Detector, psnr_db: f64) -> v1::Judgement {
    v1::Judgement {
        model: judgement::Model::Engine.into(),
        stage: Stage::Displayed.into(),
        detector: detector.to_wire(),
        orders: judgement::Orders::Own.into(),
        psnr_db: Some(measure(psnr_db)),
        ..v1::Judgement::default()
    }
}

/// A number of unknown uncertainty.
pub(crate) fn measure(value: f64) -> v1::Measure {
    v1::Measure { value, ..v1::Measure::default() }
}
