//! Shows held-out targets through each kernel, photographs them and measures them.

use super::args::{DATASET, DemoArgs};
use super::files::Files;
use super::lab::{Hologram, Lab, Losses, NARROW_RAD, Shot, Wanted, kernel_choice};
use super::story::Story;
use super::targets::Picture;
use lightpath_domain::dataset::Encoding;
use lightpath_media::pictures;
use lightpath_optics::metrics::{Gain, fitted_intensity_scale, psnr_db};
use lightpath_optics::{Grid, Plane, RegionOfInterest};

/// A kernel to be compared.
#[derive(Clone, Debug)]
pub(super) struct Contender {
    pub(super) name: &'static str,
    /// Version of the kernel; 0: the ideal kernel.
    pub(super) version: u32,
}

impl Contender {
    pub(super) fn new(name: &'static str, version: u32) -> Self {
        Self { name, version }
    }
}

/// The measured quality of a kernel.
pub(super) struct Judged {
    pub(super) contender: Contender,
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

impl Judged {
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

/// Shows every target through every kernel.
pub(super) async fn judge(
    args: &DemoArgs,
    lab: &Lab,
    targets: &[Picture],
    contenders: &[Contender],
    story: &Story,
) -> anyhow::Result<Vec<Judged>> {
    let versions = contenders.iter().map(|contender| contender.version);
    let losses = lab.losses(DATASET, versions, &mut story.bar("evaluate")).await?;
    let all = || contenders.iter().flat_map(|contender| targets.iter().map(move |target| (contender, target)));
    let wanted = all().map(|(contender, target)| Wanted {
        target: &target.file,
        kernel: kernel_choice(contender.version),
        iterations: args.iterations,
        seed: args.seed,
        initial_phase_range_rad: NARROW_RAD,
    });
    let holograms = lab.holograms(wanted.collect(), &mut story.bar("optimize")).await?;
    // The seeds of the noise differ from those of the dataset's photographs.
    let shots = holograms.iter().zip(1_000_000..).map(|(hologram, seed)| Shot { phase: hologram.phase.clone(), seed });
    let photos = lab.photographs(shots.collect(), &mut story.bar("photograph")).await?;

    let mut shown = Vec::new();
    for ((_, target), (hologram, photo)) in all().zip(holograms.iter().zip(&photos)) {
        shown.push(measured(lab, target, hologram, photo).await?);
    }
    story.tell(format!("{} holograms of {} iterations", shown.len(), args.iterations))?;
    let mut shown = shown.into_iter();
    let judged = contenders.iter().zip(losses).map(|(contender, losses)| Judged {
        contender: contender.clone(),
        losses,
        shown: shown.by_ref().take(targets.len()).collect(),
    });
    Ok(judged.collect())
}

async fn measured(lab: &Lab, target: &Picture, hologram: &Hologram, photo: &str) -> anyhow::Result<Shown> {
    let (photo, phase) = (lab.download(photo).await?, lab.download(&hologram.phase).await?);
    let light = pictures::photograph(&photo, Encoding::Linear)?;
    let grid = Grid::try_new(light.height_px(), light.width_px(), lab.setup()?.grid().pixel_pitch_m())?;
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

/// Saves targets, holograms and photographs as files.
pub(super) fn save(files: &Files, targets: &[Picture], judged: &[Judged]) -> anyhow::Result<()> {
    for target in targets {
        files.write(&format!("targets/{}.png", target.name), pictures::grey_png_srgb(&target.intensity)?)?;
    }
    for judged in judged {
        for (target, shown) in targets.iter().zip(&judged.shown) {
            let name = format!("{}-{}", target.name, judged.contender.name.replace(' ', "-"));
            files.write(&format!("holograms/{name}.png"), &shown.phase)?;
            files.write(&format!("captures/{name}.png"), pictures::grey_png_srgb(&shown.capture)?)?;
            files.write(&format!("captures/raw/{name}.png"), &shown.photo)?;
        }
    }
    Ok(())
}
