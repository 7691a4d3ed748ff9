//! Fourier optics for phase-only holographic displays: propagation, hologram optimization, and learning a
//! display's own light transport from photographs.
//!
//! A phase-only display is a spatial light modulator (SLM): each of its pixels delays the light by a phase between 0
//! and 2π. A *hologram* is a phase for each pixel with which the light forms a wanted picture, the *target*, at some
//! distance from the display.
//!
//! ```
//! use lightpath_optics::{Grid, OpticalSetup, Plane, optimize, propagate};
//!
//! // A display of 160×90 pixels of 8 µm, green light of 515 nm, and an image 20 mm away.
//! let setup = OpticalSetup::try_new(Grid::try_new(90, 160, 8e-6)?, 515e-9, 0.02)?;
//! // A bright ring on a dim ramp.
//! let ring = |y: usize, x: usize| (30.0..40.0).contains(&(y as f32 - 45.0).hypot(x as f32 - 80.0));
//! let target = Plane::from_fn(90, 160, |y, x| if ring(y, x) { 1.0 } else { x as f32 / 400.0 });
//! // Finds the hologram, with a simulated picture and its quality.
//! let hologram = optimize(&target, &setup)?;
//! println!("{}", hologram.validity);
//! println!("PSNR of the light integrated over each pixel: {:.1} dB", hologram.quality.pixel.psnr_db);
//! // Propagates the field of the hologram to the image.
//! let image = propagate(&hologram.field(), &setup)?;
//! assert_eq!(image.intensity().width_px(), target.width_px());
//! # assert!(hologram.quality.pixel.psnr_db > 25.0);
//! # Ok::<(), lightpath_optics::Error>(())
//! ```
//!
//! [`propagate()`] propagates a field through free space by a method that is accurate for the setup. [`optimize()`]
//! finds the hologram of a target. Two other types give full control: [`Propagator`] offers every propagation method
//! and any window of the image plane. [`Optimization`] offers every optimization method, targets at several distances,
//! several frames whose light the eye averages, and learned displays.
//!
//! The programs in `examples/` are a tour: `hologram` computes a hologram and writes it as a picture, `planner_tour`
//! shows which propagation method suits which distance, `aperture` compares the methods with a direct sum, and
//! `display_learning` learns simulated displays from photographs.
//!
//! # Terms
//!
//! - Field: complex amplitude u of the light. Light, or intensity: |u|².
//! - Transfer function H(fx, fy): factor by which propagation multiplies the spectrum of a field. *Kernel*: transfer
//!   function of a real display, with the errors of its optics.
//! - Display model: parameters of a display, such as kernel, source profile and phase response. [`Engine`]: display
//!   model prepared for computation.
//! - Detector: rule that defines the light of a pixel, at its centre, integrated over its area, or at several points.
//! - Carrier: grating added to a hologram, which separates the image from undiffracted light, the *zero order*.
//! - Critical distance: largest distance at which the padded grid samples the whole transfer function without aliasing.
//!   Each axis has its own.
//!
//! # Conventions
//!
//! - A [`Plane`] is a two-dimensional array in row-major order, `[y][x]`. Sizes are `height_px` and `width_px`. Public
//!   names of quantities end in their unit, such as `_px`, `_m`, `_rad` and `_db`.
//! - Targets and photographs hold linear light, not gamma-encoded grey levels. Their brightest value is 1.
//! - Time convention e^{−iωt}: a wave travelling towards +z gains e^{+ikz}.
//! - The forward Fourier transform uses e^{−i2π(fx·x + fy·y)} and is unscaled; the inverse is scaled by
//!   1/(number of samples). The zero frequency is at `[0][0]`.
//! - Frequencies are the exact bins n/(N·Δ) for n = 0 … N/2−1, −N/2 … −1.
//! - Phases of transfer functions are computed in f64 and reduced modulo 2π before they are rounded to f32. They omit
//!   the piston e^{ikz}, a constant factor that does not change the intensity.
//! - Fields are padded with zeros to twice their size along each axis, so that the convolution is linear, and
//!   cropped afterwards.
//! - Computations use f32. Results have the same bits on any number of threads.
//!
//! # Map
//!
//! | task | see |
//! |---|---|
//! | describe the optical setup | [`OpticalSetup`], [`Grid`], [`RegionOfInterest`], [`Plane`] |
//! | say which diffraction orders the display shows | [`Orders`], [`OrderFilter`], [`OpticalSetup::with_orders`] |
//! | propagate a field | [`propagate()`], [`Propagator`]; [`plan`] and [`propagation`]: the range of each method |
//! | find a hologram | [`optimize()`], [`Optimization`], [`hologram`]; [`numerics::optimizer`]: general optimization methods |
//! | choose how light is detected | [`Detector`], [`engine::photometry`] |
//! | measure the quality of a picture | [`metrics`], [`hologram::quality`]; of a photograph: the crate `lightpath-camera` |
//! | convert phases to grey levels | [`display::phase_response`], [`Carrier`] |
//! | describe a display | [`DisplayModel`], [`display::parts`], [`numerics::chebyshev`] |
//! | simulate a display | [`Engine`], [`EngineCache`] |
//! | learn a display from photographs | [`learning`]; the crate `lightpath-camera` maps a camera's pixels to the display's |
//! | inspect a learned display | [`diagnostics`]: aberrations, point spread, frequencies without light |
//! | work without a display | the crate `lightpath-bench`: a display and a camera with flaws, and target pictures |
//! | end a computation early | [`interrupt`] |
//! | know memory and work before | [`memory`] |
//! | judge a hologram by an independent model | [`second_opinion`] |
//! | check results | [`reference`](mod@reference): slow and plain f64 versions of the fast algorithms |
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod diagnostics;
pub mod display;
pub mod engine;
mod error;
pub mod hologram;
pub mod interrupt;
pub mod learning;
pub mod memory;
pub mod metrics;
pub mod numerics;
#[cfg(test)]
mod pictures_of_tests;
pub mod propagation;
mod propagation_method;
#[cfg(test)]
#[path = "../tests/propagation/mod.rs"]
mod propagation_tests;
pub mod reference;
pub mod second_opinion;

pub use display::{
    Carrier, Crosstalk, Detector, DisplayModel, Dust, FilterShape, FurtherMode, Ghost, KernelShape, LightBlur,
    OpticalSetup, OrderFilter, Orders, PartialCoherence, ResponseVariation, SpatialVariation,
};
pub use engine::{Engine, EngineCache, Propagated, Propagator, propagate};
pub use error::{Error, Result};
pub use hologram::{Evaluation, Hologram, HologramMethod, HologramProblem, InitialPhase, Optimization, optimize};
pub use learning::KernelModel;
pub use numerics::{Grid, Plane, RegionOfInterest, SmoothField};
pub use propagation::{ConvolutionMethod, PropagationMethod, ValidityReport, plan, plan_onto};
