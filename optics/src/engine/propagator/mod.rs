//! Propagators: propagate a field to a window of the image plane by any method.

mod core;

pub use core::PropagatorCore;

use crate::display::OpticalSetup;
use crate::error::Result;
use crate::numerics::Plane;
use crate::propagation::{ImageWindow, PropagationMethod, ValidityReport, plan};
use num_complex::Complex32;

/// A prepared propagation from the display to a window of the image plane, with its adjoint.
///
/// Methods that are [convolutions](crate::propagation::ConvolutionMethod) run on the [`Engine`](crate::Engine). Each
/// other method has its own transforms.
///
/// ```
/// use lightpath_optics::propagation::ImageWindow;
/// use lightpath_optics::{Grid, OpticalSetup, Plane, Propagator};
/// use num_complex::Complex32;
///
/// let grid = Grid::try_new(32, 32, 8e-6)?;
/// let setup = OpticalSetup::try_new(grid, 515e-9, 0.05)?;
/// // The middle of the image, sampled four times as finely.
/// let window = ImageWindow::try_new(32, 32, 2e-6)?;
/// let propagator = Propagator::onto(&setup, &window)?;
/// let image = propagator.forward(&Plane::filled(32, 32, Complex32::ONE))?;
/// assert_eq!((image.height_px(), propagator.window().pitch_x_m()), (32, 2e-6));
/// # Ok::<(), lightpath_optics::Error>(())
/// ```
#[derive(Debug)]
pub struct Propagator {
    core: PropagatorCore<f32>,
}

impl Propagator {
    /// Prepares `method` for its default window: [`OpticalSetup::window`], or for the far field
    /// [`fraunhofer_window`](crate::propagation::fraunhofer_window).
    ///
    /// # Errors
    ///
    /// [`Error::Unsuitable`](crate::Error::Unsuitable) where the method cannot be valid, with the numbers.
    pub fn new(setup: &OpticalSetup, method: PropagationMethod) -> Result<Self> {
        Ok(Self { core: PropagatorCore::new(setup, method)? })
    }

    /// Prepares a propagation to any window. The method is [`PropagationMethod::Scaled`], except where
    /// [`PropagationMethod::ScaledFresnel`] is as accurate or only that method is valid.
    ///
    /// # Errors
    ///
    /// [`Error::Unsuitable`](crate::Error::Unsuitable) for a window that no light reaches, or that would take too many
    /// frequencies.
    pub fn onto(setup: &OpticalSetup, window: &ImageWindow) -> Result<Self> {
        Ok(Self { core: PropagatorCore::onto(setup, window)? })
    }

    /// Prepares `method` without checking that it is accurate. Use it to measure the error of a method.
    ///
    /// # Errors
    ///
    /// [`Error::Unsuitable`](crate::Error::Unsuitable) for a method without frequencies to compute, or with too many.
    pub fn regardless(setup: &OpticalSetup, method: PropagationMethod) -> Result<Self> {
        Ok(Self { core: PropagatorCore::regardless(setup, method)? })
    }

    /// Optical setup of the propagation.
    #[must_use]
    pub fn setup(&self) -> &OpticalSetup {
        self.core.setup()
    }

    /// Propagation method.
    #[must_use]
    pub fn method(&self) -> PropagationMethod {
        self.core.method()
    }

    /// Window in which the image is sampled.
    #[must_use]
    pub fn window(&self) -> &ImageWindow {
        self.core.window()
    }

    /// Propagates `field`, given on the display's pixels, to the window.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a field of another size than the display's.
    pub fn forward(&self, field: &Plane<Complex32>) -> Result<Plane<Complex32>> {
        self.core.forward(field)
    }

    /// Applies the adjoint Aᴴ of [`Self::forward`], ⟨A u, v⟩ = ⟨u, Aᴴ v⟩, to a field in the window. The result is a
    /// field on the display's pixels.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a field of another size than the window's.
    pub fn adjoint(&self, field: &Plane<Complex32>) -> Result<Plane<Complex32>> {
        self.core.adjoint(field)
    }
}

/// Result of [`propagate`].
#[derive(Clone, Debug, PartialEq)]
pub struct Propagated {
    /// The complex field in the image plane, without the piston e^{ikz}.
    pub field: Plane<Complex32>,
    /// Method that was used, its accuracy, and the window of the samples.
    pub validity: ValidityReport,
}

impl Propagated {
    /// Light |u|² at the sample points.
    #[must_use]
    pub fn intensity(&self) -> Plane<f32> {
        self.field.map(|u| u.norm_sqr())
    }
}

/// Propagates `field`, given on the display's pixels, to the setup's distance and window. The method is the one that
/// [`plan`] chooses; the setup's own method is ignored. For other methods and windows, several fields, and the adjoint,
/// see [`Propagator`].
///
/// ```
/// use lightpath_optics::{Grid, OpticalSetup, Plane, propagate};
/// use num_complex::Complex32;
///
/// // A plane wave passes a square aperture.
/// let setup = OpticalSetup::try_new(Grid::try_new(64, 64, 8e-6)?, 515e-9, 0.02)?;
/// let inside = |i: usize| (16..48).contains(&i);
/// let aperture = Plane::from_fn(64, 64, |y, x| Complex32::from(if inside(y) && inside(x) { 1.0 } else { 0.0 }));
/// let image = propagate(&aperture, &setup)?;
/// println!("{}", image.validity);
/// assert!(image.intensity().at(32, 32) > 10.0 * image.intensity().at(2, 2));
/// # Ok::<(), lightpath_optics::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a field of another size than the setup's,
/// [`Error::Unsuitable`](crate::Error::Unsuitable), with the numbers, where no method can be valid.
pub fn propagate(field: &Plane<Complex32>, setup: &OpticalSetup) -> Result<Propagated> {
    let validity = plan(setup)?;
    let field = Propagator::new(setup, validity.method)?.forward(field)?;
    Ok(Propagated { field, validity })
}
