//! Optical setup of a propagation: grid, wavelength, distance, and the method that computes the propagation.

use super::image_window::ImageWindow;
use super::orders::Orders;
use crate::error::{Error, Result};
use crate::numerics::Grid;
use crate::propagation_method::ConvolutionMethod;

/// Optical setup: the grid of pixels, the wavelength, the distance of the image, the convolution that computes the
/// propagation, and the part of a pixel that a camera there sees. The default method is the [band-limited angular
/// spectrum](ConvolutionMethod::BandLimited).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpticalSetup {
    grid: Grid,
    wavelength_m: f64,
    distance_m: f64,
    method: ConvolutionMethod,
    centre_x_m: f64,
    centre_y_m: f64,
    orders: Orders,
    camera_fill_factor: f64,
}

impl OpticalSetup {
    /// Shortest wavelength \[m\]. No display works below the ultraviolet.
    pub const WAVELENGTH_M_MIN: f64 = 100e-9;
    /// Longest wavelength \[m\]. No display works beyond the thermal infrared.
    pub const WAVELENGTH_M_MAX: f64 = 10e-6;
    /// Smallest fill factor of a camera. Sensors without microlenses have 0.3 and more.
    pub const CAMERA_FILL_FACTOR_MIN: f64 = 0.1;
    /// Largest distance of an image, in both directions \[m\]. At larger distances hardly any of the band remains for
    /// any size.
    pub const DISTANCE_M_MAX: f64 = 10.0;

    /// Creates a setup that uses the band-limited angular spectrum.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for a wavelength that is not between [`Self::WAVELENGTH_M_MIN`] and
    /// [`Self::WAVELENGTH_M_MAX`], or a distance that is 0, not finite, or beyond ±[`Self::DISTANCE_M_MAX`].
    pub fn try_new(grid: Grid, wavelength_m: f64, distance_m: f64) -> Result<Self> {
        if !(Self::WAVELENGTH_M_MIN..=Self::WAVELENGTH_M_MAX).contains(&wavelength_m) {
            let allowed = "1e-7 to 1e-5 m";
            return Err(Error::OutOfRange { name: "wavelength_m", value: wavelength_m, allowed });
        }
        if distance_m == 0.0 || !(-Self::DISTANCE_M_MAX..=Self::DISTANCE_M_MAX).contains(&distance_m) {
            let allowed = "between -10 and 10 m, and not 0";
            return Err(Error::OutOfRange { name: "distance_m", value: distance_m, allowed });
        }
        Ok(Self {
            grid,
            wavelength_m,
            distance_m,
            method: ConvolutionMethod::BandLimited,
            centre_x_m: 0.0,
            centre_y_m: 0.0,
            orders: Orders::First,
            camera_fill_factor: 1.0,
        })
    }

    /// Returns this setup for light of another wavelength \[m\], with the same method.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for a wavelength outside the range of [`Self::try_new`].
    pub fn with_wavelength(self, wavelength_m: f64) -> Result<Self> {
        Self::try_new(self.grid, wavelength_m, self.distance_m)?;
        Ok(Self { wavelength_m, ..self })
    }

    /// Returns this setup for a display that shows these diffraction orders of its pixels. The method becomes
    /// [`ConvolutionMethod::AllOrders`] for [all orders](Orders::All), and [`ConvolutionMethod::BandResponse`] behind a
    /// [filter](Orders::Filtered).
    ///
    /// # Errors
    ///
    /// The errors of [`Orders::validate`].
    pub fn with_orders(self, orders: Orders) -> Result<Self> {
        orders.validate()?;
        let method = match (orders, self.method) {
            (Orders::All { .. }, _) => ConvolutionMethod::AllOrders,
            (Orders::Filtered(_), _) => ConvolutionMethod::BandResponse,
            (Orders::First, ConvolutionMethod::AllOrders) => ConvolutionMethod::BandLimited,
            (Orders::First, method) => method,
        };
        Ok(Self { orders, ..self.with_method_regardless(method) })
    }

    /// Returns this setup for a camera whose pixels see light along this part of their sides. Only
    /// [`Detector::Pixel`](crate::Detector::Pixel) depends on it.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for a part that is not between [`Self::CAMERA_FILL_FACTOR_MIN`] and 1.
    pub fn with_camera_fill_factor(self, camera_fill_factor: f64) -> Result<Self> {
        if !(Self::CAMERA_FILL_FACTOR_MIN..=1.0).contains(&camera_fill_factor) {
            let (name, value) = ("camera_fill_factor", camera_fill_factor);
            return Err(Error::OutOfRange { name, value, allowed: "0.1 to 1" });
        }
        Ok(Self { camera_fill_factor, ..self })
    }

    /// Returns this setup with another method, without checking that the method is accurate. Use it to measure the
    /// error of a method.
    #[must_use]
    pub fn with_method_regardless(self, method: ConvolutionMethod) -> Self {
        match method {
            ConvolutionMethod::Shifted => Self { method, ..self },
            _ => Self { method, centre_x_m: 0.0, centre_y_m: 0.0, ..self },
        }
    }

