//! What a camera saw of a display.
//!
//! - [`alignment`]: where the camera sees each pixel of the display, and photographs on the display's grid.
//! - [`photo_score`]: how well a photograph shows its target.

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod alignment;
pub mod photo_score;
