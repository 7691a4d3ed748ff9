//! The planner: chooses a propagation method for a setup and explains the choice.
//!
//! Rules for an image on the display's own pixels:
//!
//! | distance | method | because |
//! |---|---|---|
//! | any, if the display shows all orders of its pixels | response of square pixels | only it computes them |
//! | any, behind a filter | band response | only it computes what a filter passes |
//! | any, if the light of a pixel spreads over some ten thousand pixels at most | band response | it is exact for the first order of the pixels |
//! | otherwise, z ≤ z_c along x and y | angular spectrum | its samples hold the whole band |
//! | otherwise, z ≥ 0.8·√(z_c,x · z_c,y) | Rayleigh–Sommerfeld impulse response | its samples hold the whole frame |
//! | otherwise | band-limited angular spectrum | along the shorter side it lacks only a little of the band |
//!
//! Rules for other windows: an engine uses the shifted angular spectrum. A propagator uses the scaled Fresnel integral
//! where all pixels reach all of the window and its phase error is below 1e-3 rad, and the scaled angular spectrum
//! otherwise. The planner never chooses the band-extended angular spectrum or the Fresnel methods on the display's
//! pixels: they are never the best, and serve comparisons.
//!
//! The rules come from a comparison of all methods with the [direct integral of the first
//! order](crate::reference::first_order_onto), of a random field on 32×48 px of 8 µm at 515 nm; z_c is 8.0 mm along y
//! and
//! 11.9 mm along x. The table gives the relative L2 error of the field:
//!
//! | z / z_c,y | band response | angular spectrum | band-limited | band-extended | impulse response | scaled | Fresnel impulse response |
//! |---|---|---|---|---|---|---|---|
//! | 0.7 | 3e-7 | 5e-2 | 5e-2 | 5e-2 | 4e-1 | 7e-2 | 7e-1 |
//! | 1.0 | 5e-7 | 1e-1 | 1e-1 | 1e-1 | 3e-1 | 1e-1 | 4e-1 |
//! | 1.5 | 1e-6 | 5e-1 | 2e-1 | 2e-1 | 1e-1 | 1e-1 | 1e-1 |
//! | 3 | 1e-5 | 2e0 | 3e-1 | 1e-1 | 5e-2 | 5e-2 | 5e-2 |
//! | 15 | 7e-5 | 8e0 | 3e-1 | 7e-2 | 1e-2 | 2e-2 | 1e-2 |
//!
//! A random field has light up to the end of its band. The light of a pixel has no sharp end in space, because its band
//! ends sharply, so on a frame of twice the side some of it wraps around even within the critical distance. The impulse
//! response is that of points: it also holds the light that the first order lacks.

use super::quantity::{digits, length};
use super::report::{ValidityReport, neglected_phase_rad};
use super::{band_response, limits};
use crate::display::{ImageWindow, OpticalSetup, Orders};
use crate::error::Result;
use crate::propagation_method::{ConvolutionMethod, PropagationMethod};

/// Smallest distance at which the impulse response is better than the band limit, as a part of the geometric mean of
/// the two critical distances.
const IMPULSE_RESPONSE_FROM: f64 = 0.8;
/// Phase error \[rad\] below which a paraxial method counts as exact.
const PARAXIAL_PHASE_RAD_MAX: f64 = 1e-3;

/// Chooses the best convolution for the setup's own window, for use by an [`Engine`](crate::Engine). The method that
/// the setup has is ignored.
///
/// ```
/// use lightpath_optics::propagation::{PropagationMethod, plan};
/// use lightpath_optics::{Grid, OpticalSetup};
///
/// let grid = Grid::try_new(1080, 1920, 8e-6)?;
/// let near = plan(&OpticalSetup::try_new(grid, 515e-9, 0.15)?)?;
/// assert_eq!((near.method, near.warnings.len()), (PropagationMethod::BandResponse, 0));
/// let far = plan(&OpticalSetup::try_new(grid, 515e-9, 0.5)?)?;
/// assert!((far.band_kept_y - 0.537).abs() < 1e-3, "{far}");
/// let farther = OpticalSetup::try_new(Grid::try_new(64, 64, 8e-6)?, 515e-9, 5.0)?;
/// println!("{}", plan(&farther).unwrap_err());
/// # Ok::<(), lightpath_optics::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Unsuitable`](crate::Error::Unsuitable), with the numbers, where no method can be valid.
pub fn plan(setup: &OpticalSetup) -> Result<ValidityReport> {
    Ok(plan_convolution(setup)?.1)
}

