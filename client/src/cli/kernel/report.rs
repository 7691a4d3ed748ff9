//! `lightpath kernel report`

use crate::cli::failure::Failure;
use crate::cli::kernel_choice::KernelChoice;
use crate::cli::session::Session;
use crate::cli::submission::Submission;
use clap::Args;
use lightpath::v1::{self, job_spec};
use lightpath::{names, report_result};
use std::path::PathBuf;

/// Write what a version is like as one HTML file: pictures, figures and tables.
///
/// The kernel and its ratio to the ideal one, aberrations, point spread and contrast, source, phase response, photographs beside
/// predictions, what the data could not tell, and how it differs from other versions.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath kernel report --display lab-2 --distance 150mm --version 3 \\
      -o report.html --arrays report.npz --figures report/")]
pub(crate) struct Report {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Which version [default: the newest]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    version: Option<u32>,

    /// Where the report goes
    #[arg(short = 'o', value_name = "FILE.html")]
    html: PathBuf,

    /// Where its numbers go, as arrays of NumPy by name
    #[arg(long, value_name = "FILE.npz")]
    arrays: Option<PathBuf>,

    /// A folder for its pictures, PNG and SVG; made where it is missing
    #[arg(long, value_name = "FOLDER")]
    figures: Option<PathBuf>,

    #[command(flatten)]
    submission: Submission,
}

impl Report {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let kernel = self.kernel.name(session).await?;
        let version = match self.version {
            Some(version) => version,
            None => session.client.get_kernel(v1::GetKernelRequest { name: kernel.clone() }).await?.latest_version,
        };
        let kind =
            job_spec::Kind::ReportKernel(v1::ReportKernel { kernel_version: names::kernel_version(&kernel, version) });
        let job = self.submission.submit_and_wait(session, kind).await?;
        let report = report_result(&job)?;
        session.client.download_to(&report.html, &self.html).await?;
        let mut written = vec![self.html.display().to_string()];
        if let Some(path) = &self.arrays {
            session.client.download_to(&report.arrays, path).await?;
            written.push(path.display().to_string());
        }
        if let Some(folder) = &self.figures {
            let refused = |source| lightpath::Error::File { action: "make", path: folder.clone(), source };
            std::fs::create_dir_all(folder).map_err(refused)?;
            for figure in &report.figures {
                session.client.download_to(&figure.artifact, &folder.join(&figure.name)).await?;
            }
            written.push(format!("{} pictures in {}", report.figures.len(), folder.display()));
        }
        session.print(report, |_| format!("report of {kernel}/versions/{version}: {}", written.join(", ")))
    }
}
