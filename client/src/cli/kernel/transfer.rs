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
    #[arg(long, default_value = "safetensors")]
    format: Format,

    /// The file to write
    #[arg(short = 'o', value_name = "FILE")]
    path: PathBuf,
}

/// The form of a kernel's file.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// All of the model by name, with its optics in the header
    Safetensors,
    /// All of a smooth, display or varying model in some hundred bytes, for firmware
    Compact,
    /// A PyTorch tensor as the paper has it: amplitude and phase of the inner half, float32 1 x 2 x rows x columns
    Pt,
    /// The same as a NumPy array
    Npy,
    /// Every array of the model: transfer function, source, response, photometry
    Npz,
    /// The transfer function alone as a NumPy array, complex64, on the padded spectrum, zero frequency in the middle
    Complex64,
    /// The same as real and imaginary parts in float16
    F16,
}

impl Format {
    fn wire(self) -> v1::KernelFormat {
        match self {
            Self::Safetensors => v1::KernelFormat::Safetensors,
            Self::Compact => v1::KernelFormat::Compact,
            Self::Pt => v1::KernelFormat::Pt,
            Self::Npy => v1::KernelFormat::Npy,
            Self::Npz => v1::KernelFormat::Npz,
            Self::Complex64 => v1::KernelFormat::Complex64,
            Self::F16 => v1::KernelFormat::F16,
        }
    }
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
    let format = file.format.wire();
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
