//! Checks that refuse a method for a setup where it cannot be valid.

use super::band_extended::band_extended_axes;
use super::frequency_window::check_frequencies;
use super::quantity::{digits, length, percent};
use super::report::{Band, neglected_phase_rad};
use super::scaled::{scaled_axes, spread_m};
use super::scaled_fresnel::farthest_m;
use super::{band_response, pixel_response};
use crate::display::{ImageWindow, OpticalSetup, Orders};
use crate::error::{Error, Result};
use crate::propagation_method::{ConvolutionMethod, PropagationMethod, RefusalCode};
use std::f64::consts::{FRAC_PI_2, PI};

/// Fewest resolved points along a side of a window. With fewer, the window shows only a part of one speckle.
const RESOLVED_POINTS_MIN: f64 = 2.0;
/// Smallest part of the band within sharp limits. With less, the ringing is as bright as the image: a band of 1/5 had
/// measured errors of 10 to 50 %.
const SHARP_BAND_MIN: f64 = 0.2;
/// Smallest distance for the impulse response, as a part of the critical distance. At smaller distances the fading cuts
/// into the light of the image.
const IMPULSE_RESPONSE_REACH_MIN: f64 = 0.5;
/// Largest phase error of a paraxial method \[rad\]. With a larger error bright parts of the image become dark.
const NEGLECTED_PHASE_RAD_MAX: f64 = PI;
/// Largest phase error of the far field \[rad\]: four times the error at the usual λ/8 criterion z = 2D²/λ. It is
/// smaller than for other paraxial methods, because the error affects the whole image.
const FAR_FIELD_PHASE_RAD_MAX: f64 = FRAC_PI_2;

/// Checks that `method` can be valid for the setup and the window.
///
/// # Errors
///
/// [`Error::Unsuitable`] where `method` cannot be valid.
pub(crate) fn check(setup: &OpticalSetup, method: PropagationMethod, window: &ImageWindow) -> Result<()> {
    check_window(setup, method, window)?;
    check_orders(setup, method)?;
    check_light(setup, method, window)?;
    match method {
        PropagationMethod::BandResponse => check_bins(setup, method)?,
        PropagationMethod::AllOrders => check_pixel_size(setup, method)?,
        PropagationMethod::AngularSpectrum | PropagationMethod::FresnelTransferFunction => {
            check_whole_band(setup, method)?
        }
        PropagationMethod::BandLimited | PropagationMethod::Shifted => check_sharp_band(setup, method, window)?,
        PropagationMethod::RayleighSommerfeld => check_impulse_response(setup, method, IMPULSE_RESPONSE_REACH_MIN)?,
        PropagationMethod::FresnelImpulseResponse => check_impulse_response(setup, method, 1.0)?,
        PropagationMethod::BandExtended => {
            let axes = band_extended_axes(setup);
            check_frequencies(method, &axes[0], &axes[1])?;
        }
        PropagationMethod::Scaled => {
            let axes = scaled_axes(setup, window);
            check_frequencies(method, &axes[0], &axes[1])?;
        }
        PropagationMethod::ScaledFresnel => check_reached_window(setup, method, window)?,
        PropagationMethod::Fraunhofer => {}
    }
    check_neglected_phase(setup, method, window)
}

/// # Errors
///
/// [`Error::Unsuitable`] for a method that is not a convolution on the padded grid.
impl TryFrom<PropagationMethod> for ConvolutionMethod {
    type Error = Error;

    fn try_from(method: PropagationMethod) -> Result<Self> {
        match method {
            PropagationMethod::BandResponse => Ok(Self::BandResponse),
            PropagationMethod::AllOrders => Ok(Self::AllOrders),
            PropagationMethod::AngularSpectrum => Ok(Self::AngularSpectrum),
            PropagationMethod::BandLimited => Ok(Self::BandLimited),
            PropagationMethod::Shifted => Ok(Self::Shifted),
            PropagationMethod::RayleighSommerfeld => Ok(Self::RayleighSommerfeld),
            PropagationMethod::FresnelTransferFunction => Ok(Self::FresnelTransferFunction),
            PropagationMethod::FresnelImpulseResponse => Ok(Self::FresnelImpulseResponse),
            PropagationMethod::BandExtended
            | PropagationMethod::Scaled
            | PropagationMethod::ScaledFresnel
            | PropagationMethod::Fraunhofer => {
                let reason =
                    "an engine runs only convolutions on the padded grid, and this method is not one".to_owned();
                Err(Error::Unsuitable { method, code: RefusalCode::NoConvolution, reason })
            }
        }
    }
}

fn refusal(method: PropagationMethod, code: RefusalCode, reason: String) -> Error {
    Error::Unsuitable { method, code, reason }
}

