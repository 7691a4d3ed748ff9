//! What makes a hologram's problem: the processor, the slow twin, a graphics card.

use super::evaluate::Project;
use super::loss::{Loss, PlaneInput, UncheckedPlane};
use super::processor::ProcessorProblem;
use crate::engine::{EngineCache, Prepared};
use crate::error::Result;
use crate::numerics::{Plane, RegionOfInterest};
use std::fmt;

/// Target picture of a hologram at one distance, on a display that no engine holds yet. See
/// [`ImagePlane`](super::ImagePlane).
#[derive(Clone, Debug)]
pub struct Picture<'a> {
    /// The display at the picture's distance, with the detector that sees it.
    pub display: Prepared<'a>,
    /// Target intensity in linear light, of the display's size.
    pub target: Plane<f32>,
    /// Weight of each pixel in the loss, 0 or above; `None`: all pixels have the same weight.
    pub weight: Option<Plane<f32>>,
    /// Weight of this plane among several planes, above 0.
    pub share: f64,
}

impl Picture<'_> {
    pub(super) fn unchecked(&self) -> UncheckedPlane<'_, f32> {
        UncheckedPlane {
            size_px: [self.display.height_px(), self.display.width_px()],
            detector: self.display.detector(),
            target: &self.target,
            weight: self.weight.as_ref(),
            share: self.share,
        }
    }
}

/// A machine that computes holograms. The program chooses one at run time, and
/// [`HologramProblem::on`](super::HologramProblem::on) takes it.
pub trait Backend: fmt::Debug + Send + Sync {
    /// Makes a problem with at least one picture, which [`HologramProblem::on`](super::HologramProblem::on) has checked.
    /// All pictures have one size and one detector. The body copies what it needs of the displays.
    ///
    /// # Errors
    ///
    /// [`Error::Incompatible`](crate::Error::Incompatible) for a display or a loss that this machine does not compute.
    fn hologram(
        &self,
        pictures: Vec<Picture<'_>>,
        frames: usize,
        region: RegionOfInterest,
        loss: Loss,
    ) -> Result<Box<dyn Project>>;
}

/// The processor, with the plans and transfer functions that it keeps.
impl Backend for EngineCache {
    fn hologram(
        &self,
        pictures: Vec<Picture<'_>>,
        frames: usize,
        region: RegionOfInterest,
        loss: Loss,
    ) -> Result<Box<dyn Project>> {
        let input = |Picture { display, target, weight, share }| {
            let engine = self.engine_of(&display).core;
            PlaneInput { engine, target, weight, share }
        };
        let planes = pictures.into_iter().map(input).collect();
        Ok(Box::new(ProcessorProblem::with_planes(planes, frames, region, loss)))
    }
}
