//! Kernels that the demo learns.

use super::args::{DATASET, DemoArgs, model_name};
use super::lab::Lab;
use super::story::Story;
use anyhow::Context as _;
use lightpath::v1;

/// A kernel that was learned.
pub(super) struct Learned {
    pub(super) name: &'static str,
    pub(super) version: u32,
    pub(super) result: v1::LearnResult,
    pub(super) seconds: f64,
}

/// Learns a kernel of each model; the display model first: it becomes version 1.
pub(super) async fn learn(args: &DemoArgs, lab: &Lab, story: &mut Story) -> anyhow::Result<Vec<Learned>> {
    let mut learned = Vec::new();
    for &model in &args.models {
        let name = model_name(model);
        story.step(&format!("Learn the display from its photographs: model {name}"))?;
        let started = std::time::Instant::now();
        let result = lab.learn(DATASET, model, args.seed, &mut story.bar("learn")).await?;
        let metrics = result.metrics.context("the server left out the kernel's metrics")?;
        let version = result.kernel_version.rsplit('/').next().and_then(|number| number.parse().ok());
        let version = version.with_context(|| format!("{:?} is no kernel version", result.kernel_version))?;
        story.tell(format!(
            "version {version} · training loss {:.6} · held-out loss {:.6}, through the ideal kernel {:.6}",
            metrics.train_loss, metrics.test_loss, metrics.ideal_test_loss
        ))?;
        learned.push(Learned { name, version, result, seconds: started.elapsed().as_secs_f64() });
    }
    Ok(learned)
}

impl Learned {
    pub(super) fn metrics(&self) -> v1::KernelMetrics {
        self.result.metrics.unwrap_or_default()
    }
}