/// Checks that `method` can compute the image on `window`. Only some methods can move or scale the window.
fn check_window(setup: &OpticalSetup, method: PropagationMethod, window: &ImageWindow) -> Result<()> {
    let own = ImageWindow::of(&setup.grid());
    let (fits, needed) = match method {
        PropagationMethod::Scaled | PropagationMethod::ScaledFresnel => return Ok(()),
        PropagationMethod::Shifted => {
            (window.has_pixels_of(&setup.grid()), "the number and the pitch of the display's pixels")
        }
        PropagationMethod::Fraunhofer => {
            (*window == super::fraunhofer::fraunhofer_window(setup), "a pitch of λz divided by the side of the display")
        }
        _ => (*window == own, "the number and the pitch of the display's pixels, and its centre on the axis"),
    };
    if fits {
        return Ok(());
    }
    Err(refusal(method, RefusalCode::OtherWindow, format!("the window must have {needed}")))
}

fn check_light(setup: &OpticalSetup, method: PropagationMethod, window: &ImageWindow) -> Result<()> {
    let band = Band::new(setup, window);
    for (axis, kept) in [("x", band.kept_x), ("y", band.kept_y)] {
        if kept <= 0.0 {
            let spread = spread_m(setup.grid().pixel_pitch_m(), setup.wavelength_m(), setup.distance_m());
            let [z, spread] = [setup.distance_m().abs(), spread].map(length);
            let reason =
                format!("at {z} no light lands in the window along {axis}: light moves sideways by at most {spread}");
            return Err(refusal(method, RefusalCode::WindowUnreachable, reason));
        }
    }
    Ok(())
}

/// Checks that a window opposite the display can hold a picture.
///
/// # Errors
///
/// [`Error::Unsuitable`] for a window that resolves too few points.
pub(super) fn check_picture(setup: &OpticalSetup, method: PropagationMethod, window: &ImageWindow) -> Result<()> {
    let (grid, band) = (setup.grid(), Band::new(setup, window));
    for (axis, kept, side_px, window_px, window_pitch_m) in [
        ("x", band.kept_x, grid.width_px(), window.width_px(), window.pitch_x_m()),
        ("y", band.kept_y, grid.height_px(), window.height_px(), window.pitch_y_m()),
    ] {
        let points = kept * window_px as f64 * window_pitch_m / grid.pixel_pitch_m();
        // Displays and windows with sides of one to three pixels need only half as many points.
        if points < RESOLVED_POINTS_MIN.min(side_px.min(window_px) as f64 / 2.0) {
            let reason = format!(
                "at {} only {} of the band lands in the image along {axis}, which resolves {} of its {window_px} \
                 pixels; use a shorter distance or a larger window",
                length(setup.distance_m().abs()),
                percent(kept),
                digits(points)
            );
            return Err(refusal(method, RefusalCode::BandLost, reason));
        }
    }
    Ok(())
}

