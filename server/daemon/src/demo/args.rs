//! Arguments of the demo.

use lightpath::Words as _;
use lightpath::units::{Length, ParseError};
use lightpath::v1::KernelModel;
use lightpath_media::pictures::SIDE_PX_MAX;
use std::path::PathBuf;

/// Name of the display on the demo's server.
pub(super) const DISPLAY: &str = "demo";
/// Name of the dataset on the demo's server.
pub(super) const DATASET: &str = "demo-photographs";
/// Model of the kernel that the demo makes active.
const FIRST_MODEL: KernelModel = KernelModel::Display;

/// Run all steps on a simulated display: optimize holograms, photograph them, learn a kernel, optimize better
/// holograms.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "\
Examples:
  lightpathd demo
  lightpathd demo --images photos/ --out tour
  lightpathd demo --models display,smooth,dense,paper --pairs 32
  lightpathd demo --paper
  lightpathd demo --paper --resolution 480x270")]
pub struct DemoArgs {
    /// Folder for the pictures, the report and the server's data; must be new, empty, or from an earlier demo
    #[arg(long, value_name = "DIR", default_value = "lightpath-demo")]
    pub out: PathBuf,
    /// Folder of PNG, JPEG or TIFF pictures to use instead of generated ones; at least 5
    #[arg(long, value_name = "DIR")]
    pub images: Option<PathBuf>,
    /// Compare with the paper on which Lightpath is based: learn the model paper, too, use a display of the paper's
    /// size, and print a table of training and test errors in the paper's form
    #[arg(long)]
    pub paper: bool,
    /// Size of the display in pixels, WIDTHxHEIGHT [default: 480x270, with --paper 1920x1080]
    #[arg(long = "resolution", value_name = "WxH", value_parser = resolution)]
    pub asked_resolution: Option<(u32, u32)>,
    /// Distance from the display to the image [default: 0.6 of the critical distance, up to which the whole band is
    /// sampled]
    #[arg(long, value_name = "LENGTH", value_parser = |text: &str| length(Length::Distance, text))]
    pub distance: Option<f64>,
    /// Wavelength of the light
    #[arg(long, value_name = "LENGTH", default_value = "515nm", value_parser = |text: &str| length(Length::Wavelength, text))]
    pub wavelength: f64,
    /// Distance between the display's pixels
    #[arg(long, value_name = "LENGTH", default_value = "8um", value_parser = |text: &str| length(Length::PixelPitch, text))]
    pub pixel_pitch: f64,
    /// Seed of the display's imperfections, the pictures and the noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Number of photographs to learn from; a quarter more are held out
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(2..=500))]
    pub pairs: u32,
    /// Number of targets to show through each kernel
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=20))]
    pub held_out: u32,
    /// Iterations for each hologram of a held-out target
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub iterations: u32,
    /// Iterations for each hologram to learn from
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub training_iterations: u32,
    /// Models to learn: display (always, and first), varying, smooth, dense, paper [default: display,smooth, with
    /// --paper display,paper]
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = model)]
    pub models: Vec<KernelModel>,
}

/// Smallest side of the demo's display \[px\]: smaller pictures show no details.
const SIDE_PX_MIN: u32 = 32;
/// Default distance of the image, as a fraction of the critical distance: the whole band is kept, and light spreads
/// far.
const DISTANCE_SHARE: f64 = 0.6;
/// Columns and rows of the demo's display \[px\].
const SIZE_PX: (u32, u32) = (480, 270);
/// Columns and rows of the display with `--paper` \[px\].
const PAPER_SIZE_PX: (u32, u32) = (1920, 1080);

impl DemoArgs {
    /// Columns and rows of the display \[px\].
    pub(super) fn resolution(&self) -> (u32, u32) {
        self.asked_resolution.unwrap_or(if self.paper { PAPER_SIZE_PX } else { SIZE_PX })
    }

    /// Distance from the display to the image \[m\].
    pub(super) fn distance_m(&self) -> f64 {
        let (width_px, height_px) = self.resolution();
        let critical_m = 2.0 * f64::from(width_px.min(height_px)) * self.pixel_pitch.powi(2) / self.wavelength;
        self.distance.unwrap_or_else(|| (DISTANCE_SHARE * critical_m * 1e3).ceil() / 1e3)
    }

    /// Whether the demo has as much to do as with its default options.
    pub(super) fn has_default_work(&self) -> bool {
        let plain = matches!(self.models.as_slice(), [FIRST_MODEL, KernelModel::Smooth]);
        let numbers = (self.pairs, self.held_out, self.iterations, self.training_iterations);
        plain && self.resolution() == SIZE_PX && numbers == (16, 3, 200, 60)
    }

    /// Removes repeated models and puts the model that becomes active first.
    pub(super) fn ordered(mut self) -> Self {
        let mut models = vec![FIRST_MODEL];
        if self.models.is_empty() {
            self.models = vec![if self.paper { KernelModel::Paper } else { KernelModel::Smooth }];
        } else if self.paper {
            models.push(KernelModel::Paper);
        }
        for model in self.models {
            if !models.contains(&model) {
                models.push(model);
            }
        }
        self.models = models;
        self
    }
}

fn model(name: &str) -> Result<KernelModel, String> {
    let found = KernelModel::from_word(name).filter(|model| *model != KernelModel::Unspecified);
    found.ok_or_else(|| "must be display, varying, smooth, dense or paper".to_owned())
}

fn length(kind: Length, text: &str) -> Result<f64, ParseError> {
    kind.parse_m(text)
}

fn resolution(text: &str) -> Result<(u32, u32), String> {
    let sides = text.split_once('x').and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    let allowed = SIDE_PX_MIN..=SIDE_PX_MAX / 2;
    match sides {
        Some((width, height)) if allowed.contains(&width) && allowed.contains(&height) => Ok((width, height)),
        Some(_) => Err(format!("each side must be {SIDE_PX_MIN} to {} px", SIDE_PX_MAX / 2)),
        None => Err("must be WIDTHxHEIGHT, such as 480x270".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        args: DemoArgs,
    }

    fn parse(words: &str) -> Result<DemoArgs, clap::Error> {
        Cli::try_parse_from(["demo"].into_iter().chain(words.split_whitespace())).map(|cli| cli.args.ordered())
    }

    #[test]
    fn default_distance_follows_from_the_resolution() {
        assert_eq!(parse("").unwrap().distance_m(), 0.041);
        assert_eq!(parse("--resolution 160x96").unwrap().distance_m(), 0.015);
        assert_eq!(parse("--distance 12.5mm").unwrap().distance_m(), 0.0125);
    }

    #[test]
    fn display_model_is_learned_first() {
        let models = |words: &str| parse(words).unwrap().models;
        let (display, smooth) = (KernelModel::Display, KernelModel::Smooth);
        assert_eq!(models("--models dense,smooth,dense"), [display, KernelModel::Dense, smooth]);
        assert_eq!(models(""), [display, smooth]);
        assert_eq!(models("--paper"), [display, KernelModel::Paper]);
        assert_eq!(models("--paper --models smooth"), [display, KernelModel::Paper, smooth]);
    }

    #[test]
    fn paper_option_changes_the_default_resolution() {
        assert_eq!(parse("").unwrap().resolution(), (480, 270));
        assert_eq!(parse("--paper").unwrap().resolution(), (1920, 1080));
        assert_eq!(parse("--paper --resolution 160x96").unwrap().resolution(), (160, 96));
    }

    #[test]
    fn invalid_arguments_are_refused() {
        for bad in ["--resolution 480", "--resolution 8x8", "--resolution 0x-5", "--pairs 1", "--models best"] {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }
}
