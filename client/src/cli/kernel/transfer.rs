//! The commands `lightpath kernel fetch`, `export` and `import`.

use super::show::version_facts;
use crate::cli::arguments::Optics;
use crate::cli::failure::Failure;
use crate::cli::kernel_choice::KernelChoice;
use crate::cli::session::{Session, print_note};
use crate::cli::show;
use crate::cli::words::WordParser;
use clap::Args;
use lightpath::{Words as _, names, v1};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Download a kernel to a file, checked against its SHA-256 digest; by default the active version.
///
/// The formats safetensors, npz and bundle hold the whole kernel, compact holds a whole smooth one. A bundle also holds
/// the measurements and the lineage of the version, for another server. The other formats hold only the transfer
/// function. A warning on stderr names what is lost, before the file is written.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath kernel fetch --display lab-2 --distance 150mm -o kernel.safetensors
  lightpath kernel fetch --display lab-2 --distance 150mm --format compact \\
      -o kernel.lpk
  lightpath kernel fetch --display lab-2 --distance 150mm --format bundle \\
      -o kernel.bundle")]
pub(crate) struct Fetch {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Download this version [default: the active version]
    #[arg(long, value_name = "N")]
    version: Option<u32>,

    #[command(flatten)]
    file: KernelFile,
}

/// Download a given version of a kernel to a file, checked against its SHA-256 digest.
#[derive(Debug, Args)]
pub(crate) struct Export {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Download this version
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    version: u32,

    #[command(flatten)]
    file: KernelFile,
}

/// Format and path of a downloaded kernel.
#[derive(Debug, Args)]
struct KernelFile {
    /// Choose the format of the file
    #[arg(long, default_value = "safetensors", value_parser = WordParser::<v1::KernelFormat>::new())]
    format: v1::KernelFormat,

    /// Write the kernel to this file
    #[arg(short = 'o', value_name = "FILE")]
    path: PathBuf,
}

/// Store a file as a kernel's next version.
///
/// The file may be one that kernel fetch wrote in any format, or a bare transfer function as .pt, .npy, .npz or
/// safetensors. A bare transfer function is one of: amplitude and phase, 1 x 2 x rows x columns, as in the paper; real
/// and imaginary parts, rows x columns x 2; complex numbers, rows x columns. Zero frequency is in the middle. Rows and
/// columns are those of the display or of the padded spectrum. Nothing in a .pt file is executed. The new version is
/// without what the file does not hold, and its note names that. If the array transfer of an .npz file was changed, the
/// transfer function is taken from it.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath kernel import --display lab-2 --distance 150mm kernel.safetensors
  lightpath kernel import --display lab-2 --distance 150mm papers/kernel.pt")]
pub(crate) struct Import {
    #[command(flatten)]
    optics: Optics,

    /// Import this file
    #[arg(value_name = "FILE")]
    path: PathBuf,

    /// Accept a file that names another display
    #[arg(long)]
    from_another_display: bool,
}

impl Fetch {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        write(session, &self.kernel, self.version.unwrap_or(0), &self.file).await
    }
}

impl Export {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        write(session, &self.kernel, self.version, &self.file).await
    }
}

impl Import {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let request = v1::ImportKernelRequest {
            display: names::display(&self.optics.display),
            wavelength_m: self.optics.wavelength_m(),
            distance_m: self.optics.distance,
            artifact: session.client.upload_file(&self.path).await?,
            from_another_display: self.from_another_display,
        };
        session.print(&session.client.import_kernel(request).await?, version_facts)
    }
}

/// A downloaded version. In JSON it is the version's message with one more field, `file`.
#[derive(Debug, Serialize)]
struct Fetched {
    #[serde(flatten)]
    version: v1::KernelVersion,
    /// The file in a format other than safetensors.
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<v1::KernelFile>,
}

/// Downloads a kernel version to a file and prints its size and deviation. Prints what the format loses before the file
/// is put in place. Version 0 stands for the active version.
async fn write(session: &Session, kernel: &KernelChoice, version: u32, file: &KernelFile) -> Result<(), Failure> {
    let path: &Path = &file.path;
    let name = kernel.name(session).await?;
    let warn = |file: &v1::KernelFile| {
        if let Some(warning) = warning(file) {
            print_note(&warning);
        }
    };
    let (version, file) = session.client.fetch_kernel_to_as(&name, version, file.format, path, warn).await?;
    session.print(&Fetched { version, file }, |Fetched { version, file }| {
        let size = show::bytes(file.as_ref().map_or(version.size_bytes, |file| file.size_bytes));
        let deviation = file.as_ref().map_or_else(String::new, |file| match file.relative_error {
            0.0 => "; the transfer function is exactly that of the version".to_owned(),
            error => format!(
                "; the transfer function differs from that of the version by {error:.1e} (relative, over the band)"
            ),
        });
        format!("wrote {}, {size}, to {}{deviation}", version.name, path.display())
    })
}

/// A warning for a file that lacks parts of the kernel; `None` if only digits are lost.
fn warning(file: &v1::KernelFile) -> Option<String> {
    let lost = file.losses().filter(|loss| *loss != v1::KernelLoss::Precision);
    let lost: Vec<String> = lost.map(|loss| loss.word().replace('-', " ")).collect();
    let change = match file.relative_error {
        0.0 => "H stays the same".to_owned(),
        error if error < 0.01 => format!("H changes by {error:.1e}"),
        error => format!("H changes by {:.0} %", 100.0 * error),
    };
    let format = file.format().word();
    (!lost.is_empty())
        .then(|| format!("warning: {format} does not hold the whole kernel; lost: {}; {change}", lost.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use v1::KernelLoss::{OuterSpectrum, PhaseResponse, Precision, Source};

    fn file(format: v1::KernelFormat, losses: &[v1::KernelLoss], relative_error: f64) -> v1::KernelFile {
        let losses = losses.iter().map(|&loss| loss.into()).collect();
        v1::KernelFile { format: format.into(), losses, relative_error, ..Default::default() }
    }

    #[test]
    fn lost_parts_are_named_in_a_warning_but_lost_digits_are_not() {
        let pt = file(v1::KernelFormat::Pt, &[Source, PhaseResponse, OuterSpectrum, Precision], 0.8123);
        assert_eq!(
            warning(&pt).unwrap(),
            "warning: pt does not hold the whole kernel; lost: source, phase response, outer spectrum; H changes by 81 %"
        );
        let bare = file(v1::KernelFormat::Complex64, &[Source], 2e-8);
        assert!(warning(&bare).unwrap().ends_with("lost: source; H changes by 2.0e-8"));
        assert_eq!(warning(&file(v1::KernelFormat::Compact, &[Precision], 1e-7)), None);
        assert_eq!(warning(&file(v1::KernelFormat::Npz, &[], 0.0)), None);
    }

    #[test]
    fn json_is_the_version_with_its_file() {
        let version = v1::KernelVersion { version: 3, ..Default::default() };
        let json = |file| serde_json::to_value(Fetched { version: version.clone(), file }).unwrap();
        let whole = json(Some(file(v1::KernelFormat::Pt, &[Source], 0.5)));
        assert_eq!((&whole["version"], &whole["file"]["losses"][0]), (&3.into(), &"KERNEL_LOSS_SOURCE".into()));
        assert!(json(None).get("file").is_none());
    }
}
