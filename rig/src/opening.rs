//! Opening the bench that the rig's file describes.

use crate::Problem;
use crate::adapters::{command, folder, simulated};
use crate::bench::{Bench, Open};
use crate::settings::{Adapter, Settings};
use lightpath::v1;
use lightpath_bench::SimulatedBench;
use std::path::Path;

/// Opens the bench that the rig's file describes. A simulated bench takes what its file leaves out from the server's
/// display.
///
/// # Errors
///
/// [`Problem::Setting`] for a file that a section names and that is wrong, [`Problem::Devices`] if the devices cannot be
/// used.
pub fn open(settings: &Settings, display: Option<&v1::Display>) -> Result<Bench, Problem> {
    let (slm, camera) = (settings.slm_facts(), settings.camera_facts());
    let open: Open = match settings.adapter {
        Adapter::Simulated => {
            let simulated = simulated(settings, display)?;
            Box::new(move || Ok(simulated.devices()))
        }
        Adapter::Folder => {
            let folder = settings.folder.clone();
            Box::new(move || folder::devices(&folder, &slm, &camera))
        }
        Adapter::Command => {
            let command = settings.command.clone();
            let command = command.ok_or_else(|| Problem::Setting("the section [command] is missing".to_owned()))?;
            Box::new(move || command::devices(&command, &slm, &camera))
        }
    };
    Ok(Bench::open(open, |slm| settings.safe_pattern(slm))?)
}

/// The simulated bench that the rig's file describes.
///
/// # Errors
///
/// The errors of [`open`].
pub fn simulated(settings: &Settings, display: Option<&v1::Display>) -> Result<simulated::Simulated, Problem> {
    let of_display = display.and_then(|display| display.modulator.as_ref()).map(|modulator| modulator.pixel_pitch_x_m);
    let missing = "simulated.pixel_pitch is missing: give it, such as \"8um\"";
    let pitch_m = settings.pixel_pitch_m().map_err(Problem::Setting)?.or(of_display);
    let pitch_m = pitch_m.ok_or_else(|| Problem::Setting(missing.to_owned()))?;
    let flaws = settings.simulated.bench.as_deref().map_or(Ok(SimulatedBench::FAIR), flaws)?;
    let wavelengths_m = settings.wavelengths_m().map_err(Problem::Setting)?;
    let distance_m = settings.distance_m().map_err(Problem::Setting)?;
    let slm = settings.slm_facts();
    let optics = simulated::Optics::plain(slm.clone(), pitch_m, wavelengths_m, distance_m, flaws)?;
    let optics = match display {
        Some(display) => optics.of_display(display)?,
        None => optics,
    };
    let facts = simulated::Facts { slm, camera: settings.camera_facts() };
    Ok(simulated::Simulated::new(settings.simulated.clone(), facts, optics)?)
}

/// Reads the flaws of a simulated bench.
fn flaws(path: &Path) -> Result<SimulatedBench, Problem> {
    let wrong = |why: &dyn std::fmt::Display| Problem::Setting(format!("simulated.bench: {}: {why}", path.display()));
    let text = std::fs::read_to_string(path).map_err(|error| wrong(&error))?;
    let flaws: SimulatedBench = toml::from_str(&text).map_err(|error| wrong(&error))?;
    flaws.validate().map_err(|error| wrong(&error))?;
    Ok(flaws)
}
