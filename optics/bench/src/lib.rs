//! A bench that exists only as a simulation: a display with a camera, and pictures to show.
//!
//! - [`simulated_display`]: a display, its optics and a camera, with flaws.
//! - [`test_cards`]: target pictures.
//!
//! ```
//! use lightpath_bench::{SimulatedBench, SimulatedDisplay, TestCard};
//! use lightpath_optics::{Grid, OpticalSetup, optimize};
//!
//! let setup = OpticalSetup::try_new(Grid::try_new(90, 160, 8e-6)?, 515e-9, 0.02)?;
//! let hologram = optimize(&TestCard::Portrait.render(90, 160, 1)?, &setup)?;
//! let display = SimulatedDisplay::draw(setup, None, SimulatedBench { seed: 7, ..SimulatedBench::FAIR })?;
//! // The second seed is that of the camera's noise.
//! let photograph = display.capture(&hologram.phase, 1)?;
//! assert_eq!((photograph.height_px(), photograph.width_px()), (90, 160));
//! # Ok::<(), lightpath_optics::Error>(())
//! ```

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod simulated_display;
pub mod test_cards;

pub use simulated_display::{BenchSize, SimulatedBench, SimulatedDisplay};
pub use test_cards::TestCard;
