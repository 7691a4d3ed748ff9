//! Computations of a propagator, in f32 or f64.

use crate::display::{Detector, DisplayModel, OpticalSetup};
use crate::engine::convolution::Real;
use crate::engine::core::EngineCore;
use crate::error::Result;
use crate::numerics::Plane;
use crate::propagation::passes::{
    Fraunhofer, FrequencyWindow, ScaledFresnel, band_extended_axes, check, check_frequencies, method_onto, own_window,
    scaled_axes,
};
use crate::propagation::{ConvolutionMethod, ImageWindow, PropagationMethod, fraunhofer_window};
use num_complex::Complex;

/// A [`Propagator`](crate::Propagator) in the precision `T`: f32 in production, f64 as a reference.
#[derive(Debug)]
pub struct PropagatorCore<T> {
    setup: OpticalSetup,
    method: PropagationMethod,
    window: ImageWindow,
    passes: Passes<T>,
}

#[derive(Debug)]
enum Passes<T> {
    /// Engine with the transfer function H(fx, fy), and engine with H(−fx, −fy) for the adjoint.
    Convolution {
        engine: Box<EngineCore<T>>,
        mirrored: Box<EngineCore<T>>,
    },
    Frequencies(Box<FrequencyWindow<T>>),
    ScaledFresnel(Box<ScaledFresnel<T>>),
    Fraunhofer(Fraunhofer<T>),
}

impl<T: Real> PropagatorCore<T> {
    /// Prepares `method` for its default window: [`OpticalSetup::window`], or for the far field
    /// [`fraunhofer_window`].
    ///
    /// # Errors
    ///
    /// [`Error::Unsuitable`](crate::Error::Unsuitable) where the method cannot be valid, with the numbers.
    pub fn new(setup: &OpticalSetup, method: PropagationMethod) -> Result<Self> {
        check(setup, method, &own_window(setup, method))?;
        Self::regardless(setup, method)
    }

    /// Prepares a propagation to any window. The method is [`PropagationMethod::Scaled`], except where
    /// [`PropagationMethod::ScaledFresnel`] is as accurate or only that method is valid.
    ///
    /// # Errors
    ///
    /// [`Error::Unsuitable`](crate::Error::Unsuitable) for a window that no light reaches, or that would take too many
    /// frequencies.
    pub fn onto(setup: &OpticalSetup, window: &ImageWindow) -> Result<Self> {
        let method = method_onto(setup, window);
        check(setup, method, window)?;
        Self::onto_regardless(setup, method, window)
    }

    fn onto_regardless(setup: &OpticalSetup, method: PropagationMethod, window: &ImageWindow) -> Result<Self> {
        let passes = match method {
            PropagationMethod::ScaledFresnel => Passes::ScaledFresnel(Box::new(ScaledFresnel::new(setup, window))),
            _ => {
                let axes = scaled_axes(setup, window);
                check_frequencies(PropagationMethod::Scaled, &axes[0], &axes[1])?;
                Passes::Frequencies(Box::new(FrequencyWindow::new(setup, window, &axes)))
            }
        };
        Ok(Self { setup: *setup, method, window: *window, passes })
    }

    /// Prepares `method` without checking that it is accurate. Use it to measure the error of a method.
    ///
    /// # Errors
    ///
    /// [`Error::Unsuitable`](crate::Error::Unsuitable) for a method without frequencies to compute, or with too many.
    pub fn regardless(setup: &OpticalSetup, method: PropagationMethod) -> Result<Self> {
        let (window, passes) = match method {
            PropagationMethod::Scaled | PropagationMethod::ScaledFresnel => {
                return Self::onto_regardless(setup, method, &setup.window());
            }
            PropagationMethod::BandExtended => {
                let (window, axes) = (ImageWindow::of(&setup.grid()), band_extended_axes(setup));
                check_frequencies(method, &axes[0], &axes[1])?;
                (window, Passes::Frequencies(Box::new(FrequencyWindow::new(setup, &window, &axes))))
            }
            PropagationMethod::Fraunhofer => (fraunhofer_window(setup), Passes::Fraunhofer(Fraunhofer::new(setup))),
            PropagationMethod::BandResponse
            | PropagationMethod::AllOrders
            | PropagationMethod::AngularSpectrum
            | PropagationMethod::BandLimited
            | PropagationMethod::Shifted
            | PropagationMethod::RayleighSommerfeld
            | PropagationMethod::FresnelTransferFunction
            | PropagationMethod::FresnelImpulseResponse => {
                let setup = setup.with_method_regardless(ConvolutionMethod::try_from(method)?);
                (setup.window(), Self::convolution(&setup)?)
            }
        };
        Ok(Self { setup: *setup, method, window, passes })
    }

    /// Optical setup of the propagation.
    #[must_use]
    pub fn setup(&self) -> &OpticalSetup {
        &self.setup
    }

    /// Propagation method.
    #[must_use]
    pub fn method(&self) -> PropagationMethod {
        self.method
    }

    /// Window in which the image is sampled.
    #[must_use]
    pub fn window(&self) -> &ImageWindow {
        &self.window
    }

    /// Propagates `field`, given on the display's pixels, to the window.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a field of another size than the display's.
    pub fn forward(&self, field: &Plane<Complex<T>>) -> Result<Plane<Complex<T>>> {
        field.expect_size("field", self.setup.grid().height_px(), self.setup.grid().width_px())?;
        match &self.passes {
            Passes::Convolution { engine, .. } => engine.propagate(field),
            Passes::Frequencies(passes) => Ok(passes.forward(field)),
            Passes::ScaledFresnel(passes) => Ok(passes.forward(field)),
            Passes::Fraunhofer(passes) => Ok(passes.forward(field)),
        }
    }

    /// Applies the adjoint Aᴴ of [`Self::forward`], ⟨A u, v⟩ = ⟨u, Aᴴ v⟩, to a field in the window. The result is a
    /// field on the display's pixels.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a field of another size than the window's.
    pub fn adjoint(&self, field: &Plane<Complex<T>>) -> Result<Plane<Complex<T>>> {
        field.expect_size("field", self.window.height_px(), self.window.width_px())?;
        match &self.passes {
            // conj(Aᴴv) = F⁻¹ H(−f) F conj(v): the spectrum of a conjugate field is conjugate and mirrored.
            Passes::Convolution { mirrored, .. } => Ok(mirrored.propagate(&field.map(|v| v.conj()))?.map(|u| u.conj())),
            Passes::Frequencies(passes) => Ok(passes.adjoint(field)),
            Passes::ScaledFresnel(passes) => Ok(passes.adjoint(field)),
            Passes::Fraunhofer(passes) => Ok(passes.adjoint(field)),
        }
    }

    fn convolution(setup: &OpticalSetup) -> Result<Passes<T>> {
        let engine = Box::new(EngineCore::new(&DisplayModel::ideal(*setup), Detector::Point, None)?);
        // Only the transfer function to a window beside the axis is not symmetric.
        let mirrored = match setup.method() {
            ConvolutionMethod::Shifted => {
                let mirrored = setup.with_centre(-setup.window().centre_x_m(), -setup.window().centre_y_m())?;
                Box::new(EngineCore::new(&DisplayModel::ideal(mirrored), Detector::Point, None)?)
            }
            _ => engine.clone(),
        };
        Ok(Passes::Convolution { engine, mirrored })
    }
}
