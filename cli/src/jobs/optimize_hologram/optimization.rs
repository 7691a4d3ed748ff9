//! Options of the optimization that finds the phases of holograms.

use super::comparison::Comparison;
use crate::arguments::above_zero;
use crate::failure::Failure;
use crate::session::Session;
use crate::words::WordParser;
use clap::Args;
use lightpath::units::Length;
use lightpath::v1::{
    HologramMethod, OptimizeHologram,
    optimize_hologram::{
        self, InitialPhase,
        initial_phase::{Constant, Given, Kind, Lens, Random},
        loss::Quantity,
    },
};
use std::path::PathBuf;

/// Options of the optimization.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Optimization")]
pub(super) struct OptimizationOptions {
    /// Choose the method that finds the phases
    #[arg(long, default_value = "lbfgs", value_parser = method())]
    method: HologramMethod,

    /// Optimize for this many steps, 1 to 10000; double-phase takes one step
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..))]
    iterations: u32,

    /// Set the learning rate of adam in radians, above 0, at most 10; only with --method adam [default: 0.1]
    #[arg(long, value_name = "RAD", value_parser = above_zero)]
    learning_rate: Option<f64>,

    /// Choose the phase that the search starts from: random; back-propagated (the targets propagated back to the SLM);
    /// quadratic, or quadratic:200mm with a focal length; constant, or constant:1.5 in radians; or .npy files of
    /// radians (floats), one per wavelength, separated by commas [default: back-propagated, within 1 rad, or 0 rad
    /// with the detector supersampled; but random with --phase-range, with several --subframes and for gerchberg-saxton,
    /// and constant for double-phase]
    #[arg(long, value_name = "KIND", value_parser = initial_phase, allow_hyphen_values = true)]
    initial_phase: Option<Start>,

    /// Draw the random part of the initial phase between 0 and this, in radians, at most 2π = 6.2831853; a wide range
    /// makes speckle, a narrow one a better picture [default: 1; for back-propagated 0]
    #[arg(long, value_name = "RAD")]
    phase_range: Option<f64>,

    /// Set the seed of the random part of the initial phase
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,

    /// Choose the quantity that is compared with the target
    #[arg(long, default_value = "intensity", value_parser = WordParser::<Quantity>::new())]
    loss: Quantity,

    /// Smooth the picture: add this factor times the light's total variation, relative to its mean, to the loss; 0 to
    /// 1000, try 0.001 first
    #[arg(long, value_name = "FACTOR", default_value_t = 0.0)]
    total_variation: f64,

    /// Reduce speckle: add this factor times the difference in local contrast from the target to the loss; 0 to 1000,
    /// try
    /// 0.01 first
    #[arg(long, value_name = "FACTOR", default_value_t = 0.0)]
    speckle: f64,

    /// Measure speckle in square blocks with this side in pixels, 2 to 256
    #[arg(long, value_name = "PX", default_value_t = 8)]
    speckle_block: u32,

    /// Use the display's grey levels and phase response in the last third of the steps, so that quantization costs less
    /// quality; only with adam and lbfgs
    #[arg(long)]
    quantization_aware: bool,

    #[command(flatten)]
    comparison: Comparison,
}

fn method() -> WordParser<HologramMethod> {
    let names = [("gerchberg-saxton", "gs"), ("weighted-gerchberg-saxton", "wgs"), ("double-phase", "dpac")];
    names.into_iter().fold(WordParser::new(), |parser, (word, alias)| parser.alias(word, alias))
}

/// The phase that the search starts from.
#[derive(Clone, Debug, PartialEq)]
enum Start {
    Random,
    BackPropagated,
    /// Focal length \[m\]; `None`: the server's default.
    Quadratic(Option<f64>),
    /// Phase \[rad\].
    Constant(f64),
    /// Paths of .npy files, one for each wavelength.
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
        ("quadratic", None) => Ok(Start::Quadratic(None)),
        ("quadratic", Some(length)) => {
            Ok(Start::Quadratic(Some(Length::Distance.parse_m(length).map_err(|error| error.to_string())?)))
        }
        ("constant", None) => Ok(Start::Constant(0.0)),
        ("constant", Some(phase)) => {
            let error =
                || format!("the constant phase is {phase}, but must be a number of radians, such as constant:1.5");
            Ok(Start::Constant(phase.parse().map_err(|_| error())?))
        }
        _ if text.split(',').all(|file| file.ends_with(".npy")) => {
            Ok(Start::Given(text.split(',').map(PathBuf::from).collect()))
        }
        _ => {
            Err("must be random, back-propagated, quadratic[:FOCAL LENGTH], constant[:RADIANS] or FILE.npy".to_owned())
        }
    }
}

impl OptimizationOptions {
    /// The input files.
    pub(super) fn files(&self) -> impl Iterator<Item = &PathBuf> {
        let given = match &self.initial_phase {
            Some(Start::Given(files)) => files.as_slice(),
            _ => &[],
        };
        given.iter().chain(self.comparison.files())
    }

    /// Uploads the input files and adds the options to `spec`.
    pub(super) async fn fill(&self, session: &Session, spec: OptimizeHologram) -> Result<OptimizeHologram, Failure> {
        let loss = optimize_hologram::Loss {
            quantity: self.loss.into(),
            total_variation: self.total_variation,
            speckle: self.speckle,
            speckle_block_px: Some(self.speckle_block),
        };
        let spec = self.comparison.fill(session, spec).await?;
        Ok(OptimizeHologram {
            method: self.method.into(),
            iterations: Some(self.iterations),
            learning_rate: self.learning_rate,
            initial_phase: self.initial_phase(session).await?,
            seed: self.seed,
            loss: Some(loss),
            quantization_aware: self.quantization_aware,
            ..spec
        })
    }

    /// The initial phase for the API, with its files uploaded. `None` stands for the server's default.
    async fn initial_phase(&self, session: &Session) -> Result<Option<InitialPhase>, Failure> {
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
                    given.phases.push(session.upload(file).await?);
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
    fn initial_phases_are_parsed() {
        assert_eq!(initial_phase("random"), Ok(Start::Random));
        assert_eq!(initial_phase("back-propagated"), Ok(Start::BackPropagated));
        assert_eq!(initial_phase("quadratic"), Ok(Start::Quadratic(None)));
        assert_eq!(initial_phase("quadratic:200mm"), Ok(Start::Quadratic(Some(0.2))));
        assert_eq!(initial_phase("constant:-1.5"), Ok(Start::Constant(-1.5)));
        assert_eq!(initial_phase("a.npy,b.npy"), Ok(Start::Given(vec!["a.npy".into(), "b.npy".into()])));
        for bad in ["", "lens", "quadratic:far", "constant:x", "a.png", "random:3"] {
            assert!(initial_phase(bad).is_err(), "{bad}");
        }
    }
}
