//! The optics engine's terms as messages.

use lightpath_domain::job::{Detector, Quality, Region};
use lightpath_domain::propagation::{ImageWindow, PropagationMethod, PropagationWarning, ValidityReport};
use lightpath_proto::v1;

/// The method as clients see it.
pub(crate) fn propagation_method(method: PropagationMethod) -> v1::PropagationMethod {
    match method {
        PropagationMethod::AngularSpectrum => v1::PropagationMethod::AngularSpectrum,
        PropagationMethod::BandLimited => v1::PropagationMethod::BandLimited,
        PropagationMethod::RayleighSommerfeld => v1::PropagationMethod::RayleighSommerfeld,
        PropagationMethod::FresnelTransferFunction => v1::PropagationMethod::FresnelTransferFunction,
        PropagationMethod::FresnelImpulseResponse => v1::PropagationMethod::FresnelImpulseResponse,
        PropagationMethod::Shifted => v1::PropagationMethod::Shifted,
        PropagationMethod::BandExtended => v1::PropagationMethod::BandExtended,
        PropagationMethod::Scaled => v1::PropagationMethod::Scaled,
        PropagationMethod::ScaledFresnel => v1::PropagationMethod::ScaledFresnel,
        PropagationMethod::Fraunhofer => v1::PropagationMethod::Fraunhofer,
    }
}

/// The report as clients see it.
pub(crate) fn validity_report(report: ValidityReport) -> v1::ValidityReport {
    let ImageWindow { width_px, height_px, pitch_x_m, pitch_y_m, centre_x_m, centre_y_m } = report.window;
    let warning = |PropagationWarning { code, text }| v1::PropagationWarning { code, text };
    v1::ValidityReport {
        method: propagation_method(report.method).into(),
        explanation: report.explanation,
        window: Some(v1::ImageWindow { width_px, height_px, pitch_x_m, pitch_y_m, centre_x_m, centre_y_m }),
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
        warnings: report.warnings.into_iter().map(warning).collect(),
    }
}

pub(crate) fn detector(detector: Detector) -> i32 {
    match detector {
        Detector::Point => v1::Detector::Point.into(),
        Detector::Pixel => v1::Detector::Pixel.into(),
        Detector::Supersampled => v1::Detector::Supersampled.into(),
    }
}

pub(crate) fn region(region: Region) -> v1::RegionOfInterest {
    let Region { x_px, y_px, width_px, height_px } = region;
    v1::RegionOfInterest { x_px, y_px, width_px, height_px }
}

pub(crate) fn quality(Quality { point, pixel, supersampled }: Quality) -> v1::Quality {
    v1::Quality {
        psnr_point_db: point.psnr_db,
        psnr_pixel_db: pixel.psnr_db,
        psnr_supersampled_db: supersampled.psnr_db,
        ssim_point: point.ssim,
        ssim_pixel: pixel.ssim,
        ssim_supersampled: supersampled.ssim,
        ms_ssim_point: point.ms_ssim,
        ms_ssim_pixel: pixel.ms_ssim,
        ms_ssim_supersampled: supersampled.ms_ssim,
        diffraction_efficiency_point: point.diffraction_efficiency,
        diffraction_efficiency_pixel: pixel.diffraction_efficiency,
        diffraction_efficiency_supersampled: supersampled.diffraction_efficiency,
        frame_efficiency_point: point.frame_efficiency,
        frame_efficiency_pixel: pixel.frame_efficiency,
        frame_efficiency_supersampled: supersampled.frame_efficiency,
        speckle_contrast_point: point.speckle_contrast,
        speckle_contrast_pixel: pixel.speckle_contrast,
        speckle_contrast_supersampled: supersampled.speckle_contrast,
    }
}
