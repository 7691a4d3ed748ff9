//! The card as what computes holograms.

use crate::card::Card;
use crate::handover::Handover;
use crate::problem::{CardProblem, Refusal};
use crate::record::{Computed, Record};
use crate::task::Task;
use lightpath_optics::engine::EngineCache;
use lightpath_optics::hologram::{Backend, Loss, Picture, ProblemSize, Project};
use lightpath_optics::{Error, RegionOfInterest, Result};
use std::sync::Arc;

/// Computes holograms on a card, and hands them to the processor when the card fails.
///
/// The shaders of each problem are compared with the processor before their first use.
#[derive(Debug)]
pub struct GpuBackend {
    card: Arc<Card>,
    processor: Arc<EngineCache>,
    record: Arc<Record>,
}

impl GpuBackend {
    /// A card, with the processor's engine for what the card cannot do.
    #[must_use]
    pub fn new(card: Arc<Card>, processor: Arc<EngineCache>) -> Self {
        Self { card, processor, record: Arc::default() }
    }

    /// What computed the problems of this backend so far.
    #[must_use]
    pub fn computed(&self) -> Computed {
        self.record.computed()
    }
}

impl Backend for GpuBackend {
    fn hologram(
        &self,
        pictures: Vec<Picture<'_>>,
        frames: usize,
        region: RegionOfInterest,
        loss: Loss,
    ) -> Result<Box<dyn Project>> {
        let problem = match CardProblem::new(&self.card, &pictures, frames, region, &loss) {
            Err(Refusal::NotComputed(reason)) => {
                self.record.refused(reason);
                return Err(Error::Incompatible { name: "device", reason });
            }
            Err(Refusal::Fault(fault)) => Err(fault),
            Ok(problem) => Ok(problem),
        };
        let display = &pictures[0].display;
        let (height_px, width_px) = (display.height_px(), display.width_px());
        let size = ProblemSize { planes: pictures.len(), frames, height_px, width_px };
        let pictures = pictures.iter().map(Into::into).collect();
        let task = Task { processor: Arc::clone(&self.processor), pictures, frames, region, loss };
        Ok(Box::new(Handover::new(problem, size, task, Arc::clone(&self.record))))
    }
}

/// A card for what it computes, and the processor for the rest.
#[derive(Debug)]
pub struct CardOrProcessor(pub GpuBackend);

impl Backend for CardOrProcessor {
    fn hologram(
        &self,
        pictures: Vec<Picture<'_>>,
        frames: usize,
        region: RegionOfInterest,
        loss: Loss,
    ) -> Result<Box<dyn Project>> {
        match self.0.hologram(pictures.clone(), frames, region, loss) {
            Err(Error::Incompatible { name: "device", .. }) => {
                self.0.processor.hologram(pictures, frames, region, loss)
            }
            result => result,
        }
    }
}