/// The name of each axis with its critical distance \[m\].
fn critical_distances(setup: &OpticalSetup) -> [(&'static str, f64); 2] {
    [("x", setup.critical_distance_x_m()), ("y", setup.critical_distance_y_m())]
}

fn check_whole_band(setup: &OpticalSetup, method: PropagationMethod) -> Result<()> {
    let z = setup.distance_m().abs();
    for (axis, critical_m) in critical_distances(setup) {
        if z > critical_m {
            let reason = format!(
                "the padded frame samples the whole band along {axis} up to {}, but at {} light that leaves on one \
                 side would come back on the other; use the band response",
                length(critical_m),
                length(z)
            );
            return Err(refusal(method, RefusalCode::Aliased, reason));
        }
    }
    Ok(())
}

/// Checks that the method computes the diffraction orders that the display shows.
fn check_orders(setup: &OpticalSetup, method: PropagationMethod) -> Result<()> {
    let reason = match (setup.orders(), method) {
        (Orders::First | Orders::Filtered(_), PropagationMethod::AllOrders) => {
            "it computes all orders, and the display shows only the first order of its pixels"
        }
        (Orders::Filtered(_), method) if method != PropagationMethod::BandResponse => {
            "it lets the whole first order through, and the display has a filter; use the band response"
        }
        (Orders::All { .. }, method) if method != PropagationMethod::AllOrders => {
            "it computes only the first order, and the display shows all orders of its pixels"
        }
        _ => return Ok(()),
    };
    Err(refusal(method, RefusalCode::OtherOrders, reason.to_owned()))
}

fn check_pixel_size(setup: &OpticalSetup, method: PropagationMethod) -> Result<()> {
    let (z, nearest_m) = (setup.distance_m().abs(), pixel_response::nearest_m(setup));
    if z >= nearest_m {
        return Ok(());
    }
    let reason = format!(
        "at {} the image is a shadow of the pixels of {}; use it from {} on",
        length(z),
        length(setup.grid().pixel_pitch_m()),
        length(nearest_m)
    );
    Err(refusal(method, RefusalCode::TooNear, reason))
}

fn check_bins(setup: &OpticalSetup, method: PropagationMethod) -> Result<()> {
    if band_response::bins(setup).is_some() {
        return Ok(());
    }
    let spread = spread_m(setup.grid().pixel_pitch_m(), setup.wavelength_m(), setup.distance_m());
    let fix = match setup.orders() {
        Orders::Filtered(_) => "no other method holds the display's filter, so use a shorter distance",
        _ => "leave the choice to the planner",
    };
    let reason = format!(
        "at {} the light of a pixel spreads by {} to each side, which takes too many frequencies; {fix}",
        length(setup.distance_m().abs()),
        length(spread)
    );
    Err(refusal(method, RefusalCode::TooManyFrequencies, reason))
}

fn check_sharp_band(setup: &OpticalSetup, method: PropagationMethod, window: &ImageWindow) -> Result<()> {
    let band = Band::new(setup, window);
    for (axis, kept) in [("x", band.kept_x), ("y", band.kept_y)] {
        if kept < SHARP_BAND_MIN {
            let reason = format!(
                "at {} the band limit keeps {} of the band along {axis}, but with less than {} its ringing is as \
                 bright as the image; use the band response or a scaled window",
                length(setup.distance_m().abs()),
                percent(kept),
                percent(SHARP_BAND_MIN)
            );
            return Err(refusal(method, RefusalCode::BandLost, reason));
        }
    }
    Ok(())
}

fn check_impulse_response(setup: &OpticalSetup, method: PropagationMethod, reach_min: f64) -> Result<()> {
    let z = setup.distance_m().abs();
    for (axis, critical_m) in critical_distances(setup) {
        if z < reach_min * critical_m {
            let reason = format!(
                "at {} the phase of the impulse response changes by {} of a cycle from pixel to pixel at the frame's \
                 end along {axis}, but pixels can sample at most half a cycle; use it from {} on, and the band \
                 response below",
                length(z),
                digits(0.5 * critical_m / z),
                length(reach_min * critical_m)
            );
            return Err(refusal(method, RefusalCode::Undersampled, reason));
        }
    }
    Ok(())
}

fn check_reached_window(setup: &OpticalSetup, method: PropagationMethod, window: &ImageWindow) -> Result<()> {
    let reach_m = 0.5 * setup.wavelength_m() * setup.distance_m().abs() / setup.grid().pixel_pitch_m();
    let (x_m, y_m) = farthest_m(setup, window);
    for (axis, farthest_m) in [("x", x_m), ("y", y_m)] {
        if farthest_m > reach_m {
            let reason = format!(
                "along {axis} the window and the display are up to {} apart, but at {} the light of a pixel reaches \
                 only {} to a side",
                length(farthest_m),
                length(setup.distance_m().abs()),
                length(reach_m)
            );
            return Err(refusal(method, RefusalCode::Undersampled, reason));
        }
    }
    Ok(())
}

fn check_neglected_phase(setup: &OpticalSetup, method: PropagationMethod, window: &ImageWindow) -> Result<()> {
    let error_rad = neglected_phase_rad(setup, method, window);
    let (error_rad_max, code, what) = match method {
        PropagationMethod::Fraunhofer => {
            (FAR_FIELD_PHASE_RAD_MAX, RefusalCode::NotFar, "the display is too large for the far field, whose phase")
        }
        _ => (
            NEGLECTED_PHASE_RAD_MAX,
            RefusalCode::NotParaxial,
            "the light is too steep for a paraxial method, whose phase",
        ),
    };
    if error_rad <= error_rad_max {
        return Ok(());
    }
    let [error, error_max] = [error_rad, error_rad_max].map(digits);
    let z = length(setup.distance_m().abs());
    Err(refusal(
        method,
        code,
        format!("at {z} {what} has an error of {error} rad, but at most {error_max} rad is allowed"),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn convolution_methods_convert_and_other_methods_are_refused() {
        for method in ConvolutionMethod::ALL {
            let named = PropagationMethod::from(method);
            assert_eq!((ConvolutionMethod::try_from(named), method.to_string()), (Ok(method), named.to_string()));
        }
        let convolutions =
            PropagationMethod::ALL.into_iter().filter(|&method| ConvolutionMethod::try_from(method).is_ok());
        assert_eq!(convolutions.count(), ConvolutionMethod::ALL.len());
    }
}
