//! A card as a continuous picture, and the frame that it fills.

/// A picture as a function that gives the tone at (x, y).
pub(super) type Scene = Box<dyn Fn(f32, f32) -> f32 + Sync>;

/// Edges of the picture, in halves of its shorter side.
#[derive(Clone, Copy)]
pub(super) struct Frame {
    pub(super) half_width: f32,
    pub(super) half_height: f32,
}
