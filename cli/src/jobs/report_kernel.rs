//! Jobs that report on a kernel version, and the command `lightpath kernel report`.

use crate::destination::{self, Destination};
use crate::failure::Failure;
use crate::jobs::JobKind;
use crate::jobs::submission::Submission;
use crate::kernel_choice::KernelChoice;
use crate::session::Session;
use crate::table::Facts;
use clap::Args;
use lightpath::report_result;
use lightpath::v1::{Job, ReportKernel, job_spec};
use std::path::PathBuf;

const HTML: Destination = Destination { option: "-o", suffix: ".html", formats: &[("html", "a page with pictures")] };
const ARRAYS: Destination = Destination { option: "--arrays", suffix: ".npz", formats: &[("npz", "NumPy arrays")] };

/// Write a report of a kernel version as one HTML file with pictures, figures and tables.
///
/// The report shows the kernel and its ratio to the ideal kernel, aberrations, point spread and contrast, the source,
/// the phase response, photographs beside predictions, what the data do not determine, and differences to other
/// versions.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath kernel report --display lab-2 --distance 150mm --version 3 \\
      -o report.html --arrays report.npz --figures report/")]
pub(crate) struct Report {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Report on this version [default: the newest version]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    version: Option<u32>,

    /// Write the report to this file
    #[arg(short = 'o', value_name = "FILE.html")]
    html: PathBuf,

    /// Write the numbers of the report to this file, as named NumPy arrays
    #[arg(long, value_name = "FILE.npz")]
    arrays: Option<PathBuf>,

    /// Write the pictures of the report (PNG and SVG) to this folder; a missing folder is created
    #[arg(long, value_name = "FOLDER")]
    figures: Option<PathBuf>,

    #[command(flatten)]
    submission: Submission,
}

impl Report {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        let html = HTML.file(&session.stdout, &self.html)?;
        let arrays = self.arrays.as_ref().map(|path| ARRAYS.file(&session.stdout, path)).transpose()?;
        if let Some(folder) = &self.figures {
            destination::create_folder("--figures", folder)?;
        }
        let kernel_version = self.kernel.version_name(session, self.version).await?;
        let kind = job_spec::Kind::ReportKernel(ReportKernel { kernel_version: kernel_version.clone() });
        let job = self.submission.submit_and_wait(session, kind).await?;
        let report = report_result(&job)?;
        destination::save(session, &report.html, &html).await?;
        let mut written = vec![destination::shown(&html)];
        if let Some(path) = &arrays {
            destination::save(session, &report.arrays, path).await?;
            written.push(destination::shown(path));
        }
        if let Some(folder) = &self.figures {
            for figure in &report.figures {
                session.client.download_to(&figure.artifact, &folder.join(&figure.name)).await?;
            }
            written.push(format!("{} pictures in {}", report.figures.len(), folder.display()));
        }
        session.print(report, |_| format!("report of {kernel_version}: {}", written.join(", ")))
    }
}

impl JobKind for ReportKernel {
    fn title(&self) -> (&'static str, &str) {
        ("report kernel", self.kernel_version.trim_start_matches("displays/"))
    }

    fn spec_facts(&self, _: &Job, facts: &mut Facts) {
        facts.add("kernel", &self.kernel_version);
    }

    fn result_facts(&self, job: &Job, facts: &mut Facts) -> lightpath::Result<String> {
        let result = report_result(job)?;
        facts.add("report", &result.html);
        facts.add("arrays", &result.arrays);
        facts.add("pictures", result.figures.len().to_string());
        Ok(String::new())
    }
}
