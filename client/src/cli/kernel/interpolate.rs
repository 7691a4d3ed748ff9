//! `lightpath kernel interpolate`

use super::show::version_facts;
use crate::cli::arguments::Optics;
use crate::cli::failure::Failure;
use crate::cli::session::Session;
use clap::Args;
use lightpath::{names, v1};

/// Make the kernel of a distance between photographed ones.
///
/// Photographs of several distances that were learned together (kernel learn with --dataset given several times) give the display as
/// a function of the distance. What that says of a distance between them becomes the next version there, marked as interpolated.
/// Beyond the photographed distances nothing is known, and nothing is made.
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
            distance_m: self.optics.distance,
        };
        session.print(&session.client.interpolate_kernel(request).await?, version_facts)
    }
}
