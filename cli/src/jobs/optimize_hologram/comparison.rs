//! Options of the comparison of holograms with their targets.

use crate::arguments::{propagation, region};
use crate::failure::Failure;
use crate::session::Session;
use crate::words::WordParser;
use clap::Args;
use lightpath::v1::{
    self, OptimizeHologram,
    optimize_hologram::{Area, Fit, Judging},
};
use std::path::PathBuf;

/// Options of the comparison.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Comparison with the target")]
pub(super) struct Comparison {
    /// Choose how light is propagated to the image; lightpath display plan shows which methods suit
    #[arg(long, default_value = "auto", value_parser = propagation())]
    propagation: v1::PropagationMethod,

    /// Choose the detector that the optimization simulates: what counts as the light of a pixel
    #[arg(long, default_value = "pixel", value_parser = WordParser::<v1::Detector>::new())]
    detector: v1::Detector,

    /// Compute this many phases per hologram, 1 to 24, to be shown so fast that the eye sees the mean of their light
    #[arg(long, value_name = "N", default_value_t = 1)]
    subframes: u32,

    /// Weight each pixel in the loss by this linear grey picture; black pixels are ignored [default: equal weights]
    #[arg(long, value_name = "FILE")]
    weight_mask: Option<PathBuf>,

    /// Compare pictures only in this region: x,y,width,height in pixels [default: the middle 80 % of each axis]
    #[arg(long, value_name = "X,Y,W,H", value_parser = region)]
    region: Option<v1::Region>,

    /// Choose how the target's values encode light
    #[arg(long, value_name = "ENCODING", default_value = "srgb", value_parser = WordParser::<v1::Encoding>::new())]
    target_encoding: v1::Encoding,

    /// Choose how a target of another size is fitted to its area
    #[arg(long, default_value = "contain", value_parser = WordParser::<Fit>::new())]
    fit: Fit,

    /// Choose what the target fills, with black around it: the region that is compared, or the whole display, where the
    /// target's edges vanish in the light that the picture does not need [default: region; with --fit exact, display]
    #[arg(long, value_parser = WordParser::<Area>::new())]
    area: Option<Area>,

    /// Choose how thoroughly the hologram is judged, which takes as long as some steps of the optimization
    #[arg(long, default_value = "full", value_parser = WordParser::<Judging>::new())]
    judge: Judging,
}

impl Comparison {
    /// Number of patterns of each hologram.
    pub(super) fn subframes(&self) -> usize {
        self.subframes as usize
    }

    /// The input file.
    pub(super) fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.weight_mask.iter()
    }

    /// Uploads the input file and adds the options to `spec`.
    pub(super) async fn fill(&self, session: &Session, spec: OptimizeHologram) -> Result<OptimizeHologram, Failure> {
        let weight_mask = match &self.weight_mask {
            Some(file) => session.upload(file).await?,
            None => String::new(),
        };
        Ok(OptimizeHologram {
            target_encoding: self.target_encoding.into(),
            target_fit: self.fit.into(),
            target_area: self.area.map_or(0, Into::into),
            propagation: self.propagation.into(),
            subframes: Some(self.subframes),
            detector: self.detector.into(),
            region: self.region,
            weight_mask,
            judge: self.judge.into(),
            ..spec
        })
    }
}
