//! Filter of a display's optics, which lets through a part of the first order of its pixels.
//!
//! ```text
//! place on the stop = λ f · ν/Δ,   ν from −½ to ½ cycles per pixel
//! ```
//!
//! A lens of focal length f \[m\] spreads the spectrum of the hologram over its focal plane, where each order takes
//! λf/Δ. A stop there passes some frequencies ν and absorbs the others. λ is the wavelength \[m\], Δ the pixel pitch
//! \[m\]. Source: J. W. Goodman, Introduction to Fourier Optics, chapter on spatial filtering.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Shape of a filter's opening.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FilterShape {
    /// A rectangle, such as two slits or a knife edge.
    #[default]
    Rectangle,
    /// An ellipse, such as an iris.
    Ellipse,
}

/// Opening of a filter. Sides and centre are in orders, the distance between two diffraction orders in the filter's
/// plane. The centre counts from the middle of the steered image's spectrum: on a display with a
/// [carrier](crate::Carrier), half an order beside the undiffracted light.
///
/// Half-order filtering passes less than a whole order along the axis of the carrier, for example a side of ½. The
/// undiffracted light lies half an order beside the centre, and the filter absorbs it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OrderFilter {
    /// Shape of the opening.
    pub shape: FilterShape,
    /// Side along x, in orders.
    pub width: f64,
    /// Side along y, in orders.
    pub height: f64,
    /// Centre along x, in orders.
    pub centre_x: f64,
    /// Centre along y, in orders.
    pub centre_y: f64,
}

impl OrderFilter {
    /// Smallest side, in orders.
    pub const SIDE_MIN: f64 = 0.1;
    /// Width over which the light falls off at an edge, in orders. The focus of a display of 50 pixels is as wide. A
    /// sharper edge would only add faint light far beside the image.
    pub const EDGE: f64 = 0.02;

    /// A rectangle in the middle.
    #[must_use]
    pub fn rectangle(width: f64, height: f64) -> Self {
        Self { shape: FilterShape::Rectangle, width, height, centre_x: 0.0, centre_y: 0.0 }
    }

    /// Largest distance of the centre from the middle of the order, for a side along the same axis, in orders. Beyond
    /// it the opening would reach into the next order.
    #[must_use]
    pub fn centre_max(side: f64) -> f64 {
        0.5 * (1.0 - side)
    }

    /// Whether a centre is at most [`Self::centre_max`] from the middle. Sides such as 0.4 are not exact in binary.
    #[must_use]
    pub fn is_inside(centre: f64, side: f64) -> bool {
        centre.abs() <= Self::centre_max(side) + 1e-9
    }

    /// Checks that the opening lies within the first order.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for a side that is not between [`Self::SIDE_MIN`] and 1, or a centre from which the
    /// opening reaches beyond the first order.
    pub fn validate(self) -> Result<()> {
        for (name, value) in [("filter_width", self.width), ("filter_height", self.height)] {
            if !(Self::SIDE_MIN..=1.0).contains(&value) {
                return Err(Error::OutOfRange { name, value, allowed: "0.1 to 1 orders" });
            }
        }
        for (name, value, side) in
            [("filter_centre_x", self.centre_x, self.width), ("filter_centre_y", self.centre_y, self.height)]
        {
            if !Self::is_inside(value, side) {
                let allowed = "a place where the opening lies within the first order, −½ to ½ orders";
                return Err(Error::OutOfRange { name, value, allowed });
            }
        }
        Ok(())
    }

    /// Part of the amplitude that passes at a frequency \[cycles per pixel\], from 0 to 1. At the edges it falls off as
    /// cos² over a width of [`Self::EDGE`].
    #[must_use]
    pub fn passed(&self, nu_x: f64, nu_y: f64) -> f64 {
        let (x, y) = (nu_x - self.centre_x, nu_y - self.centre_y);
        match self.shape {
            FilterShape::Rectangle => along(nu_x, self.centre_x, self.width) * along(nu_y, self.centre_y, self.height),
            FilterShape::Ellipse => {
                let [half_x, half_y] = [0.5 * self.width, 0.5 * self.height];
                // The distance to the edge, exact for a circle.
                edge(((x / half_x).hypot(y / half_y) - 1.0) * (half_x * half_y).sqrt())
            }
        }
    }
}

/// Part that passes between the two sides of a slit.
fn along(nu: f64, centre: f64, side: f64) -> f64 {
    // Where a side is the end of the order, nothing is cut off.
    let passed = |end: f64, outside: f64| if end.abs() >= 0.5 - 1e-9 { 1.0 } else { edge(outside) };
    let (lower, upper) = (centre - 0.5 * side, centre + 0.5 * side);
    passed(lower, lower - nu) * passed(upper, nu - upper)
}

/// Part that passes at a distance outside an edge.
fn edge(outside: f64) -> f64 {
    let t = (outside / OrderFilter::EDGE + 0.5).clamp(0.0, 1.0);
    (0.5 * PI * t).cos().powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filters_pass_what_lies_within_their_edges() {
        let slit = OrderFilter { centre_y: 0.2, ..OrderFilter::rectangle(1.0, 0.5) };
        for (nu, passed) in [
            ([0.5, 0.2], 1.0),
            ([-0.5, 0.44], 1.0),
            ([0.0, -0.05], 0.5),
            ([0.0, 0.45], 0.5),
            ([0.0, -0.061], 0.0),
            ([0.3, 0.461], 0.0),
        ] {
            assert!((slit.passed(nu[0], nu[1]) - passed).abs() < 1e-12, "{nu:?}");
        }
        let iris = OrderFilter { shape: FilterShape::Ellipse, centre_x: -0.1, ..OrderFilter::rectangle(0.6, 0.6) };
        for (nu, passed) in [([-0.1, 0.0], 1.0), ([0.1, 0.2], 1.0), ([0.2, 0.0], 0.5), ([0.2, 0.2], 0.0)] {
            assert!((iris.passed(nu[0], nu[1]) - passed).abs() < 1e-12, "{nu:?}");
        }
    }

    #[test]
    fn openings_beyond_the_first_order_are_refused_by_name() {
        let valid = OrderFilter { centre_x: 0.3, ..OrderFilter::rectangle(0.4, 1.0) };
        valid.validate().unwrap();
        for (filter, name) in [
            (OrderFilter { width: 0.05, ..valid }, "filter_width"),
            (OrderFilter { height: 1.1, ..valid }, "filter_height"),
            (OrderFilter { height: f64::NAN, ..valid }, "filter_height"),
            (OrderFilter { centre_x: -0.31, ..valid }, "filter_centre_x"),
            (OrderFilter { centre_y: 0.01, ..valid }, "filter_centre_y"),
            (OrderFilter { centre_y: f64::INFINITY, ..valid }, "filter_centre_y"),
        ] {
            let error = filter.validate().unwrap_err().to_string();
            assert!(error.starts_with(name), "{error}");
        }
    }
}
