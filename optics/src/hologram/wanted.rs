//! What a picture is compared with.

use crate::numerics::{Plane, RegionOfInterest};

/// What a picture is compared with: a target (intensity, linear light), and the pixels that count.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'a> {
    /// Light that each pixel shall show.
    pub target: &'a Plane<f32>,
    /// Part of the image that counts.
    pub region: RegionOfInterest,
    /// Pixels of the region that count, of the target's size, at least one of the region; `None`: all of them.
    pub belonging: Option<&'a Plane<bool>>,
}

impl<'a> From<(&'a Plane<f32>, RegionOfInterest)> for Wanted<'a> {
    fn from((target, region): (&'a Plane<f32>, RegionOfInterest)) -> Self {
        Self { target, region, belonging: None }
    }
}

impl Wanted<'_> {
    /// Whether a pixel of the region counts.
    pub(crate) fn counts(&self, y: usize, x: usize) -> bool {
        self.belonging.is_none_or(|belonging| belonging.at(y, x))
    }
}
