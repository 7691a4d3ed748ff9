//! `lightpathd demo`: the whole loop on a simulated display, with a real server and the real client.
//!
//! Targets become holograms, holograms become photographs, photographs become a kernel, and the kernel gives better
//! holograms. The demo measures the kernels on held-out targets, for which the learning set has no holograms. It
//! compares them with two marks: the ideal kernel as the lower mark, and the display's true transfer function alone as
//! the upper one.

mod args;
mod figures;
mod files;
mod held_out;
mod lab;
mod learned;
mod local_server;
mod report;
mod single_kernel;
mod story;
mod targets;

pub use args::DemoArgs;

use args::DATASET;
use files::Files;
use held_out::Contender;
use lab::{Lab, NARROW_RAD, Shot, Wanted};
use learned::learn;
use lightpath::v1;
use lightpath_optics::SimulatedBench;
use local_server::LocalServer;
use report::Report;
use std::f64::consts::TAU;
use story::Story;
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
    tokio::runtime::Builder::new_multi_thread().enable_all().build()?.block_on(demonstrate(args))
}

async fn demonstrate(args: DemoArgs) -> anyhow::Result<()> {
    let mut story = Story::begin(&args)?;
    let targets = targets::gather(&args)?;
    let files = Files::create(&args.out)?;

    story.step("Start a server with a queue of its own")?;
    let server = LocalServer::start(&files.data_dir()).await?;
    story.tell(format!("{} · data in {}", server.url(), files.data_dir().display()))?;

    let outcome = learn_and_compare(&args, &server, &files, &targets, &mut story).await;
    server.stop().await?;
    outcome?;
    story.finish(&args, &files)
}

async fn learn_and_compare(
    args: &DemoArgs,
    server: &LocalServer,
    files: &Files,
    targets: &Targets,
    story: &mut Story,
) -> anyhow::Result<()> {
    story.step("Declare a display with flaws")?;
    let bench = SimulatedBench {
        seed: args.seed,
        strength: STRENGTH,
        camera_noise: CAMERA_NOISE,
        misalignment_px: MISALIGNMENT_PX,
        ..SimulatedBench::FAIR
    };
    let lab = Lab::new(server.url(), args, bench).await?;
    story.tell("aberrated, apodized, lit off-centre, with a bent phase response and undiffracted light".to_owned())?;

    photograph_holograms(args, &lab, files, targets, story).await?;
    let learned = learn(args, &lab, story).await?;

    story.step("Put the kernel into service")?;
    lab.promote(1).await?;
    let (version, kernel) = lab.fetch_kernel(&files.at("kernel.safetensors")).await?;
    let size_kb = version.size_bytes as f64 / 1000.0;
    story.tell(format!("{} is active · {size_kb:.1} kB in kernel.safetensors", version.name))?;
    let simulated = single_kernel::bench(&lab.setup()?, bench)?;
    let floor = lab.import(single_kernel::file(&simulated)?).await?;

    let mut contenders = vec![Contender::new("ideal", 0)];
    contenders.extend(learned.iter().map(|l| Contender::new(l.name, l.version)));
    contenders.push(Contender::new(single_kernel::NAME, floor));
    story.step("Show held-out targets through each kernel, and photograph them")?;
    let judged = held_out::judge(args, &lab, &targets.held_out, &contenders, story).await?;

    story.step("Draw the pictures")?;
    held_out::save(files, &targets.held_out, &judged)?;
    figures::contact_sheet(args, files, targets, &judged)?;
    figures::kernel(files, &kernel, &simulated)?;
    figures::loss(files, &learned, &judged)?;
    let report = Report::new(args, targets, &learned, &judged, story.steps());
    files.write("report.json", report.json()?)?;
    if args.paper {
        story.show(&report.paper_table())?;
    }
    story.show(&report.table())
}

/// Makes holograms of the training and test pictures, photographs them, and creates a dataset of both.
async fn photograph_holograms(
    args: &DemoArgs,
    lab: &Lab,
    files: &Files,
    targets: &Targets,
    story: &mut Story,
) -> anyhow::Result<()> {
    story.step("Make holograms through the ideal kernel")?;
    let pictures: Vec<&Picture> = targets.training.iter().chain(&targets.test).collect();
    let wanted = pictures.iter().enumerate().map(|(i, picture)| Wanted {
        target: &picture.file,
        kernel: "ideal".to_owned(),
        iterations: args.training_iterations,
        seed: args.seed + i as u64,
        // Every other hologram starts from fully random phase, because learning needs the phases that later jobs use.
        initial_phase_range_rad: if i % 2 == 0 { TAU } else { NARROW_RAD },
    });
    let holograms = lab.holograms(wanted.collect(), &mut story.bar("optimize")).await?;
    story.tell(format!(
        "{} to learn from, {} held out; half start from random phase, half from nearly flat phase",
        targets.training.len(),
        targets.test.len()
    ))?;

    story.step("Photograph them")?;
    let shots = holograms.iter().zip(1..).map(|(hologram, seed)| Shot { phase: hologram.phase.clone(), seed });
    let photos = lab.photographs(shots.collect(), &mut story.bar("photograph")).await?;
    lab.create_dataset(DATASET).await?;
    for (i, (hologram, photo)) in holograms.iter().zip(&photos).enumerate() {
        let split = if i < targets.training.len() { v1::Split::Train } else { v1::Split::Test };
        let id = format!("pair-{:02}", i + 1);
        files.write(&format!("pairs/{id}-phase.png"), lab.download(&hologram.phase).await?)?;
        files.write(&format!("pairs/{id}-photo.png"), lab.download(photo).await?)?;
        lab.add_pair(DATASET, id, &hologram.phase, photo, split).await?;
    }
    let digest = lab.finalize(DATASET, &mut story.bar("finalize")).await?;
    story.tell(format!("dataset {DATASET}, {}…", digest.get(..15).unwrap_or(&digest)))
}
