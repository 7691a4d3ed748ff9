//! The commands `lightpath display …`.

mod bench_file;
mod orders;
mod phase_response;
mod plan;
mod update;

use super::arguments::{Limit, pixel_pitch, resolution, wavelength};
use super::failure::Failure;
use super::pages::pages;
use super::session::Session;
use super::show;
use super::table::{Facts, Table};
use super::words::WordParser;
use clap::{Args, Subcommand};
use lightpath::v1::{self, Display, Modulator};
use lightpath::{Words, names, units};
use std::f64::consts::PI;
use std::path::PathBuf;

/// Commands for displays.
// Variants without a comment take their help from the struct of their arguments. A comment here would hide all but its
// first line.
#[derive(Debug, Subcommand)]
pub(crate) enum DisplayCommand {
    Create(Box<Create>),
    /// List displays
    List(Limit),
    /// Show one display
    Show(Id),
    Plan(plan::Plan),
    Update(update::Update),
    /// Delete a display that has no datasets, kernels or jobs
    Delete(Id),
}

/// Declare a display.
///
/// A display is a phase-only spatial light modulator (SLM) and the optics behind it. Declaring the same display again
/// changes nothing. The server refuses an existing id with other properties.
#[derive(Debug, Args)]
#[command(
    override_usage = "lightpath display create [OPTIONS] --resolution <WxH>\n           --pixel-pitch <LENGTH> --wavelength <LENGTH> <ID>"
)]
#[command(after_long_help = "\
Examples:
  lightpath display create lab-2 --resolution 1920x1080 --pixel-pitch 8um \\
      --wavelength 515nm
  lightpath display create rgb --resolution 3840x2160 --pixel-pitch 3.74um \\
      --wavelength 450nm --wavelength 520nm --wavelength 638nm --bit-depth 10 \\
      --carrier half-order-x

A display without a filter for the diffraction orders of its pixels:
  lightpath display create bare --resolution 1920x1080 --pixel-pitch 8um \\
      --wavelength 515nm --orders all --fill-factor 0.93

A display whose filter passes half an order along y, around the image that a carrier steers:
  lightpath display create relay --resolution 1920x1080 --pixel-pitch 8um \\
      --wavelength 515nm --carrier half-order-y --filter 1x0.5

A display that exists only as a simulation (see lightpath simulate --help):
  lightpath display create toy --resolution 480x270 --pixel-pitch 8um \\
      --wavelength 515nm --simulated-seed 1
  lightpath display create bench --resolution 960x540 --pixel-pitch 8um \\
      --wavelength 515nm --simulated bench.toml

docs/bench.toml has every property of a simulated bench with its range and default;
docs/like-the-paper.toml is the bench with that name.")]
pub(crate) struct Create {
    /// Id of the new display: 1 to 63 characters of a-z, 0-9 and '-', starting with a letter
    id: String,

    /// Set the size of the SLM: columns x rows in pixels, 16 to 8192 each, for example 1920x1080
    #[arg(long, value_name = "WxH", value_parser = resolution)]
    resolution: (u32, u32),

    /// Set the distance between the centres of neighbouring SLM pixels, 0.1um to 1mm, for example 8um
    #[arg(long, value_name = "LENGTH", value_parser = pixel_pitch, allow_hyphen_values = true)]
    pixel_pitch: f64,

    /// Set a wavelength in vacuum that illuminates the display, 200nm to 2um, for example 515nm; may be given several
    /// times
    #[arg(long = "wavelength", value_name = "LENGTH", value_parser = wavelength, required = true, allow_hyphen_values = true)]
    wavelengths: Vec<f64>,

