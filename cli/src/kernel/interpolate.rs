//! The command `lightpath kernel interpolate`.

use super::show::version_facts;
use crate::arguments::Optics;
use crate::failure::Failure;
use crate::session::Session;
use clap::Args;
use lightpath::{names, v1};

/// Interpolate a kernel at a distance between photographed distances.
///
/// First learn several distances together: kernel learn with several --dataset options. The model describes the display
/// as a function of the distance. The interpolated kernel becomes the next version at the new distance, marked as
/// interpolated. The server refuses photographed distances and distances outside their range.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath kernel learn --dataset near --dataset middle --dataset far --wait
  lightpath kernel interpolate --display lab-2 --distance 170mm
  lightpath kernel promote --display lab-2 --distance 170mm --version 1")]
pub(crate) struct Interpolate {
    #[command(flatten)]
    optics: Optics,
}

impl Interpolate {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let request = v1::InterpolateKernelRequest {
            display: names::display(&self.optics.display),
            wavelength_m: self.optics.wavelength_m(),
            place: Some(v1::Place::at_m(self.optics.distance)),
            ..Default::default()
        };
        session.print(&session.client.interpolate_kernel(request).await?, version_facts)
    }
}
