//! `lightpath kernel fetch`, `export` and `import`.

use super::show::version_facts;
use crate::cli::arguments::Optics;
use crate::cli::failure::Failure;
use crate::cli::kernel_choice::KernelChoice;
use crate::cli::session::Session;
use crate::cli::show;
use clap::{Args, ValueEnum};
use lightpath::{names, v1};
use std::path::{Path, PathBuf};

/// Write the active version (or another one) as a safetensors file, checked against its SHA-256.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath kernel fetch --display lab-2 --distance 150mm -o kernel.safetensors")]
pub(crate) struct Fetch {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Which version [default: the active one]
    #[arg(long, value_name = "N")]
    version: Option<u32>,

    #[command(flatten)]
    file: KernelFile,
}

/// Write a certain version as a safetensors file, checked against its SHA-256.
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
    #[arg(long, default_value = "safetensors")]
    format: Format,

    /// The file to write
    #[arg(short = 'o', value_name = "FILE")]
    path: PathBuf,
}

/// The form of a kernel's file.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// The parameters by name, with their optics in the header.
    Safetensors,
}

/// Store a safetensors file, as `kernel fetch` writes it, as a kernel's next version.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath kernel import --display lab-2 --distance 150mm kernel.safetensors")]
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
    let Format::Safetensors = file.format;
    let path: &Path = &file.path;
    let name = kernel.name(session).await?;
    let version = session.client.fetch_kernel_to(&name, version, path).await?;
    session.print(&version, |version| {
        let size = show::bytes(version.size_bytes);
        format!("wrote {}, {size}, to {}", version.name, path.display())
    })
}
