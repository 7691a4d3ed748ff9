//! `lightpath kernel fetch`, `export` and `import`.

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

/// Write the active version (or another one) as a file, checked against its SHA-256.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath kernel fetch --display lab-2 --distance 150mm -o kernel.safetensors
  lightpath kernel fetch --display lab-2 --distance 150mm --format compact \\
      -o kernel.lpk")]
pub(crate) struct Fetch {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Which version [default: the active one]
    #[arg(long, value_name = "N")]
    version: Option<u32>,

    #[command(flatten)]
    file: KernelFile,
}

/// Write a certain version as a file, checked against its SHA-256.
#[derive(Debug, Args)]
pub(crate) struct Export {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Which version
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    version: u32,

    #[command(flatten)]
    file: KernelFile,
}

/// Where a kernel goes.
#[derive(Debug, Args)]
struct KernelFile {
    /// The form of the file
    #[arg(long, default_value = "safetensors", value_parser = WordParser::<v1::KernelFormat>::new())]
    format: v1::KernelFormat,

    /// The file to write
    #[arg(short = 'o', value_name = "FILE")]
    path: PathBuf,
}

/// Store a file as a kernel's next version.
///
/// What `kernel fetch` wrote in any form; or the transfer function alone as .pt, .npy, .npz or safetensors: amplitude and phase,
/// 1 x 2 x rows x columns as the paper has it, real and imaginary parts, rows x columns x 2, or complex, rows x columns; zero
/// frequency in the middle, of the display's size or the padded spectrum's. Nothing in a .pt file is executed.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath kernel import --display lab-2 --distance 150mm kernel.safetensors
  lightpath kernel import --display lab-2 --distance 150mm papers/kernel.pt")]
pub(crate) struct Import {
    #[command(flatten)]
    optics: Optics,

    /// The file
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

async fn write(session: &Session, kernel: &KernelChoice, version: u32, file: &KernelFile) -> Result<(), Failure> {
    let path: &Path = &file.path;
    let name = kernel.name(session).await?;
    let format = file.format;
    let (version, made) = session.client.fetch_kernel_to_as(&name, version, format, path).await?;
    session.print(&version, |version| {
        let size = show::bytes(made.as_ref().map_or(version.size_bytes, |made| made.size_bytes));
        let cost = made.map_or_else(String::new, |made| match made.relative_error {
            0.0 => "; the transfer function is exactly the same".to_owned(),
            error => format!("; the transfer function differs by {error:.1e} (relative, over the band)"),
        });
        format!("wrote {}, {size}, to {}{cost}", version.name, path.display())
    })
}
