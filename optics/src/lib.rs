//! Fourier optics for phase-only holographic displays: propagation, hologram optimization, and learning a
//! display's own light transport from photographs.
//!
//! ```
//! use lightpath_optics::{Grid, OpticalSetup, optimize, propagate, test_cards::TestCard};
//!
//! // 160×90 pixels of 8 µm, green light, and an image 20 mm away.
//! let setup = OpticalSetup::try_new(Grid::try_new(90, 160, 8e-6)?, 515e-9, 0.02)?;
//! let target = TestCard::Portrait.render(90, 160, 1)?;
//! let hologram = optimize(&target, &setup)?;
//! println!("{}\n{:.1} dB at a camera's pixels", hologram.validity, hologram.quality.pixel.psnr_db);
//! let image = propagate(&hologram.field(), &setup)?;
//! assert_eq!(image.intensity().width_px(), target.width_px());
//! # assert!(hologram.quality.pixel.psnr_db > 25.0);
//! # Ok::<(), lightpath_optics::Error>(())
//! ```
//!
//! [`propagate()`] propagates a field through free space and chooses a method that is accurate there. [`optimize()`]
//! finds the phase that shows a target. For full control, [`Propagator`] offers every propagation method and window,
//! and [`Optimization`] every optimization method, several planes and frames, and learned displays.
//!
//! # Conventions
//!
//! - Planes are row-major, `[y][x]`; sizes are `height_px` and `width_px`; public names carry SI units.
//! - Light is linear; the brightest value of targets and photographs is 1.
//! - Time convention e^{−iωt}: a wave travelling towards +z gains e^{+ikz}.
//! - The forward Fourier transform uses e^{−i2π(fx·x + fy·y)} and is unscaled; the inverse is scaled by
//!   1/(number of samples). The zero frequency is at `[0][0]`.
//! - Frequencies are the exact bins n/(N·Δ) for n = 0 … N/2−1, −N/2 … −1.
//! - Phases of transfer functions are computed in f64 without their piston and reduced modulo 2π before they are
//!   rounded to f32.
//! - Fields are zero-padded twofold along each axis, so that the convolution is linear, and cropped afterwards.
//! - Computations use f32. Results are the same on any number of threads.
//!
//! # Map
//!
//! | task | see |
//! |---|---|
//! | describe the optical setup | [`OpticalSetup`], [`Grid`], [`RegionOfInterest`], [`Plane`] |
//! | propagate a field | [`propagate()`], [`Propagator`]; [`plan`] and [`propagation`]: the range of each method |
//! | find a phase | [`optimize()`], [`Optimization`], [`hologram`]; [`optimizer`] for the methods themselves |
//! | choose how light is detected | [`Detector`], [`photometry`] |
//! | measure the quality of a picture | [`metrics`], [`hologram::quality`] |
//! | convert phases to grey levels | [`phase_response`], [`Carrier`] |
//! | describe a display | [`DisplayModel`], [`chebyshev`], [`spatial_variation`] |
//! | simulate a display | [`Engine`], [`EngineCache`] |
//! | learn a display from photographs | [`learning`]; [`alignment`] maps a camera's pixels to the display's |
//! | inspect a learned display | [`diagnostics`]: aberrations, point spread, parts of the band without light |
//! | work without a display | [`simulated_display`]: an imperfect bench; [`test_cards`]: target pictures |
//! | check results | [`reference`](mod@reference): slow and plain f64 versions of the fast algorithms |
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod alignment;
mod batch_fft;
pub mod carrier;
pub mod chebyshev;
mod convolution;
pub mod detector;
pub mod diagnostics;
pub mod display_model;
mod engine;
mod error;
pub mod grid;
pub mod hologram;
mod image_window;
pub mod learning;
mod least_squares;
pub mod metrics;
pub mod optimizer;
#[doc(hidden)]
pub mod passes;
pub mod phase_response;
pub mod photometry;
pub mod plane;
pub mod propagation;
mod propagation_method;
mod propagator;
mod real;
pub mod reference;
pub mod region;
pub mod setup;
pub mod simulated_display;
mod slm;
mod slm_inverse;
mod smooth_field;
pub mod spatial_variation;
pub mod test_cards;
pub mod transfer_function;

pub use carrier::Carrier;
pub use detector::Detector;
pub use display_model::{DisplayModel, KernelShape};
pub use engine::{Engine, EngineCache};
pub use error::{Error, Result};
pub use grid::Grid;
pub use hologram::{Evaluation, Hologram, HologramMethod, HologramProblem, InitialPhase, Optimization, optimize};
pub use learning::KernelModel;
pub use plane::Plane;
pub use propagation::{ConvolutionMethod, PropagationMethod, ValidityReport, plan, plan_onto};
pub use propagator::{Propagated, Propagator, propagate};
pub use region::RegionOfInterest;
pub use setup::OpticalSetup;
pub use simulated_display::SimulatedBench;
pub use smooth_field::SmoothField;
pub use spatial_variation::SpatialVariation;
