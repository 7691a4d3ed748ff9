//! The command `lightpath kernel compare`.

use crate::destination::{self, Destination, PNG};
use crate::failure::Failure;
use crate::kernel_choice::KernelChoice;
use crate::metrics_text;
use crate::session::Session;
use crate::show;
use crate::table::{Facts, Table};
use clap::Args;
use lightpath::{Words as _, names, v1};
use std::path::PathBuf;

const PICTURE: Destination = Destination { option: "-o", suffix: ".png", formats: &[PNG] };

/// Compare two versions of a kernel: measurements, parameters, and how far transfer function and source differ.
///
/// The pictures show the ratio of the transfer functions over the modulator's band, and the light of both versions on
/// the modulator.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath kernel compare --display lab-2 --distance 150mm --version 3 \\
      --with 4 -o difference.png")]
pub(crate) struct Compare {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Compare this version
    #[arg(long, value_name = "N")]
    version: u32,

    /// Compare it with this version
    #[arg(long, value_name = "N")]
    with: u32,

    /// Write the pictures to this file
    #[arg(short = 'o', value_name = "FILE.png")]
    picture: Option<PathBuf>,
}

impl Compare {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let picture_file = self.picture.as_ref().map(|path| PICTURE.file(&session.stdout, path)).transpose()?;
        let kernel = self.kernel.name(session).await?;
        let [first, second] = [self.version, self.with].map(|version| names::kernel_version(&kernel, version));
        let request = v1::CompareKernelVersionsRequest { first, second };
        let mut found = session.client.compare_kernel_versions(request).await?;
        let picture = std::mem::take(&mut found.picture_png);
        if let Some(path) = &picture_file {
            destination::write(&picture, path)?;
        }
        session.print(&found, text)?;
        match &picture_file {
            Some(path) => session.print_text(&format!("wrote {}", destination::shown(path))),
            None => Ok(()),
        }
    }
}

fn text(found: &v1::KernelComparison) -> String {
    let versions = [&found.first, &found.second].map(|version| version.clone().unwrap_or_default());
    let mut table = Table::new(&format!("|>{}|>{}", versions[0].version, versions[1].version));
    let mut row = |name: &str, of: &dyn Fn(&v1::KernelVersion) -> String| {
        table.row([name.to_owned(), of(&versions[0]), of(&versions[1])]);
    };
    let measured = |version: &v1::KernelVersion| version.metrics.clone().filter(|metrics| metrics.test_pairs > 0);
    row("model", &|version| version.model().word().to_owned());
    row("test pairs", &|version| version.metrics.as_ref().map_or(0, |metrics| metrics.test_pairs).to_string());
    row("held-out loss", &|version| {
        measured(version).map_or_else(|| "–".to_owned(), |metrics| show::loss(metrics.test_loss))
    });
    row("relative to the ideal kernel", &|version| {
        let relative = measured(version).map(|metrics| metrics.test_loss / metrics.ideal_test_loss);
        relative.map_or_else(|| "–".to_owned(), |relative| format!("{relative:.4}"))
    });
    row("size of the file", &|version| show::bytes(version.size_bytes));
    for v1::kernel_comparison::PartComparison { title, first, second, .. } in &found.parts {
        let text = |part: &Option<v1::Part>| show::or_dash(part.as_ref().map_or("", |part| &part.text));
        table.row([title.clone(), text(first), text(second)]);
    }
    let mut facts = Facts::default();
    let difference = |relative: f64, phase_rad: f64| format!("{:.2} %, phase {phase_rad:.3} rad rms", 100.0 * relative);
    facts.add("transfer function differs by", difference(found.transfer_difference, found.transfer_phase_rad));
    facts.add("light on the modulator by", difference(found.source_difference, found.source_phase_rad));
    let parts = versions.iter().filter_map(|version| {
        let parts = metrics_text::parts(version.metrics.as_ref()?);
        (!parts.is_empty()).then(|| format!("\nversion {}:\n{parts}", version.version))
    });
    format!("{}\n{}{}", table.text(), facts.text(), parts.collect::<String>())
}
