//! The command `lightpath dataset import`.

use super::add::{Defaults, add_pairs};
use super::layouts::{self, Layout};
use crate::failure::Failure;
use crate::session::{Session, print_note};
use clap::Args;
use std::path::PathBuf;

/// Add the pairs of a published dataset, whose folders have a known layout.
///
/// The dataset must exist and be open. The same pair again changes nothing, so an interrupted import can be repeated.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  The dataset of Learned holographic light transport
    lightpath display create pluto --resolution 1920x1080 --pixel-pitch 8um \\
        --wavelength 515nm
    lightpath dataset create paper --display pluto --distance 150mm
    lightpath dataset import paper --layout realistic-holography \\
        div2k_holograms div2k_warped
    lightpath dataset finalize paper
    lightpath kernel learn --dataset paper --wait

  One plane of Neural 3D holography; its level v is the phase pi - 2 pi v / 255
    seq 0 255 | awk '{print 3.141593 - 6.283185 * $1 / 255}' > inverted.txt
    lightpath display create nh3d --resolution 1920x1080 --pixel-pitch 8um \\
        --wavelength 520nm --phase-response inverted.txt
    lightpath dataset create green-2 --display nh3d --distance 100mm
    lightpath dataset import green-2 --layout neural-holography --plane 2 green")]
pub(crate) struct Import {
    /// Name of the dataset
    name: String,

    /// Choose how the holograms and the photographs are arranged in folders
    #[arg(long)]
    layout: Layout,

    /// Read these folders: HOLOGRAMS and PHOTOGRAPHS for realistic-holography, one folder for neural-holography
    #[arg(required = true, num_args = 1..=2, value_name = "FOLDER")]
    folders: Vec<PathBuf>,

    /// Take the photographs of the plane with this index, which the names of their files end with; neural-holography
    /// only
    #[arg(long, value_name = "INDEX")]
    plane: Option<u32>,

    /// Import only the first pairs, at most this many of each split [default: all]
    #[arg(long, value_name = "N")]
    pairs: Option<usize>,

    #[command(flatten)]
    defaults: Defaults,
}

impl Import {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let mut entries = match (self.layout, &self.folders[..], self.plane) {
            (Layout::RealisticHolography, [holograms, photographs], None) => {
                layouts::realistic_holography(holograms, photographs)?
            }
            (Layout::NeuralHolography, [folder], Some(plane)) => layouts::neural_holography(folder, plane)?,
            (Layout::RealisticHolography, ..) => {
                let usage =
                    "--layout realistic-holography needs two folders, HOLOGRAMS and PHOTOGRAPHS, and no --plane";
                return Err(Failure::Usage(usage.to_owned()));
            }
            (Layout::NeuralHolography, ..) => {
                return Err(Failure::Usage("--layout neural-holography needs one folder and --plane".to_owned()));
            }
        };
        if let Some(most) = self.pairs {
            let mut counts = std::collections::HashMap::new();
            entries.retain(|entry| {
                let count = counts.entry(entry.split).or_insert(0);
                *count += 1;
                *count <= most
            });
        }
        let entries = entries.into_iter().map(|entry| self.defaults.fill(entry)).collect();
        add_pairs(session, &self.name, entries).await?;
        print_note(&format!("next: lightpath dataset finalize {}", self.name));
        Ok(())
    }
}
