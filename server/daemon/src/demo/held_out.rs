//! Optimizes holograms of held-out targets through each kernel, photographs them and measures the photographs.

use super::args::{DATASET, DemoArgs};
use super::console::Console;
use super::demo_client::{DemoClient, Hologram, HologramRequest, Losses, NARROW_RAD, PhotoRequest};
use super::files::Files;
use super::remaining::Part;
use super::targets::Picture;
use lightpath::v1;
use lightpath_domain::dataset::Encoding;
use lightpath_media::pictures;
use lightpath_optics::metrics::{Gain, fitted_intensity_scale, psnr_db};
use lightpath_optics::{Grid, Plane, RegionOfInterest};

/// A kernel in the comparison.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    pub(super) name: &'static str,
    /// Resource name of the version; `None`: the ideal kernel.
    pub(super) version: Option<String>,
}

impl Candidate {
    pub(super) fn new(name: &'static str, version: Option<String>) -> Self {
        Self { name, version }
    }

    fn kernel(&self) -> v1::KernelChoice {
        self.version.as_ref().map_or_else(v1::KernelChoice::ideal, v1::KernelChoice::version)
    }
}

/// Measured quality of a kernel.
pub(super) struct Evaluated {
    pub(super) candidate: Candidate,
    /// Losses over the photographs of the dataset, which the server measures in the same way for every kernel.
    pub(super) losses: Losses,
    /// Results in the order of the held-out targets.
    pub(super) shown: Vec<Shown>,
}

/// A held-out target, shown through one kernel.
pub(super) struct Shown {
    /// PSNR of the quantized hologram, as the kernel predicts it \[dB\].
    pub(super) simulated_psnr_db: f64,
    /// PSNR of the photograph, with fitted gain \[dB\].
    pub(super) captured_psnr_db: f64,
    /// File of the photograph, as received from the server.
    pub(super) photo: Vec<u8>,
    /// Light of the photograph, scaled to the brightness of the target.
    pub(super) capture: Plane<f32>,
    /// File of the hologram, as received from the server.
    pub(super) phase: Vec<u8>,
}

impl Evaluated {
    pub(super) fn mean_simulated_psnr_db(&self) -> f64 {
        self.mean(|shown| shown.simulated_psnr_db)
    }

    pub(super) fn mean_captured_psnr_db(&self) -> f64 {
        self.mean(|shown| shown.captured_psnr_db)
    }

    fn mean(&self, of: impl Fn(&Shown) -> f64) -> f64 {
        self.shown.iter().map(of).sum::<f64>() / self.shown.len() as f64
    }
}

/// Optimizes a hologram of every target through every kernel, photographs it, and measures the photograph.
pub(super) async fn evaluate(
    args: &DemoArgs,
    client: &DemoClient,
    targets: &[Picture],
    candidates: &[Candidate],
    console: &Console,
) -> anyhow::Result<Vec<Evaluated>> {
    let kernels = candidates.iter().map(Candidate::kernel);
    let losses = client.losses(DATASET, kernels, &console.bar(Part::Evaluate)).await?;
    let combinations = || candidates.iter().flat_map(|candidate| targets.iter().map(move |target| (candidate, target)));
    let requests = combinations().map(|(candidate, target)| HologramRequest {
        target: &target.file,
        kernel: candidate.kernel(),
        iterations: args.iterations,
        seed: args.seed,
        initial_phase_range_rad: NARROW_RAD,
    });
    let holograms = client.holograms(requests.collect(), &console.bar(Part::OptimizeHeldOut)).await?;
    // The seeds of the noise differ from those of the dataset's photographs.
    let requests = holograms
        .iter()
        .zip(1_000_000..)
        .map(|(hologram, seed)| PhotoRequest { pattern: hologram.pattern.clone(), seed });
    let photos = client.photographs(requests.collect(), &console.bar(Part::PhotographHeldOut)).await?;

    let mut shown = Vec::new();
    for ((_, target), (hologram, photo)) in combinations().zip(holograms.iter().zip(&photos)) {
        shown.push(measure_target(client, target, hologram, photo).await?);
    }
    console.print_result(format!("{} holograms of {} iterations", shown.len(), args.iterations))?;
    let mut shown = shown.into_iter();
    let evaluated = candidates.iter().zip(losses).map(|(candidate, losses)| Evaluated {
        candidate: candidate.clone(),
        losses,
        shown: shown.by_ref().take(targets.len()).collect(),
    });
    Ok(evaluated.collect())
}

/// Downloads the hologram and the photograph of a target, and measures the photograph.
async fn measure_target(
    client: &DemoClient,
    target: &Picture,
    hologram: &Hologram,
    photo: &str,
) -> anyhow::Result<Shown> {
    let (photo, phase) = (client.download(photo).await?, client.download(&hologram.pattern).await?);
    let light = pictures::photograph(&photo, Encoding::Linear)?;
    let grid = Grid::try_new(light.height_px(), light.width_px(), client.setup()?.grid().pixel_pitch_m())?;
    let region = RegionOfInterest::middle(&grid);
    let scale = fitted_intensity_scale(&light, &target.intensity, region)?;
    Ok(Shown {
        simulated_psnr_db: hologram.psnr_db,
        captured_psnr_db: psnr_db(&light, &target.intensity, region, Gain::Fitted)?,
        capture: light.map(|value| value * scale as f32),
        photo,
        phase,
    })
}

/// Saves targets, holograms and photographs as files. A target is what fills `region`, as a user submits it.
pub(super) fn save(
    files: &Files,
    region: RegionOfInterest,
    targets: &[Picture],
    evaluated: &[Evaluated],
) -> anyhow::Result<()> {
    for target in targets {
        let at = |y, x| target.intensity.at(region.y_px() + y, region.x_px() + x);
        let shown = Plane::from_fn(region.height_px(), region.width_px(), at);
        files.write(&format!("targets/{}.png", target.name), pictures::grey_png_srgb(&shown)?)?;
    }
    for evaluated in evaluated {
        for (target, shown) in targets.iter().zip(&evaluated.shown) {
            let name = format!("{}-{}", target.name, evaluated.candidate.name.replace(' ', "-"));
            files.write(&format!("holograms/{name}.png"), &shown.phase)?;
            files.write(&format!("captures/{name}.png"), pictures::grey_png_srgb(&shown.capture)?)?;
            files.write(&format!("captures/raw/{name}.png"), &shown.photo)?;
        }
    }
    Ok(())
}
