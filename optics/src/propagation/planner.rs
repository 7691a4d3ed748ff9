//! Which method where, and why.
//!
//! The image on the display's own pixels:
//!
//! | distance | method | because |
//! |---|---|---|
//! | z ≤ z_c along x and y | angular spectrum | its samples hold the whole band, and it is exact |
//! | z > z_c along x or y, and z ≥ 0.8·√(z_c,x · z_c,y) | Rayleigh–Sommerfeld impulse response | its samples hold the whole frame, and it is exact |
//! | between the two | band-limited angular spectrum | along the shorter side a little of the band is missing |
//!
//! Elsewhere: the shifted angular spectrum for an engine; otherwise the scaled Fresnel integral where all pixels reach all of the
//! window and its phase is off by less than 1e-3 rad, and the scaled angular spectrum where not. The band-extended angular spectrum
//! and the Fresnel methods on the display's pixels are never the best; they are there to be compared with.
//!
//! The rule is what comparing all methods with the [Rayleigh–Sommerfeld sum](crate::reference::rayleigh_sommerfeld) of a field sampled
//! three times as finely gave, of spots over the whole band, relative L2 error of the field, 32×48 px of 8 µm, 515 nm, z_c = 8.0 mm along
//! y and 11.9 mm along x:
//!
//! | z / z_c,y | angular spectrum | band-limited | band-extended | impulse response | scaled | Fresnel impulse response |
//! |---|---|---|---|---|---|---|
//! | 0.7 | 8e-3 | 8e-3 | 8e-3 | 6e-2 | 8e-3 | 2e-1 |
//! | 1.0 | 3e-3 | 8e-3 | 8e-3 | 5e-3 | 8e-3 | 5e-3 |
//! | 1.5 | 3e-2 | 6e-2 | 2e-2 | 3e-5 | 4e-3 | 6e-4 |
//! | 3 | 1e0 | 2e-1 | 9e-2 | 3e-8 | 4e-4 | 2e-4 |
//! | 15 | 1e1 | 7e-1 | 2e-1 | 7e-10 | 2e-2 | 2e-6 |
//!
//! What is left near 1e-2 below z_c is the field's own: its spots hold a little light beyond the pixels' band. Far beyond z_c the band
//! limit keeps the light that belongs into the frame, but cuts so sharply, so near, that the cut rings all over the image.

use super::quantity::{digits, length};
use super::report::{ValidityReport, neglected_phase_rad};
use super::{ConvolutionMethod, ImageWindow, PropagationMethod, limits};
use crate::{OpticalSetup, Result};

/// From this part of the critical distances' geometric mean on, the impulse response is better than the band limit.
const IMPULSE_RESPONSE_FROM: f64 = 0.8;
/// A paraxial phase that is off by less is as good as exact \[rad\].
const PARAXIAL_PHASE_RAD_MAX: f64 = 1e-3;

/// The best convolution for the setup's own window, whatever method the setup has: for an [`Engine`](crate::Engine).
///
/// ```
/// use lightpath_optics::propagation::{PropagationMethod, plan};
/// use lightpath_optics::{Grid, OpticalSetup};
///
/// let grid = Grid::try_new(1080, 1920, 8e-6)?;
/// let near = plan(&OpticalSetup::try_new(grid, 515e-9, 0.15)?)?;
/// assert_eq!((near.method, near.warnings.len()), (PropagationMethod::AngularSpectrum, 0));
/// let far = plan(&OpticalSetup::try_new(grid, 515e-9, 0.5)?)?;
/// assert_eq!(far.method, PropagationMethod::RayleighSommerfeld);
/// assert!((far.band_kept_y - 0.537).abs() < 1e-3, "{far}");
/// let farther = OpticalSetup::try_new(Grid::try_new(64, 64, 8e-6)?, 515e-9, 5.0)?;
/// println!("{}", plan(&farther).unwrap_err());
/// # Ok::<(), lightpath_optics::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Unsuitable`](crate::Error::Unsuitable), with the numbers, where no image can be right.
pub fn plan(setup: &OpticalSetup) -> Result<ValidityReport> {
    Ok(plan_convolution(setup)?.1)
}

