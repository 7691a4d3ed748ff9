//! Pictures for people: contact sheets, heat maps and curves, as PNG.
//!
//! Light is shown sRGB-encoded, as every screen expects it; other quantities through colours of even steps with a
//! labelled bar beside them. The same data give the same bytes.

mod canvas;
mod colours;
mod contact_sheet;
mod curves;
mod heatmap;
mod text;
mod ticks;

pub use canvas::Canvas;
pub use colours::ColourMap;
pub use contact_sheet::{ContactRow, ContactSheet, Shown};
pub use curves::{Curve, Curves};
pub use heatmap::{Axis, Heatmap};
