//! Pictures for people: contact sheets, heat maps, curves and alignments, as PNG.
//!
//! Light is shown sRGB-encoded, as every screen expects it. Other quantities are shown in colours of even steps, with a
//! labelled colour bar. The same data give the same bytes. Views show pictures of users in the same colours.

mod alignment;
mod canvas;
mod chart;
mod colours;
mod contact_sheet;
mod curves;
mod heatmap;
mod text;
mod ticks;
mod view;

pub use alignment::{marked, overlay};
pub use canvas::Canvas;
pub use chart::{Chart, Line, escaped};
pub use colours::ColourMap;
pub use contact_sheet::{CaptionedPicture, ContactRow, ContactSheet};
pub use curves::{Curve, Curves};
pub use heatmap::{Axis, Heatmap};
pub use view::{Drawn, Subtracted, View, ViewColours, view};