/// [`plan`], and the method by the name that a setup takes.
pub(crate) fn plan_convolution(setup: &OpticalSetup) -> Result<(ConvolutionMethod, ValidityReport)> {
    let window = setup.window();
    let z = setup.distance_m().abs();
    let (x_m, y_m) = (setup.critical_distance_x_m(), setup.critical_distance_y_m());
    let (at, critical) =
        (length(z), format!("the critical distances, {} along x and {} along y", length(x_m), length(y_m)));
    let (method, explanation) = if window != ImageWindow::of(&setup.grid()) {
        let (x, y) = (length(window.centre_x_m()), length(window.centre_y_m()));
        (ConvolutionMethod::Shifted, format!("the image's middle is off the axis, {x} along x and {y} along y"))
    } else if z <= x_m.min(y_m) {
        (ConvolutionMethod::AngularSpectrum, format!("{at} is within {critical}, where it is exact"))
    } else if z >= IMPULSE_RESPONSE_FROM * (x_m * y_m).sqrt() {
        (ConvolutionMethod::RayleighSommerfeld, format!("{at} is beyond {critical}, where its samples are exact"))
    } else {
        (ConvolutionMethod::BandLimited, format!("{at} is just beyond one of {critical}"))
    };
    limits::check_picture(setup, method.into(), &window)?;
    Ok((method, report(setup, method.into(), &window, explanation)?))
}

/// The best method onto any window.
///
/// # Errors
///
/// [`Error::Unsuitable`](crate::Error::Unsuitable), with the numbers, where no image can be right.
pub fn plan_onto(setup: &OpticalSetup, window: &ImageWindow) -> Result<ValidityReport> {
    if *window == ImageWindow::of(&setup.grid()) {
        return plan(setup);
    }
    let method = method_onto(setup, window);
    let explanation = if method == PropagationMethod::ScaledFresnel {
        let off = digits(neglected_phase_rad(setup, method, window));
        format!("all pixels reach all of the window, and its phase is off by no more than {off} rad")
    } else {
        "the window is not the display's, and its phase is exact".to_owned()
    };
    report(setup, method, window, explanation)
}

/// How good a method is for the setup's own window, or for the one that the method has of itself.
///
/// # Errors
///
/// [`Error::Unsuitable`](crate::Error::Unsuitable), with the numbers, where the method can't be right.
pub fn assess(setup: &OpticalSetup, method: PropagationMethod) -> Result<ValidityReport> {
    let window = own_window(setup, method);
    limits::check_picture(setup, method, &window)?;
    report(setup, method, &window, "asked for".to_owned())
}

/// The numbers of a method, right or wrong.
#[must_use]
pub fn assess_regardless(setup: &OpticalSetup, method: PropagationMethod) -> ValidityReport {
    ValidityReport::new(setup, method, own_window(setup, method), "asked for".to_owned())
}

/// The window that a method computes of itself.
pub(crate) fn own_window(setup: &OpticalSetup, method: PropagationMethod) -> ImageWindow {
    match method {
        PropagationMethod::Fraunhofer => super::fraunhofer_window(setup),
        _ => setup.window(),
    }
}

/// The better one of the two methods that compute any window.
pub(crate) fn method_onto(setup: &OpticalSetup, window: &ImageWindow) -> PropagationMethod {
    let fresnel_is_right = limits::check(setup, PropagationMethod::ScaledFresnel, window).is_ok();
    let as_good = neglected_phase_rad(setup, PropagationMethod::ScaledFresnel, window) < PARAXIAL_PHASE_RAD_MAX;
    let other_is_right = limits::check(setup, PropagationMethod::Scaled, window).is_ok();
    if fresnel_is_right && (as_good || !other_is_right) {
        PropagationMethod::ScaledFresnel
    } else {
        PropagationMethod::Scaled
    }
}

fn report(
    setup: &OpticalSetup,
    method: PropagationMethod,
    window: &ImageWindow,
    explanation: String,
) -> Result<ValidityReport> {
    limits::check(setup, method, window)?;
    Ok(ValidityReport::new(setup, method, *window, explanation))
}
