//! A field in, a field out, by any method.

mod core;

pub use core::PropagatorCore;

use crate::propagation::{ImageWindow, PropagationMethod, ValidityReport, plan};
use crate::{OpticalSetup, Plane, Result};
use num_complex::Complex32;

/// A planned propagation from the display to a window of the image plane, and back by its adjoint.
///
/// A method that is a [convolution](crate::propagation::ConvolutionMethod) runs on the [`Engine`](crate::Engine); the others have
/// passes of their own.
///
/// ```
/// use lightpath_optics::propagation::ImageWindow;
/// use lightpath_optics::{Grid, OpticalSetup, Plane, Propagator};
/// use num_complex::Complex32;
///
/// let grid = Grid::try_new(32, 32, 8e-6)?;
/// let setup = OpticalSetup::try_new(grid, 515e-9, 0.05)?;
/// // The middle of the image, four times as fine.
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
    /// By `method`, onto the window that the method has of itself: [`OpticalSetup::window`], or for the far field
    /// [`fraunhofer_window`](crate::propagation::fraunhofer_window).
    ///
    /// # Errors
    ///
    /// [`Error::Unsuitable`](crate::Error::Unsuitable) where the method can't be right, with the numbers.
    pub fn new(setup: &OpticalSetup, method: PropagationMethod) -> Result<Self> {
        Ok(Self { core: PropagatorCore::new(setup, method)? })
    }

    /// Onto any window, by [`PropagationMethod::Scaled`] or [`PropagationMethod::ScaledFresnel`], whichever is right there.
    ///
    /// # Errors
    ///
    /// [`Error::Unsuitable`](crate::Error::Unsuitable) for a window that no light reaches, or that would take too many
    /// frequencies.
    pub fn onto(setup: &OpticalSetup, window: &ImageWindow) -> Result<Self> {
        Ok(Self { core: PropagatorCore::onto(setup, window)? })
    }

    /// By `method`, right or wrong: to see by how much.
    ///
    /// # Errors
    ///
    /// [`Error::Unsuitable`](crate::Error::Unsuitable) where the method has nothing to compute, or too much.
    pub fn regardless(setup: &OpticalSetup, method: PropagationMethod) -> Result<Self> {
        Ok(Self { core: PropagatorCore::regardless(setup, method)? })
    }

    /// The setup.
    #[must_use]
    pub fn setup(&self) -> &OpticalSetup {
        self.core.setup()
    }

    /// The method.
    #[must_use]
    pub fn method(&self) -> PropagationMethod {
        self.core.method()
    }

    /// Where the samples of the image lie.
    #[must_use]
    pub fn window(&self) -> &ImageWindow {
        self.core.window()
    }

    /// The field in the window that `field`, on the display's pixels, becomes.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a field of another size than the display's.
    pub fn forward(&self, field: &Plane<Complex32>) -> Result<Plane<Complex32>> {
        self.core.forward(field)
    }

    /// The adjoint of [`Self::forward`], ⟨A u, v⟩ = ⟨u, Aᴴ v⟩: from a field in the window to one on the display's pixels.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a field of another size than the window's.
    pub fn adjoint(&self, field: &Plane<Complex32>) -> Result<Plane<Complex32>> {
        self.core.adjoint(field)
    }
}

/// What [`propagate`] found.
#[derive(Clone, Debug, PartialEq)]
pub struct Propagated {
    /// The complex field in the image plane, without the piston e^{ikz}.
    pub field: Plane<Complex32>,
    /// By which method it was computed, how good that is, and where its samples lie.
    pub validity: ValidityReport,
}

impl Propagated {
    /// The light |u|² at the sample points.
    #[must_use]
    pub fn intensity(&self) -> Plane<f32> {
        self.field.map(|u| u.norm_sqr())
    }
}

/// What `field`, on the display's pixels, becomes at the setup's distance and window, by the method that [`plan`] chooses,
/// whatever the setup's own. For other methods and windows, several fields, and the way back, see [`Propagator`].
///
/// ```
/// use lightpath_optics::{Grid, OpticalSetup, Plane, propagate};
/// use num_complex::Complex32;
///
/// // A plane wave comes through a square aperture.
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
/// [`Error::Unsuitable`](crate::Error::Unsuitable), with the numbers, where no image can be right.
pub fn propagate(field: &Plane<Complex32>, setup: &OpticalSetup) -> Result<Propagated> {
    let validity = plan(setup)?;
    let field = Propagator::new(setup, validity.method)?.forward(field)?;
    Ok(Propagated { field, validity })
}
