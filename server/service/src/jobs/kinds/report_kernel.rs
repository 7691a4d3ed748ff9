//! Report jobs: the report of a kernel version.

use super::Kind;
use crate::error::Result;
use crate::jobs::Jobs;
use crate::jobs::estimate::learned_region_px;
use lightpath_domain::job::estimate::Need;
use lightpath_domain::job::kinds::report_kernel::{self, ReportInputs};
use lightpath_domain::job::{OTHER_VERSIONS_MAX, ReportKernel};
use lightpath_optics::Detector;

impl Kind for ReportKernel {
    const ADVICE: &'static str = "use a smaller display";

    async fn need(&self, jobs: &Jobs, _: u64) -> Result<Need> {
        let (display, _) = jobs.store.display(&self.kernel.display).await?;
        let version = jobs.store.kernel_version(&self.kernel, self.version).await?;
        let kernel = jobs.kernel_size(&display, &self.kernel, Some(self.version), Detector::Pixel, None).await?;
        let others = jobs.store.kernel_versions(&self.kernel, None, OTHER_VERSIONS_MAX + 1).await?;
        let sizes = || others.iter().map(|other| other.content.size_bytes);
        let (other_file_bytes, other_files_bytes) = (sizes().max().unwrap_or(0), sizes().sum());
        let pairs = jobs.learned_pairs(&version, &display).await?;
        let (model, region_px) = (version.content.model, learned_region_px(&version, &kernel));
        Ok(report_kernel::need(&ReportInputs { kernel, model, other_file_bytes, other_files_bytes, pairs, region_px }))
    }
}
