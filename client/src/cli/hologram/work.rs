//! How phases are found.

use crate::cli::arguments::{above_zero, propagation, region};
use crate::cli::failure::Failure;
use crate::cli::session::Session;
use crate::cli::words::WordParser;
use clap::Args;
use lightpath::units::Length;
use lightpath::v1::{
    self, HologramMethod, OptimizeHologram,
    optimize_hologram::{
        self, Fit, InitialPhase,
        initial_phase::{Constant, Given, Kind, Lens, Random},
        loss::Quantity,
    },
};
use std::path::PathBuf;

/// How phases are found.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Optimization")]
pub(super) struct Work {
    /// How the phases are found
    #[arg(long, default_value = "lbfgs", value_parser = method())]
    method: HologramMethod,

    /// Steps of the optimization, 1 to 10000; double-phase takes one
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..))]
    iterations: u32,

    /// Adam's step in radians, above 0, at most 10 [default: 0.1]
    #[arg(long, value_name = "RAD", value_parser = above_zero)]
    learning_rate: Option<f64>,

    /// How light's way to the image is computed; `lightpath display plan` tells what suits
    #[arg(long, default_value = "auto", value_parser = propagation())]
    propagation: v1::PropagationMethod,

    /// What counts as the light of a pixel while optimizing
    #[arg(long, default_value = "pixel", value_parser = WordParser::<v1::Detector>::new())]
    detector: v1::Detector,

    /// Phases of each hologram, 1 to 24, shown so fast that the eye sees the mean of their light
    #[arg(long, value_name = "N", default_value_t = 1)]
    frames: u32,

    /// Where the search begins: random; back-propagated (the targets sent back to the SLM); quadratic, or quadratic:200mm
    /// with a focal length; constant, or constant:1.5 in radians; or a .npy file of radians, float32, one for each
    /// wavelength, separated by commas [default: random; without --phase-range constant for double-phase, and for --detector
    /// supersampled without --frames]
    #[arg(long, value_name = "KIND", value_parser = initial_phase, allow_hyphen_values = true)]
    initial_phase: Option<Start>,

    /// The random part of the initial phase is uniform between 0 and this, in radians, at most 2π = 6.2831853. A wide range
    /// makes speckle, a narrow one a better picture [default: 1; back-propagated: 0]
    #[arg(long, value_name = "RAD")]
    phase_range: Option<f64>,

    /// Seed of the initial phase
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,

    /// What is compared with the target
    #[arg(long, default_value = "intensity", value_parser = WordParser::<Quantity>::new())]
    loss: Quantity,

    /// Factor of the total variation of the light, relative to its mean: smooths. 0 to 1000; begin with 0.001
    #[arg(long, value_name = "FACTOR", default_value_t = 0.0)]
    total_variation: f64,

    /// Factor of the speckle, the excess of local contrast over the target's. 0 to 1000; begin with 0.01
    #[arg(long, value_name = "FACTOR", default_value_t = 0.0)]
    speckle: f64,

    /// Side of the blocks in which speckle is measured, 2 to 256 px
    #[arg(long, value_name = "PX", default_value_t = 8)]
    speckle_block: u32,

    /// How much each pixel counts: a linear grey picture, black counts nothing
    #[arg(long, value_name = "FILE")]
    weight_mask: Option<PathBuf>,

    /// Where the picture counts, in pixels: x,y,width,height [default: the middle 80 % of each axis]
    #[arg(long, value_name = "X,Y,W,H", value_parser = region)]
    roi: Option<v1::RegionOfInterest>,

    /// Take the last third of the steps through the display's grey levels and response, so that quantization costs less
    /// (adam and lbfgs)
    #[arg(long)]
    quantization_aware: bool,

    /// How the target's values stand for light
    #[arg(long, value_name = "ENCODING", default_value = "srgb", value_parser = WordParser::<v1::Encoding>::new())]
    target_encoding: v1::Encoding,

    /// How a target of another size is brought to the display's
    #[arg(long, default_value = "contain", value_parser = WordParser::<Fit>::new())]
    fit: Fit,
}

fn method() -> WordParser<HologramMethod> {
    let names = [("gerchberg-saxton", "gs"), ("weighted-gerchberg-saxton", "wgs"), ("double-phase", "dpac")];
    names.into_iter().fold(WordParser::new(), |parser, (word, alias)| parser.alias(word, alias))
}

