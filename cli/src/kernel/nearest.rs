//! The command `lightpath kernel nearest`.

use crate::arguments::Optics;
use crate::failure::Failure;
use crate::missing;
use crate::session::Session;
use crate::show;
use crate::table::Table;
use clap::Args;
use lightpath::{names, units, v1};

/// Find the active kernels whose distances are nearest to a distance.
#[derive(Debug, Args)]
pub(crate) struct Nearest {
    #[command(flatten)]
    optics: Optics,
}

impl Nearest {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let distance_m = self.optics.distance;
        let request = v1::FindNearestKernelsRequest {
            display: names::display(&self.optics.display),
            wavelength_m: self.optics.wavelength_m(),
            place: Some(v1::Place::at_m(distance_m)),
        };
        let display = request.display.clone();
        let found = session.client.find_nearest_kernels(request).await?;
        if found.kernels.is_empty() {
            missing::check_display(session, &display).await?;
        }
        session.print_list(
            &found,
            |found| &found.kernels,
            |found| {
                let mut table = Table::new("kernel|>active|>away|from?");
                for kernel in &found.kernels {
                    table.row([
                        kernel.name.clone(),
                        show::version_or_dash(kernel.active_version),
                        kernel
                            .place
                            .as_ref()
                            .and_then(v1::Place::distance_m)
                            .map_or_else(|| "–".to_owned(), |there| units::show_m(there - distance_m)),
                        if kernel.interpolated { "interpolated" } else { "" }.to_owned(),
                    ]);
                }
                let hint = match found.can_be_interpolated {
                    true => "a kernel for this distance can be interpolated: lightpath kernel interpolate --help\n",
                    false => "",
                };
                table.text_or("no kernel of the display has an active version") + hint
            },
        )
    }
}