/// [`plan`], which also returns the method as the type that a setup takes.
pub(crate) fn plan_convolution(setup: &OpticalSetup) -> Result<(ConvolutionMethod, ValidityReport)> {
    let window = setup.window();
    let z = setup.distance_m().abs();
    let (x_m, y_m) = (setup.critical_distance_x_m(), setup.critical_distance_y_m());
    let (at, critical) =
        (length(z), format!("the critical distances, {} along x and {} along y", length(x_m), length(y_m)));
    let (method, explanation) = if window != ImageWindow::of(&setup.grid()) {
        let (x, y) = (length(window.centre_x_m()), length(window.centre_y_m()));
        (ConvolutionMethod::Shifted, format!("the image's middle is off the axis, {x} along x and {y} along y"))
    } else if let Some(filter) = setup.orders().filter() {
        let [width, height] = [filter.width, filter.height].map(digits);
        let explanation = format!(
            "at {at}, as at every distance, this method is exact for the part of the first order that the filter passes, \
             {width} of it along x and {height} along y"
        );
        (ConvolutionMethod::BandResponse, explanation)
    } else if setup.orders() != Orders::First {
        let apart = length(setup.wavelength_m() * z / setup.grid().pixel_pitch_m());
        let explanation = format!("the display shows all orders of its pixels, which are {apart} apart at {at}");
        (ConvolutionMethod::AllOrders, explanation)
    } else if band_response::bins(setup).is_some() {
        let explanation =
            format!("at {at}, as at every distance, this method is exact for the first order of the pixels");
        (ConvolutionMethod::BandResponse, explanation)
    } else if z <= x_m.min(y_m) {
        (
            ConvolutionMethod::AngularSpectrum,
            format!("{at} is within {critical}, where its samples hold the whole band"),
        )
    } else if z >= IMPULSE_RESPONSE_FROM * (x_m * y_m).sqrt() {
        (
            ConvolutionMethod::RayleighSommerfeld,
            format!("{at} is not far below {critical}, or beyond, where its samples hold the whole frame"),
        )
    } else {
        (ConvolutionMethod::BandLimited, format!("{at} is just beyond one of {critical}"))
    };
    limits::check_picture(setup, method.into(), &window)?;
    Ok((method, report(setup, method.into(), &window, explanation)?))
}

/// Chooses the best method onto any window.
///
/// # Errors
///
/// [`Error::Unsuitable`](crate::Error::Unsuitable), with the numbers, where no method can be valid.
pub fn plan_onto(setup: &OpticalSetup, window: &ImageWindow) -> Result<ValidityReport> {
    if *window == ImageWindow::of(&setup.grid()) {
        return plan(setup);
    }
    let method = method_onto(setup, window);
    let explanation = if method == PropagationMethod::ScaledFresnel {
        let off = digits(neglected_phase_rad(setup, method, window));
        format!("the light of each pixel reaches the whole window, and the phase error is at most {off} rad")
    } else {
        "the window is not the display's own, and the phase of this method is exact".to_owned()
    };
    report(setup, method, window, explanation)
}

/// Reports the quality of a method for the setup's own window, or for the window that the method prescribes
/// (Fraunhofer).
///
/// # Errors
///
/// [`Error::Unsuitable`](crate::Error::Unsuitable), with the numbers, where the method cannot be valid.
pub fn assess(setup: &OpticalSetup, method: PropagationMethod) -> Result<ValidityReport> {
    let window = own_window(setup, method);
    limits::check_picture(setup, method, &window)?;
    report(setup, method, &window, "chosen by the caller".to_owned())
}

/// Reports the quality of a method, even where the method is not valid.
#[must_use]
pub fn assess_regardless(setup: &OpticalSetup, method: PropagationMethod) -> ValidityReport {
    ValidityReport::new(setup, method, own_window(setup, method), "chosen by the caller".to_owned())
}

/// The window on which a method computes the image by default.
pub(crate) fn own_window(setup: &OpticalSetup, method: PropagationMethod) -> ImageWindow {
    match method {
        PropagationMethod::Fraunhofer => super::fraunhofer::fraunhofer_window(setup),
        _ => setup.window(),
    }
}

/// The better of the two methods that can compute any window: scaled Fresnel or scaled angular spectrum.
pub(crate) fn method_onto(setup: &OpticalSetup, window: &ImageWindow) -> PropagationMethod {
    let fresnel_is_valid = limits::check(setup, PropagationMethod::ScaledFresnel, window).is_ok();
    let fresnel_is_accurate =
        neglected_phase_rad(setup, PropagationMethod::ScaledFresnel, window) < PARAXIAL_PHASE_RAD_MAX;
    let angular_spectrum_is_valid = limits::check(setup, PropagationMethod::Scaled, window).is_ok();
    if fresnel_is_valid && (fresnel_is_accurate || !angular_spectrum_is_valid) {
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
