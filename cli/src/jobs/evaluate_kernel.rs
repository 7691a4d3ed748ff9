//! Jobs that evaluate a kernel, and the command `lightpath kernel evaluate`.

use crate::arguments::region;
use crate::failure::Failure;
use crate::jobs::JobKind;
use crate::jobs::submission::Submission;
use crate::kernel_choice::{of_dataset, used};
use crate::session::Session;
use crate::table::{Facts, Table};
use crate::{propagation_text, show};
use clap::Args;
use lightpath::v1::{self, EvaluateKernel, Job, job_spec};
use lightpath::{Words as _, evaluate_result, names};

/// Measure how well a kernel predicts the photographs of a dataset.
#[derive(Debug, Args)]
pub(crate) struct Evaluate {
    /// Use this finalized dataset
    #[arg(long, value_name = "NAME")]
    dataset: String,

    /// Evaluate this kernel for the dataset's display, wavelength and distance: active, ideal, the number
    /// or name of a version, or an alias
    #[arg(long, value_name = "KERNEL", default_value = "active")]
    kernel: String,

    /// Compare photographs only in this region: x,y,width,height in pixels [default: the middle 80 % of each axis]
    #[arg(long, value_name = "X,Y,W,H", value_parser = region)]
    region: Option<v1::Region>,

    /// Wait until the job has ended, with a progress bar
    #[arg(long)]
    wait: bool,

    #[command(flatten)]
    submission: Submission,
}

impl Evaluate {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        let dataset = names::dataset(&self.dataset);
        let kernel = used(session, &self.kernel, async || of_dataset(session, &dataset).await).await?;
        let kind = job_spec::Kind::EvaluateKernel(EvaluateKernel { dataset, kernel, region: self.region });
        self.submission.submit_and_print(session, kind, self.wait).await
    }
}

impl JobKind for EvaluateKernel {
    fn title(&self) -> (&'static str, &str) {
        ("evaluate kernel", names::id(&self.dataset))
    }

    fn spec_facts(&self, job: &Job, facts: &mut Facts) {
        facts.add("dataset", names::id(&self.dataset));
        facts.add("kernel", show::used_kernels(&job.kernels));
    }

    fn result_facts(&self, job: &Job, facts: &mut Facts) -> lightpath::Result<String> {
        let result = evaluate_result(job)?;
        propagation_text::add(result.propagation.as_ref(), facts);
        let mut table = Table::new("pair|split|>loss|>full frame?");
        for pair in &result.pairs {
            let split = pair.split().word();
            table.row([pair.pair.clone(), split.to_owned(), show::loss(pair.loss), show::loss(pair.loss_full_frame)]);
        }
        Ok(format!("\n{}", table.text()))
    }
}
