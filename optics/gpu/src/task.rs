//! A problem without a card: what the processor needs to go on with it.

use lightpath_optics::engine::{EngineCache, Prepared};
use lightpath_optics::hologram::{Backend, Loss, Picture, Project};
use lightpath_optics::{Carrier, Detector, DisplayModel, Plane, RegionOfInterest};
use std::sync::Arc;

/// The problem, for the processor.
#[derive(Debug)]
pub(crate) struct Task {
    pub(crate) processor: Arc<EngineCache>,
    pub(crate) pictures: Vec<OwnedPicture>,
    pub(crate) frames: usize,
    pub(crate) region: RegionOfInterest,
    pub(crate) loss: Loss,
}

/// A [`Picture`] that borrows nothing.
#[derive(Clone, Debug)]
pub(crate) struct OwnedPicture {
    model: DisplayModel,
    detector: Detector,
    carrier: Option<Carrier>,
    target: Plane<f32>,
    weight: Option<Plane<f32>>,
    share: f64,
}

impl From<&Picture<'_>> for OwnedPicture {
    fn from(Picture { display, target, weight, share }: &Picture<'_>) -> Self {
        Self {
            model: display.model().clone(),
            detector: display.detector(),
            carrier: display.modulator().carrier(),
            target: target.clone(),
            weight: weight.clone(),
            share: *share,
        }
    }
}

impl OwnedPicture {
    /// √t of each pixel.
    pub(crate) fn target_amplitudes(&self) -> Plane<f32> {
        self.target.map(f32::sqrt)
    }

    /// The picture again.
    fn borrowed(&self) -> Picture<'_> {
        let Self { target, weight, share, .. } = self;
        Picture { display: self.display(), target: target.clone(), weight: weight.clone(), share: *share }
    }

    /// The display, as it was.
    pub(crate) fn display(&self) -> Prepared<'_> {
        // The model was valid when the problem was made, and does not change.
        Prepared::new(&self.model, self.detector, self.carrier)
            .unwrap_or_else(|error| unreachable!("a display became invalid: {error}"))
    }
}

impl Task {
    /// The problem on the processor.
    pub(crate) fn on_processor(&self) -> Box<dyn Project> {
        let pictures = self.pictures.iter().map(OwnedPicture::borrowed).collect();
        self.processor
            .hologram(pictures, self.frames, self.region, self.loss)
            .unwrap_or_else(|error| unreachable!("the processor computes every valid problem: {error}"))
    }
}
