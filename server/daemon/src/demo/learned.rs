//! Learning kernels in the demo.

use super::args::{DATASET, DemoArgs};
use super::console::Console;
use super::demo_client::DemoClient;
use super::remaining::Part;
use anyhow::Context as _;
use lightpath::Words as _;
use lightpath::{names, v1};

/// A learned kernel.
pub(super) struct Learned {
    pub(super) name: &'static str,
    /// Resource name of the version.
    pub(super) version: String,
    pub(super) metrics: v1::KernelMetrics,
    pub(super) loss_history: Vec<f64>,
    pub(super) seconds: f64,
}

/// Learns a kernel of each model. The display model comes first, so it becomes version 1.
pub(super) async fn learn(args: &DemoArgs, client: &DemoClient, console: &mut Console) -> anyhow::Result<Vec<Learned>> {
    let mut learned = Vec::new();
    for &model in &args.models {
        let name = model.word();
        console.step(&format!("Learn the display from its photographs: model {name}"))?;
        let started = std::time::Instant::now();
        let result = client.learn(DATASET, model, args.seed, &console.bar(Part::Learn(model))).await?;
        let kernel = result.kernels.first().context("the result contains no kernel")?;
        let metrics = kernel.metrics.clone().context("the result contains no metrics of the kernel")?;
        let version = kernel.kernel_version.clone();
        console.print_result(format!(
            "version {} · training loss {:.6} · held-out loss {:.6}, through the ideal kernel {:.6}",
            names::id(&version),
            metrics.train_loss,
            metrics.test_loss,
            metrics.ideal_test_loss
        ))?;
        let (loss_history, seconds) = (result.loss_history, started.elapsed().as_secs_f64());
        learned.push(Learned { name, version, metrics, loss_history, seconds });
    }
    Ok(learned)
}