    /// Returns this setup with the image's centre at (`centre_x_m`, `centre_y_m`) \[m\] from the axis, computed by the
    /// [shifted](ConvolutionMethod::Shifted) angular spectrum.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for a centre that is more than [`ImageWindow::CENTRE_M_MAX`] away from the axis.
    pub fn with_centre(self, centre_x_m: f64, centre_y_m: f64) -> Result<Self> {
        ImageWindow::of(&self.grid).centred_at(centre_x_m, centre_y_m)?;
        Ok(Self { method: ConvolutionMethod::Shifted, centre_x_m, centre_y_m, ..self })
    }

    /// Grid of pixels, which is the same at the display and at the image.
    #[must_use]
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// Wavelength λ in vacuum \[m\].
    #[must_use]
    pub fn wavelength_m(&self) -> f64 {
        self.wavelength_m
    }

    /// Distance z from the display to the image \[m\]; negative for an image behind the display.
    #[must_use]
    pub fn distance_m(&self) -> f64 {
        self.distance_m
    }

    /// Method that computes the propagation.
    #[must_use]
    pub fn method(&self) -> ConvolutionMethod {
        self.method
    }

    /// Diffraction orders of the pixels that reach the image.
    #[must_use]
    pub fn orders(&self) -> Orders {
        self.orders
    }

    /// Sides of a pixel's bright area along x and y, in pixel pitches; 1 for a display that does not show all orders.
    #[must_use]
    pub fn fill_factor(&self) -> [f64; 2] {
        match self.orders {
            Orders::First | Orders::Filtered(_) => [1.0, 1.0],
            Orders::All { fill_factor_x, fill_factor_y } => [fill_factor_x, fill_factor_y],
        }
    }

    /// Side of the part of a pixel in which a camera sees light, in pixel pitches.
    #[must_use]
    pub fn camera_fill_factor(&self) -> f64 {
        self.camera_fill_factor
    }

    /// Window of the image. It has the display's pixels; with [`ConvolutionMethod::Shifted`] its centre may lie away
    /// from the axis.
    #[must_use]
    pub fn window(&self) -> ImageWindow {
        let window = ImageWindow::of(&self.grid).centred_at(self.centre_x_m, self.centre_y_m);
        window.expect("the centre was checked when it was set")
    }

    /// Number of rows after zero padding, twice the grid's \[px\].
    #[must_use]
    pub fn padded_height_px(&self) -> usize {
        2 * self.grid.height_px()
    }

    /// Number of columns after zero padding, twice the grid's \[px\].
    #[must_use]
    pub fn padded_width_px(&self) -> usize {
        2 * self.grid.width_px()
    }

    /// Critical distance z_c = N_x·Δ²/λ \[m\], up to which the N_x padded columns sample the whole band.
    #[must_use]
    pub fn critical_distance_x_m(&self) -> f64 {
        self.padded_width_px() as f64 * self.grid.pixel_pitch_m().powi(2) / self.wavelength_m
    }

    /// Critical distance z_c = N_y·Δ²/λ \[m\], up to which the N_y padded rows sample the whole band.
    #[must_use]
    pub fn critical_distance_y_m(&self) -> f64 {
        self.padded_height_px() as f64 * self.grid.pixel_pitch_m().powi(2) / self.wavelength_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn setup(distance_m: f64) -> OpticalSetup {
        OpticalSetup::try_new(Grid::try_new(1080, 1920, 8e-6).unwrap(), 515e-9, distance_m).unwrap()
    }

    /// Parts of the lines through zero frequency along x and y that the band limit keeps.
    fn kept_fraction(setup: &OpticalSetup) -> (f64, f64) {
        let (samples, nyquist) = (10_000, 1.0 / (2.0 * setup.grid().pixel_pitch_m()));
        let kept = |along: &dyn Fn(f64) -> bool| {
            (0..samples).filter(|&i| along(nyquist * i as f64 / samples as f64)).count() as f64 / samples as f64
        };
        (kept(&|f| setup.keeps(f, 0.0)), kept(&|f| setup.keeps(0.0, f)))
    }

    #[test]
    fn common_display_has_known_critical_distances() {
        assert!((setup(0.15).critical_distance_y_m() - 0.268).abs() < 1e-3);
        assert!((setup(0.15).critical_distance_x_m() - 0.477).abs() < 1e-3);
    }

    #[test]
    fn band_limit_keeps_whole_band_below_critical_distance() {
        assert_eq!(kept_fraction(&setup(0.15)), (1.0, 1.0));
        let (x, y) = kept_fraction(&setup(-0.5));
        assert!((x - 0.954).abs() < 1e-3 && (y - 0.537).abs() < 1e-3, "{x} {y}");
    }

    #[test]
    fn invalid_setups_are_refused_by_name() {
        let grid = Grid::try_new(8, 8, 8e-6).unwrap();
        for distance_m in [0.0, f64::NAN, f64::INFINITY, 10.1, -11.0] {
            let error = OpticalSetup::try_new(grid, 515e-9, distance_m).unwrap_err();
            assert!(error.to_string().starts_with("distance_m is"), "{error}");
        }
        for wavelength_m in [0.0, f64::NAN, -515e-9, 515.0] {
            let error = OpticalSetup::try_new(grid, wavelength_m, 0.1).unwrap_err();
            assert!(error.to_string().starts_with("wavelength_m is"), "{error}");
        }
    }
}
