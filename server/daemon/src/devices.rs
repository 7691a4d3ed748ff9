//! What computes the holograms of this process, and the command that lists what there is.

use crate::config::Config;
use clap::Args;
use lightpath_gpu::{Card, CardInfo, CardOrProcessor, Device, DeviceChoice, Fault, GpuBackend, cards, evaluation_time};
use lightpath_optics::EngineCache;
use lightpath_optics::hologram::Backend;
use std::fmt::Write as _;
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::thread::available_parallelism;
use std::time::Duration;
use tokio::task::JoinError;

/// Label of a process with a card.
const LABEL: &str = "gpu";
/// Largest side that is measured \[px\].
const SIDE_PX_MAX: usize = 8192;
/// Why there may be no card although one is in the machine.
const NO_DRIVER: &str = "\
No Vulkan driver offers a graphics card. The processor computes everything.

A card needs its vendor's Vulkan driver and the library libvulkan.so.1:
  NVIDIA      the driver itself has it; in a container it needs the capability
              graphics (NVIDIA_DRIVER_CAPABILITIES=all)
  AMD, Intel  apt-get install mesa-vulkan-drivers libvulkan1
";

/// Opens the device of the settings, and gives a process with a card its label. Logs what there is in one line. A card
/// that is not named, and fails, leaves everything to the processor.
///
/// # Errors
///
/// [`Fault`] if the card that the settings name is not there or fails; [`JoinError`] if opening it panics.
pub(crate) async fn open(config: &mut Config) -> Result<Result<Arc<Device>, Fault>, JoinError> {
    let choice = config.device;
    let device = match (tokio::task::spawn_blocking(move || Device::open(choice)).await?, choice) {
        (Ok(device), _) => device,
        (Err(fault), DeviceChoice::Auto) => {
            tracing::warn!(%fault, "the graphics card is not used; the processor computes holograms");
            return Ok(Ok(Arc::new(Device::processor())));
        }
        (Err(fault), _) => return Ok(Err(fault)),
    };
    match (device.card(), choice) {
        (Some(card), _) => {
            tracing::info!(%card, "holograms are computed on a graphics card");
            let labels = &mut config.worker_labels;
            *labels = if labels.is_empty() { LABEL.to_owned() } else { format!("{labels},{LABEL}") };
        }
        (None, DeviceChoice::Auto) => tracing::info!("no graphics card was found; the processor computes holograms"),
        (None, _) => {}
    }
    Ok(Ok(Arc::new(device)))
}

/// List the graphics cards that can compute holograms, with the times of an evaluation on each and on the processor.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  lightpathd devices
  lightpathd devices --resolution 3840x2160
  lightpathd serve --device gpu:1")]
pub struct DevicesArgs {
    /// Size of the display that is measured; give it several times for several sizes
    #[arg(long = "resolution", value_name = "WxH", value_parser = resolution, default_values = ["640x360", "1920x1080"])]
    resolutions: Vec<[usize; 2]>,
}

impl DevicesArgs {
    /// Tests and measures what there is, and returns it as text.
    #[must_use]
    pub fn run(self) -> String {
        let processor = Arc::new(EngineCache::new(1 << 30));
        let cards = cards();
        let mut text = if cards.is_empty() { NO_DRIVER.to_owned() } else { String::new() };
        for (number, info) in cards.iter().enumerate() {
            let _ = writeln!(text, "gpu:{number}  {}", info.name);
            let _ = writeln!(text, "       driver {}{}", info.driver, note(info));
            let _ = writeln!(text, "       arrays of up to {} MiB", info.array_bytes_max >> 20);
            match Card::open(number).and_then(|card| card.test().map(|()| card)) {
                Err(fault) => _ = writeln!(text, "       self-test failed: {fault}"),
                Ok(card) => {
                    let backend = CardOrProcessor(GpuBackend::new(card, Arc::clone(&processor)));
                    let _ = writeln!(text, "       self-test passed");
                    self.write_times(&mut text, &backend);
                    if let Some(because) = backend.0.computed().processor_because {
                        let _ = writeln!(text, "       the processor helped: {because}");
                    }
                }
            }
        }
        let threads = available_parallelism().map_or(1, NonZeroUsize::get);
        let _ = writeln!(text, "cpu    {threads} threads");
        self.write_times(&mut text, &*processor);
        text
    }

    fn write_times(&self, text: &mut String, backend: &dyn Backend) {
        for &[width_px, height_px] in &self.resolutions {
            let time = match evaluation_time(backend, height_px, width_px) {
                Ok(time) => milliseconds(time),
                Err(error) => error.to_string(),
            };
            let _ = writeln!(text, "       {width_px}×{height_px}: {time}");
        }
    }
}

/// Why a card is not chosen by itself.
fn note(info: &CardInfo) -> &'static str {
    if info.is_software { "; it computes on the processor, so `auto` never takes it" } else { "" }
}

fn milliseconds(time: Duration) -> String {
    format!("{:.2} ms for loss and gradient", 1e3 * time.as_secs_f64())
}

fn resolution(text: &str) -> Result<[usize; 2], String> {
    let sides = text.split_once('x').and_then(|(width, height)| Some([width.parse().ok()?, height.parse().ok()?]));
    let allowed = 2..=SIDE_PX_MAX;
    match sides {
        Some(sides) if sides.iter().all(|side| allowed.contains(side)) => Ok(sides),
        Some(_) => Err(format!("each side must be 2 to {SIDE_PX_MAX} px")),
        None => Err("must be WIDTHxHEIGHT, such as 1920x1080".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_are_tested_and_measured_beside_the_processor() {
        let text = DevicesArgs { resolutions: vec![[80, 48]] }.run();
        for part in ["gpu:0", "self-test passed", "\ncpu", "80×48: "] {
            assert!(text.contains(part), "a Vulkan driver is needed, such as Debian's mesa-vulkan-drivers: {text}");
        }
        assert_eq!(resolution("1920x1080"), Ok([1920, 1080]));
        assert!(resolution("1920").is_err() && resolution("1x9000").is_err());
    }
}
