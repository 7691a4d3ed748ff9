//! Arguments that select a kernel.

use super::arguments::{distance, wavelength};
use super::failure::Failure;
use super::session::Session;
use super::show;
use clap::Args;
use lightpath::{names, v1};

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

    /// Use the kernel of this wavelength in vacuum, for example 515nm [default: the display's only wavelength]
    #[arg(long, value_name = "LENGTH", value_parser = wavelength, allow_hyphen_values = true, requires = "display")]
    wavelength: Option<f64>,
}

impl KernelChoice {
    /// Returns the kernel's name, `displays/{id}/kernels/{k}`. Without --wavelength it asks the server for the
    /// display's only one.
    pub(crate) async fn name(&self, session: &Session) -> Result<String, Failure> {
        let (display, distance_m) = match (&self.kernel, &self.display, self.distance) {
            (Some(name), _, _) => return Ok(name.clone()),
            (None, Some(display), Some(distance_m)) => (display, distance_m),
            _ => return Err(Failure::Usage("give the name of a kernel, or --display and --distance".to_owned())),
        };
        if let Some(wavelength_m) = self.wavelength {
            return Ok(names::kernel(display, wavelength_m, distance_m));
        }
        let declared = session.client.get_display(v1::GetDisplayRequest { name: names::display(display) }).await?;
        match declared.wavelengths_m.as_slice() {
            &[wavelength_m] => Ok(names::kernel(display, wavelength_m, distance_m)),
            several => {
                let several = show::lengths(several.iter().copied());
                Err(Failure::Usage(format!(
                    "display {display} has several wavelengths ({several}): choose one with --wavelength"
                )))
            }
        }
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
