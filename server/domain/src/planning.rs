//! From displays to optical setups, and from the planner's reports to ours.

use crate::display::{Display, SimulatedBench};
use crate::propagation::{ImageWindow, PropagationMethod, PropagationWarning, ValidityReport};
use crate::units::{Distance, Wavelength};
use lightpath_optics::propagation::{self, ConvolutionMethod, PropagationMethod as Method, assess, assess_regardless};
use lightpath_optics::{Grid, OpticalSetup, Result, SimulatedBench as Imperfections};

/// A display at a wavelength and distance.
///
/// # Errors
///
/// [`lightpath_optics::Error`] for what no display is; a stored one always is possible.
pub fn setup(display: &Display, wavelength: Wavelength, distance: Distance) -> Result<OpticalSetup> {
    let grid = Grid::try_new(display.height_px as usize, display.width_px as usize, display.pixel_pitch_m)?;
    OpticalSetup::try_new(grid, wavelength.m(), distance.m())
}

/// The setup with the method asked for, or by the planner's choice, and how good that is.
///
/// # Errors
///
/// [`lightpath_optics::Error::Unsuitable`], with the numbers, where the method, or every one, can't be right.
pub fn planned(setup: OpticalSetup, method: Option<PropagationMethod>) -> Result<(OpticalSetup, ValidityReport)> {
    let (setup, found) = match method.map(to_optics) {
        None => setup.planned()?,
        Some(method) => (setup.with_method(ConvolutionMethod::try_from(method)?)?, assess(&setup, method)?),
    };
    Ok((setup, report(&found)))
}

/// How good the setup's own method is, right or wrong.
pub fn assessed(setup: &OpticalSetup, explanation: &str) -> ValidityReport {
    let found = assess_regardless(setup, setup.method().into());
    ValidityReport { explanation: explanation.to_owned(), ..report(&found) }
}

/// The planner's report as ours.
pub fn report(report: &propagation::ValidityReport) -> ValidityReport {
    let window = &report.window;
    let warning = |warning: &propagation::PropagationWarning| PropagationWarning {
        code: warning.code.as_str().to_owned(),
        text: warning.text.clone(),
    };
    ValidityReport {
        method: from_optics(report.method),
        explanation: report.explanation.clone(),
        window: ImageWindow {
            width_px: window.width_px() as u32,
            height_px: window.height_px() as u32,
            pitch_x_m: window.pitch_x_m(),
            pitch_y_m: window.pitch_y_m(),
            centre_x_m: window.centre_x_m(),
            centre_y_m: window.centre_y_m(),
        },
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
        warnings: report.warnings.iter().map(warning).collect(),
    }
}

/// Ours as the engine's.
pub fn to_optics(method: PropagationMethod) -> Method {
    match method {
        PropagationMethod::AngularSpectrum => Method::AngularSpectrum,
        PropagationMethod::BandLimited => Method::BandLimited,
        PropagationMethod::RayleighSommerfeld => Method::RayleighSommerfeld,
        PropagationMethod::FresnelTransferFunction => Method::FresnelTransferFunction,
        PropagationMethod::FresnelImpulseResponse => Method::FresnelImpulseResponse,
        PropagationMethod::Shifted => Method::Shifted,
        PropagationMethod::BandExtended => Method::BandExtended,
        PropagationMethod::Scaled => Method::Scaled,
        PropagationMethod::ScaledFresnel => Method::ScaledFresnel,
        PropagationMethod::Fraunhofer => Method::Fraunhofer,
    }
}

/// The engine's as ours.
pub fn from_optics(method: Method) -> PropagationMethod {
    match method {
        Method::AngularSpectrum => PropagationMethod::AngularSpectrum,
        Method::BandLimited => PropagationMethod::BandLimited,
        Method::RayleighSommerfeld => PropagationMethod::RayleighSommerfeld,
        Method::FresnelTransferFunction => PropagationMethod::FresnelTransferFunction,
        Method::FresnelImpulseResponse => PropagationMethod::FresnelImpulseResponse,
        Method::Shifted => PropagationMethod::Shifted,
        Method::BandExtended => PropagationMethod::BandExtended,
        Method::Scaled => PropagationMethod::Scaled,
        Method::ScaledFresnel => PropagationMethod::ScaledFresnel,
        Method::Fraunhofer => PropagationMethod::Fraunhofer,
    }
}

/// A simulated display's bench as the optics draw it.
pub fn imperfections(bench: SimulatedBench) -> Imperfections {
    Imperfections {
        seed: bench.seed,
        strength: bench.strength,
        camera_noise: bench.camera_noise,
        misalignment_px: bench.misalignment_px,
        rotation_deg: bench.rotation_deg,
        blur_px: bench.blur_px,
        full_well_electrons: bench.full_well_electrons,
        speckle_contrast: bench.speckle_contrast,
        crosstalk_px: bench.crosstalk_px,
        flicker: bench.flicker,
        drift_px_per_hour: bench.drift_px_per_hour,
        dimming_per_hour: bench.dimming_per_hour,
        rail_tilt_deg: bench.rail_tilt_deg,
        aberrations_at_m: bench.aberrations_at_m,
        field_aberration_rad: bench.field_aberration_rad,
    }
}