/// Where the search begins.
#[derive(Clone, Debug, PartialEq)]
enum Start {
    Random,
    BackPropagated,
    Quadratic(f64),
    Constant(f64),
    Given(Vec<PathBuf>),
}

fn initial_phase(text: &str) -> Result<Start, String> {
    let (kind, value) = match text.split_once(':') {
        Some((kind, value)) => (kind, Some(value)),
        None => (text, None),
    };
    match (kind, value) {
        ("random", None) => Ok(Start::Random),
        ("back-propagated", None) => Ok(Start::BackPropagated),
        ("quadratic", None) => Ok(Start::Quadratic(0.0)),
        ("quadratic", Some(length)) => {
            Ok(Start::Quadratic(Length::Distance.parse_m(length).map_err(|error| error.to_string())?))
        }
        ("constant", None) => Ok(Start::Constant(0.0)),
        ("constant", Some(phase)) => {
            let refused = || format!("a constant phase is a number of radians, such as constant:1.5, not {phase}");
            Ok(Start::Constant(phase.parse().map_err(|_| refused())?))
        }
        _ if text.split(',').all(|file| file.ends_with(".npy")) => {
            Ok(Start::Given(text.split(',').map(PathBuf::from).collect()))
        }
        _ => {
            Err("an initial phase is random, back-propagated, quadratic[:FOCAL LENGTH], constant[:RADIANS] or FILE.npy"
                .to_owned())
        }
    }
}

impl Work {
    /// Files that are read.
    pub(super) fn files(&self) -> impl Iterator<Item = &PathBuf> {
        let given = match &self.initial_phase {
            Some(Start::Given(files)) => files.as_slice(),
            _ => &[],
        };
        given.iter().chain(&self.weight_mask)
    }

    /// Says how, with the files that it takes uploaded.
    pub(super) async fn fill(&self, session: &Session, spec: OptimizeHologram) -> Result<OptimizeHologram, Failure> {
        let loss = optimize_hologram::Loss {
            quantity: self.loss.into(),
            total_variation: self.total_variation,
            speckle: self.speckle,
            speckle_block_px: self.speckle_block,
        };
        let weight_mask = match &self.weight_mask {
            Some(file) => session.client.upload_file(file).await?,
            None => String::new(),
        };
        Ok(OptimizeHologram {
            target_encoding: self.target_encoding.into(),
            target_fit: self.fit.into(),
            propagation: self.propagation.into(),
            method: self.method.into(),
            iterations: self.iterations,
            learning_rate: self.learning_rate.unwrap_or(0.0),
            frames: self.frames,
            initial_phase: self.start(session).await?,
            seed: self.seed,
            loss: Some(loss),
            detector: self.detector.into(),
            region_of_interest: self.roi,
            weight_mask,
            quantization_aware: self.quantization_aware,
            ..spec
        })
    }

    async fn start(&self, session: &Session) -> Result<Option<InitialPhase>, Failure> {
        let random = Random { range_rad: self.phase_range };
        let kind = match &self.initial_phase {
            None if self.phase_range.is_none() => return Ok(None),
            None | Some(Start::Random) => Kind::Random(random),
            Some(Start::BackPropagated) => Kind::BackPropagated(random),
            Some(Start::Quadratic(focal_length_m)) => Kind::Quadratic(Lens { focal_length_m: *focal_length_m }),
            Some(Start::Constant(phase_rad)) => Kind::Constant(Constant { phase_rad: *phase_rad }),
            Some(Start::Given(files)) => {
                let mut given = Given::default();
                for file in files {
                    given.phases.push(session.client.upload_file(file).await?);
                }
                Kind::Given(given)
            }
        };
        Ok(Some(InitialPhase { kind: Some(kind) }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn initial_phases_are_read() {
        assert_eq!(initial_phase("random"), Ok(Start::Random));
        assert_eq!(initial_phase("back-propagated"), Ok(Start::BackPropagated));
        assert_eq!(initial_phase("quadratic"), Ok(Start::Quadratic(0.0)));
        assert_eq!(initial_phase("quadratic:200mm"), Ok(Start::Quadratic(0.2)));
        assert_eq!(initial_phase("constant:-1.5"), Ok(Start::Constant(-1.5)));
        assert_eq!(initial_phase("a.npy,b.npy"), Ok(Start::Given(vec!["a.npy".into(), "b.npy".into()])));
        for bad in ["", "lens", "quadratic:far", "constant:x", "a.png", "random:3"] {
            assert!(initial_phase(bad).is_err(), "{bad}");
        }
    }
}
