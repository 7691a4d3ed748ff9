//! Arguments that select a kernel.

use super::arguments::{distance, wavelength};
use super::failure::Failure;
use super::missing;
use super::session::Session;
use super::show;
use clap::Args;
use lightpath::v1::{self, kernel_choice::Kind};
use lightpath::{names, units};

/// A kernel, by its name or by its display, distance and wavelength.
#[derive(Debug, Args)]
pub(crate) struct KernelChoice {
    /// Use the kernel with this name, as kernel list prints it; or give --display and --distance
    #[arg(value_name = "KERNEL", conflicts_with = "display")]
    kernel: Option<String>,

    /// Use the kernel of the display with this id; needs --distance
    #[arg(long, value_name = "ID", requires = "distance")]
    display: Option<String>,

    /// Use the kernel of this distance from the SLM to the image plane, for example 150mm; needs --display
    #[arg(long, value_name = "LENGTH", value_parser = distance, allow_hyphen_values = true, requires = "display")]
    distance: Option<f64>,

    /// Use the kernel of this wavelength in vacuum, for example 515nm [default: the only one at this distance]
    #[arg(long, value_name = "LENGTH", value_parser = wavelength, allow_hyphen_values = true, requires = "display")]
    wavelength: Option<f64>,
}

impl KernelChoice {
    /// Returns the kernel's name, `displays/{id}/kernels/{k}`. The server knows the name of the kernel at a distance.
    pub(crate) async fn name(&self, session: &Session) -> Result<String, Failure> {
        let (display, distance_m) = match (&self.kernel, &self.display, self.distance) {
            (Some(name), _, _) => return Ok(name.clone()),
            (None, Some(display), Some(distance_m)) => (display, distance_m),
            _ => return Err(Failure::Usage("give the name of a kernel, or --display and --distance".to_owned())),
        };
        let request = v1::ListKernelsRequest {
            display: names::display(display),
            wavelength_m: self.wavelength,
            place: Some(v1::Place::at_m(distance_m)),
            ..Default::default()
        };
        let kernels = session.client.list_kernels(request).await?.kernels;
        match kernels.as_slice() {
            [kernel] => Ok(kernel.name.clone()),
            [] => Err(missing::kernel(session, display, distance_m, &self.optics(distance_m)).await),
            several => {
                let several = show::lengths(several.iter().map(|kernel| kernel.wavelength_m));
                Err(Failure::Usage(format!(
                    "display {display} has kernels of several wavelengths ({several}): choose one with --wavelength"
                )))
            }
        }
    }

    /// Wavelength and distance, as an error names them.
    fn optics(&self, distance_m: f64) -> String {
        let distance = format!("at {}", units::show_m(distance_m));
        self.wavelength.map_or(distance.clone(), |wavelength| format!("of {} {distance}", units::show_m(wavelength)))
    }

    /// Selects the kernel of a display at a distance; without a wavelength, the only one there.
    pub(crate) fn at(display: &str, distance_m: f64, wavelength: Option<f64>) -> Self {
        Self { kernel: None, display: Some(display.to_owned()), distance: Some(distance_m), wavelength }
    }

    /// Returns the name of a version of the kernel: of this one, or of the newest.
    pub(crate) async fn version_name(&self, session: &Session, version: Option<u32>) -> Result<String, Failure> {
        let name = self.name(session).await?;
        let version = match version {
            Some(version) => version,
            None => session.client.get_kernel(v1::GetKernelRequest { name: name.clone() }).await?.latest_version,
        };
        Ok(names::kernel_version(&name, version))
    }
}

/// Selects the kernel for the display, wavelength and place of a dataset, `datasets/{id}`.
pub(crate) async fn of_dataset(session: &Session, dataset: &str) -> Result<Option<KernelChoice>, Failure> {
    let request = v1::GetDatasetRequest { name: dataset.to_owned() };
    let v1::Dataset { display, wavelength_m, place, .. } = session.client.get_dataset(request).await?;
    let distance_m = place.and_then(|place| place.distance_m());
    Ok(distance_m.map(|distance_m| KernelChoice::at(names::id(&display), distance_m, wavelength_m)))
}

/// Returns which kernel a job uses. `text` is `ideal`, `active`, the number or name of a version, or an alias; empty for
/// the server's choice. `kernel` finds the kernel of which a number names a version, if the job has only one.
pub(crate) async fn used(
    session: &Session,
    text: &str,
    kernel: impl AsyncFnOnce() -> Result<Option<KernelChoice>, Failure>,
) -> Result<Option<v1::KernelChoice>, Failure> {
    let kind = match text {
        "" => return Ok(None),
        "ideal" => Kind::Ideal(Default::default()),
        "active" => Kind::Active(Default::default()),
        name if name.contains('/') => Kind::Version(name.to_owned()),
        text => match text.parse::<u32>() {
            Err(_) => Kind::Alias(text.to_owned()),
            Ok(version) => {
                let kernel = kernel().await?.ok_or_else(|| {
                    Failure::Usage(format!(
                        "--kernel is {version}, but each of several wavelengths and distances has its own kernel, and \
                         its own version {version}: write ideal, active or an alias, which each kernel can have \
                         (lightpath kernel alias --help)"
                    ))
                })?;
                Kind::Version(kernel.version_name(session, Some(version)).await?)
            }
        },
    };
    Ok(Some(kind.into()))
}
