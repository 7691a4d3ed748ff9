//! The commands `lightpath kernel fetch`, `export` and `import`.

use super::show::version_facts;
use crate::cli::arguments::Optics;
use crate::cli::failure::Failure;
use crate::cli::kernel_choice::KernelChoice;
use crate::cli::session::Session;
use crate::cli::show;
use crate::cli::words::WordParser;
use clap::Args;
use lightpath::{names, v1};
use std::path::{Path, PathBuf};

/// Download a kernel to a file, checked against its SHA-256 digest; by default the active version.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath kernel fetch --display lab-2 --distance 150mm -o kernel.safetensors
  lightpath kernel fetch --display lab-2 --distance 150mm --format compact \\
      -o kernel.lpk")]
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
/// columns are those of the display or of the padded spectrum. Nothing in a .pt file is executed.
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
        };
        session.print(&session.client.import_kernel(request).await?, version_facts)
    }
}

/// Downloads a kernel version to a file and prints its size and deviation. Version 0 stands for the active version.
async fn write(session: &Session, kernel: &KernelChoice, version: u32, file: &KernelFile) -> Result<(), Failure> {
    let path: &Path = &file.path;
    let name = kernel.name(session).await?;
    let format = file.format;
    let (version, converted) = session.client.fetch_kernel_to_as(&name, version, format, path).await?;
    session.print(&version, |version| {
        let size = show::bytes(converted.as_ref().map_or(version.size_bytes, |file| file.size_bytes));
        let deviation = converted.map_or_else(String::new, |file| match file.relative_error {
            0.0 => "; the transfer function is exactly that of the version".to_owned(),
            error => format!(
                "; the transfer function differs from that of the version by {error:.1e} (relative, over the band)"
            ),
        });
        format!("wrote {}, {size}, to {}{deviation}", version.name, path.display())
    })
}