    /// Set the number of bits of a grey level, 1 to 16: grey levels are 0 to 2^N - 1
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..))]
    bit_depth: u32,

    /// Read the measured phase of each grey level from this text file: 2^bit-depth lines, each with a phase in radians, or
    /// with a level and its phase [default: level · 2π / 2^bit-depth]
    ///
    /// A heading may name another unit: deg, pi or waves. Numbers that look like degrees or levels are refused, unless
    /// the heading names a unit. Empty lines are skipped, and so are lines that start with # behind the heading.
    #[arg(long, value_name = "FILE")]
    phase_response: Option<PathBuf>,

    /// Add this grating to every hologram; it steers the image away from the undiffracted light [default: none]
    #[arg(long, value_parser = WordParser::<v1::Carrier>::new())]
    carrier: Option<v1::Carrier>,

    #[command(flatten)]
    orders: orders::Options,

    /// Set the side of the part of a pixel in which the camera sees light, in pixel pitches of the display, 0.1 to 1
    ///
    /// For a camera with one pixel for each pixel of the display and gaps between them. One with more and smaller pixels
    /// sees all light of a pixel. The detector `pixel` integrates over this part.
    #[arg(long, value_name = "SIDE", default_value_t = 1.0)]
    camera_fill_factor: f64,

    /// Store this text with the display, at most 4096 bytes [default: none]
    #[arg(long, value_name = "TEXT", default_value = "", hide_default_value = true)]
    notes: String,

    /// Make it a simulated display with the properties in this TOML file, or like that of the paper
    #[arg(
        long,
        value_name = "BENCH.toml|like-the-paper",
        conflicts_with_all = ["simulated_seed", "simulated_strength", "camera_noise", "misalignment"],
        help_heading = "Simulated bench"
    )]
    simulated: Option<PathBuf>,

    /// Make it a simulated display with imperfections drawn from this seed
    #[arg(long, value_name = "N", help_heading = "Simulated bench")]
    simulated_seed: Option<u64>,

    /// Multiply every optical imperfection by this factor, 0 to 4
    #[arg(
        long,
        value_name = "X",
        default_value_t = 1.0,
        requires = "simulated_seed",
        help_heading = "Simulated bench"
    )]
    simulated_strength: f64,

    /// Set the standard deviation of the camera's read noise as a fraction of full scale, 0 to 0.1
    #[arg(
        long,
        value_name = "X",
        default_value_t = 0.003,
        requires = "simulated_seed",
        help_heading = "Simulated bench"
    )]
    camera_noise: f64,

    /// Shift the camera by a random amount of at most this, in pixels, in x and in y, 0 to 4
    #[arg(
        long,
        value_name = "PX",
        default_value_t = 0.0,
        requires = "simulated_seed",
        help_heading = "Simulated bench"
    )]
    misalignment: f64,
}

/// The display that a command applies to.
#[derive(Debug, Args)]
pub(crate) struct Id {
    /// Id of the display
    id: String,
}

impl DisplayCommand {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        match self {
            Self::Create(create) => {
                let display = Some(create.display()?);
                let display = session.client.create_display(v1::CreateDisplayRequest { display }).await?;
                session.print(&display, facts)
            }
            Self::List(limit) => list(session, limit.limit).await,
            Self::Show(id) => {
                let request = v1::GetDisplayRequest { name: names::display(&id.id) };
                session.print(&session.client.get_display(request).await?, facts)
            }
            Self::Plan(plan) => plan.run(session).await,
            Self::Update(update) => update.run(session).await,
            Self::Delete(id) => {
                let request = v1::DeleteDisplayRequest { name: names::display(&id.id) };
                let answer = session.client.delete_display(request).await?;
                session.print_done(&answer, &format!("deleted display {}", id.id))
            }
        }
    }
}

