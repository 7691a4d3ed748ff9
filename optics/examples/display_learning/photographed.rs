//! Pairs in the form of files: one byte for each pixel, decoded on use.

use lightpath_optics::Plane;
use lightpath_optics::display::phase_response::PhaseResponse;
use lightpath_optics::learning::{BoxError, Pair, PairSource};

/// Holograms as grey levels, with their photographs.
#[derive(Clone, Debug)]
pub(crate) struct PhotographedPairs {
    pub(crate) levels: Vec<Plane<u8>>,
    pub(crate) photos: Vec<Plane<u8>>,
}

impl PairSource for PhotographedPairs {
    fn len(&self) -> usize {
        self.levels.len()
    }

    fn pair(&self, index: usize) -> Result<Pair, BoxError> {
        Ok(Pair { phase: phase(&self.levels[index])?, photo: self.photos[index].map(|level| f32::from(level) / 255.0) })
    }
}

/// The phase \[rad\] that the SLM shows for these grey levels.
pub(crate) fn phase(levels: &Plane<u8>) -> Result<Plane<f32>, BoxError> {
    Ok(PhaseResponse::linear(8)?.dequantize(&levels.map(u16::from))?)
}
