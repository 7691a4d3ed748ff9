//! `lightpathd demo`: all steps of the work with a simulated display, on a real server and with the real client.
//!
//! The demo optimizes holograms of targets, photographs them, learns kernels from the photographs, and optimizes better
//! holograms through the learned kernels. It measures the kernels on held-out targets, for which the learning set has
//! no holograms. It compares them with two references: the ideal kernel, and the display's true transfer function
//! alone.

mod args;
mod console;
mod demo_client;
mod figures;
mod files;
mod held_out;
mod learned;
mod local_server;
mod programs;
mod remaining;
mod report;
mod single_kernel;
mod targets;

pub use args::DemoArgs;

use anyhow::Context as _;
use args::DATASET;
use console::Console;
use demo_client::{DemoClient, HologramRequest, NARROW_RAD, PhotoRequest};
use files::Files;
use held_out::Candidate;
use learned::learn;
use lightpath::{names, v1};
use lightpath_bench::SimulatedBench;
use local_server::LocalServer;
use remaining::Part;
use report::Report;
use std::f64::consts::TAU;
use targets::{Picture, Targets};

/// Imperfections of the demo's display, apart from their seed: a display that needs alignment, with a good camera.
const STRENGTH: f64 = 1.0;
const CAMERA_NOISE: f64 = 0.003;
const MISALIGNMENT_PX: f64 = 0.5;

/// Runs the demo and writes its pictures to the output folder.
///
/// # Errors
///
/// If the folder cannot be used, a picture cannot be read, or a job fails.
pub fn run(args: DemoArgs) -> anyhow::Result<()> {
    let args = args.ordered();
    tokio::runtime::Builder::new_multi_thread().enable_all().build()?.block_on(run_demo(args))
}

async fn run_demo(args: DemoArgs) -> anyhow::Result<()> {
    let mut console = Console::begin(&args)?;
    let targets = targets::load(&args)?;
    let files = Files::create(&args.out)?;

    console.step("Start a server")?;
    let server = LocalServer::start(&files.data_dir()).await?;
    console.print_result(format!("{} · data in {}", server.url(), files.data_dir().display()))?;

    let outcome = learn_and_compare(&args, &server, &files, &targets, &mut console).await;
    server.stop().await?;
    outcome?;
    console.finish(&args, &files)
}

async fn learn_and_compare(
    args: &DemoArgs,
    server: &LocalServer,
    files: &Files,
    targets: &Targets,
    console: &mut Console,
) -> anyhow::Result<()> {
    console.step("Create a simulated display with imperfections")?;
    let bench = SimulatedBench {
        seed: args.seed,
        strength: STRENGTH,
        camera_noise: CAMERA_NOISE,
        misalignment_px: MISALIGNMENT_PX,
        ..SimulatedBench::FAIR
    };
    let client = DemoClient::new(server.url(), args, bench).await?;
    console.print_result(
        "aberrations, apodization, off-centre illumination, a nonlinear phase response, undiffracted light".to_owned(),
    )?;

    photograph_holograms(args, &client, files, targets, console).await?;
    let learned = learn(args, &client, console).await?;

    console.step("Make the learned kernel active")?;
    let first = learned.first().context("no kernel was learned")?;
    client.promote(&first.version).await?;
    let kernel = names::kernel_of(&first.version);
    let (version, kernel) = client.fetch_kernel(kernel, &files.at("kernel.safetensors")).await?;
    let size_kb = version.size_bytes as f64 / 1000.0;
    console.print_result(format!("{} is active · {size_kb:.1} kB in kernel.safetensors", version.name))?;
    let simulated = single_kernel::bench(&client.setup()?, bench)?;
    let true_kernel = client.import(single_kernel::file(&simulated)?).await?;

    let mut candidates = vec![Candidate::new("ideal", None)];
    candidates.extend(learned.iter().map(|learned| Candidate::new(learned.name, Some(learned.version.clone()))));
    candidates.push(Candidate::new(single_kernel::NAME, Some(true_kernel)));
    console.step("Optimize holograms of held-out targets through each kernel, and photograph them")?;
    let evaluated = held_out::evaluate(args, &client, &targets.held_out, &candidates, console).await?;

    console.step("Draw the figures")?;
    held_out::save(files, targets::region(args)?, &targets.held_out, &evaluated)?;
    figures::contact_sheet(args, files, targets, &evaluated)?;
    figures::kernel(files, &kernel, &simulated)?;
    figures::loss(files, &learned, &evaluated)?;
    let report = Report::new(args, targets, &learned, &evaluated, console.steps());
    files.write("report.json", report.json()?)?;
    if args.paper {
        console.print(&report.paper_table())?;
    }
    console.print(&report.table())
}

/// Optimizes holograms of the training and test pictures, photographs them, and creates a dataset of the pairs.
async fn photograph_holograms(
    args: &DemoArgs,
    client: &DemoClient,
    files: &Files,
    targets: &Targets,
    console: &mut Console,
) -> anyhow::Result<()> {
    console.step("Optimize holograms through the ideal kernel")?;
    let pictures: Vec<&Picture> = targets.training.iter().chain(&targets.test).collect();
    let requests = pictures.iter().enumerate().map(|(i, picture)| HologramRequest {
        target: &picture.file,
        kernel: v1::KernelChoice::ideal(),
        iterations: args.training_iterations,
        seed: args.seed + i as u64,
        // Every other hologram starts from a fully random phase. A kernel should be learned from both kinds of phases,
        // because later jobs use both.
        initial_phase_range_rad: if i % 2 == 0 { TAU } else { NARROW_RAD },
    });
    let holograms = client.holograms(requests.collect(), &console.bar(Part::Optimize)).await?;
    console.print_result(format!(
        "{} for learning, {} for testing; half start from a random phase, half from a nearly flat phase",
        targets.training.len(),
        targets.test.len()
    ))?;

    console.step("Photograph the holograms")?;
    let requests =
        holograms.iter().zip(1..).map(|(hologram, seed)| PhotoRequest { pattern: hologram.pattern.clone(), seed });
    let photos = client.photographs(requests.collect(), &console.bar(Part::Photograph)).await?;
    client.create_dataset(DATASET).await?;
    let mut pairs = Vec::new();
    for (i, (hologram, photo)) in holograms.iter().zip(&photos).enumerate() {
        // No pair is for validation: trying the parts of the display model takes two to three times as long, and the
        // demo should end within some two minutes. Its display has none of the flaws that they describe.
        let split = if i < targets.training.len() { v1::Split::Train } else { v1::Split::Test };
        let id = format!("pair-{:02}", i + 1);
        files.write(&format!("pairs/{id}-pattern.png"), client.download(&hologram.pattern).await?)?;
        files.write(&format!("pairs/{id}-photo.png"), client.download(photo).await?)?;
        let (pattern, photo) = (hologram.pattern.clone(), photo.clone());
        pairs.push(v1::Pair { id, pattern, photo, split: split.into(), ..Default::default() });
    }
    client.add_pairs(DATASET, pairs).await?;
    let digest = client.finalize(DATASET, &console.bar(Part::Finalize)).await?;
    console.print_result(format!("dataset {DATASET}, {}…", digest.get(..15).unwrap_or(&digest)))
}