impl Create {
    fn display(&self) -> Result<Display, Failure> {
        let bench = match &self.simulated {
            Some(path) => Some(bench_file::read(path)?),
            None => self.simulated_seed.map(|seed| v1::SimulatedBench {
                seed,
                strength: Some(self.simulated_strength),
                camera_noise: Some(self.camera_noise),
                misalignment_px: self.misalignment,
                ..Default::default()
            }),
        };
        Ok(Display {
            name: names::display(&self.id),
            modulator: Some(self.modulator()?),
            wavelengths_m: self.wavelengths.clone(),
            carrier: self.carrier.unwrap_or_default().into(),
            orders: self.orders.message()?,
            camera_fill_factor: Some(self.camera_fill_factor),
            notes: self.notes.clone(),
            bench: bench.map(v1::display::Bench::SimulatedBench),
            ..Default::default()
        })
    }

    fn modulator(&self) -> Result<Modulator, Failure> {
        let response_rad = self.phase_response.as_deref().map(phase_response::read).transpose()?.unwrap_or_default();
        Ok(Modulator {
            bit_depth: Some(self.bit_depth),
            kind: Some(v1::modulator::Kind::Phase(v1::PhaseModulator { response_rad })),
            ..Modulator::of_phase(self.resolution.0, self.resolution.1, self.pixel_pitch)
        })
    }
}

async fn list(session: &Session, limit: u32) -> Result<(), Failure> {
    let list = pages(limit, async |page_size, page_token| {
        session.client.list_displays(v1::ListDisplaysRequest { page_size, page_token }).await
    })
    .await?;
    session.print_pages(list, |displays| {
        let mut table = Table::new("display|>resolution|>pitch|wavelengths~|>bits??|kind|created????|age???");
        for display in displays {
            let modulator = display.modulator.clone().unwrap_or_default();
            table.row([
                names::id(&display.name).to_owned(),
                format!("{}x{}", modulator.width_px, modulator.height_px),
                units::show_m(modulator.pixel_pitch_x_m),
                show::lengths(display.wavelengths_m.iter().copied()),
                modulator.bit_depth().to_string(),
                if display.simulated_bench().is_some() { "simulated".to_owned() } else { "real".to_owned() },
                show::clock_or_dash(display.create_time.as_ref()),
                show::age_or_dash(display.create_time.as_ref()),
            ]);
        }
        table.text_or("no displays; declare one: lightpath display create --help")
    })
}

fn facts(display: &Display) -> String {
    let mut facts = Facts::default();
    facts.add("display", names::id(&display.name));
    let modulator = display.modulator.clone().unwrap_or_default();
    facts.add("resolution", format!("{}x{} px", modulator.width_px, modulator.height_px));
    facts.add("pixel pitch", units::show_m(modulator.pixel_pitch_x_m));
    facts.add("wavelengths", show::lengths(display.wavelengths_m.iter().copied()));
    facts.add("bit depth", modulator.bit_depth().to_string());
    facts.add("phase response", response_text(modulator.response_rad()));
    let carrier = Some(display.carrier()).filter(|carrier| *carrier != v1::Carrier::Unspecified);
    facts.add("carrier", carrier.map_or("none", Words::word));
    facts.add("orders", orders::text(display));
    if let Some(side) = display.camera_fill_factor.filter(|&side| side != 1.0) {
        facts.add("camera's fill factor", side.to_string());
    }
    if let Some(bench) = display.simulated_bench() {
        facts.add("simulated", format!("seed {}", bench.seed));
        for (name, value) in bench_file::properties(bench) {
            facts.add(&name, value.to_string());
        }
    }
    if !display.notes.is_empty() {
        facts.add("notes", &display.notes);
    }
    facts.add_some("created", display.create_time.as_ref().map(show::time));
    facts.text()
}

/// A measured response with the range of its phases, in which a wrong unit shows.
fn response_text(response_rad: &[f64]) -> String {
    if response_rad.is_empty() {
        return "linear, 0 to 2π".to_owned();
    }
    let in_pi = |phase_rad: f64| phase_rad / PI;
    let least = response_rad.iter().copied().fold(f64::INFINITY, f64::min);
    let most = response_rad.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    format!("measured, {:.2}π to {:.2}π", in_pi(least), in_pi(most))
}
