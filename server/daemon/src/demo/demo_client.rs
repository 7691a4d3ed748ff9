//! The demo's display and server, used through the client library.

use super::args::{DISPLAY, DemoArgs};
use super::console::Bar;
use anyhow::Context as _;
use lightpath::v1::{
    self, Job, KernelModel,
    job_spec::Kind,
    judgement::Stage,
    optimize_hologram::{Fit, ImagePlane, InitialPhase, initial_phase},
};
use lightpath::{Client, JobChange, judgements, names};
use lightpath_bench::SimulatedBench;
use lightpath_domain::units::{Distance, Wavelength};
use lightpath_optics::{Grid, OpticalSetup};
use serde::Serialize;
use std::path::Path;

/// Range of the initial phase of held-out holograms \[rad\]: a narrow range causes the least speckle.
pub(super) const NARROW_RAD: f64 = 1.0;

/// A client of the demo's server, with the properties of the demo's display.
pub(super) struct DemoClient {
    client: Client,
    wavelength_m: f64,
    distance_m: f64,
    pixel_pitch_m: f64,
    size_px: (u32, u32),
}

/// Request to optimize a hologram.
pub(super) struct HologramRequest<'a> {
    pub(super) target: &'a [u8],
    pub(super) kernel: v1::KernelChoice,
    pub(super) iterations: u32,
    pub(super) seed: u64,
    pub(super) initial_phase_range_rad: f64,
}

/// An optimized hologram of one wavelength, subframe and plane.
pub(super) struct Hologram {
    /// Digest of the file with the grey levels.
    pub(super) pattern: String,
    /// PSNR of the quantized hologram with the detector `pixel`, as a camera sees it \[dB\].
    pub(super) psnr_db: f64,
}

/// Request to photograph a hologram.
pub(super) struct PhotoRequest {
    pub(super) pattern: String,
    pub(super) seed: u64,
}

/// Mean squared errors of predicted photographs.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Loss {
    /// Loss in the region of interest.
    pub(super) region: f64,
    /// Loss over the full frame, as the paper reports it.
    pub(super) full_frame: f64,
}

/// Losses of the training pairs and of the test pairs.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Losses {
    pub(super) train: Loss,
    pub(super) test: Loss,
}

impl DemoClient {
    /// Connects to the server and creates the display on it.
    pub(super) async fn new(url: &str, args: &DemoArgs, bench: SimulatedBench) -> anyhow::Result<Self> {
        let client = Client::connect(url)?;
        let (width_px, height_px) = args.resolution();
        let display = v1::Display {
            name: names::display(DISPLAY),
            modulator: Some(v1::Modulator::of_phase(width_px, height_px, args.pixel_pitch)),
            wavelengths_m: vec![args.wavelength],
            notes: "A simulated display with imperfections, created by lightpathd demo.".to_owned(),
            bench: Some(v1::display::Bench::SimulatedBench(v1::SimulatedBench {
                seed: bench.seed,
                strength: Some(bench.strength),
                camera_noise: Some(bench.camera_noise),
                misalignment_px: bench.misalignment_px,
                ..Default::default()
            })),
            ..Default::default()
        };
        client.create_display(v1::CreateDisplayRequest { display: Some(display) }).await?;
        let distance_m = args.distance_m();
        Ok(Self {
            wavelength_m: args.wavelength,
            distance_m,
            pixel_pitch_m: args.pixel_pitch,
            size_px: args.resolution(),
            client,
        })
    }

    /// Grid, wavelength, distance and propagation that the server uses.
    pub(super) fn setup(&self) -> anyhow::Result<OpticalSetup> {
        let grid = Grid::try_new(self.size_px.1 as usize, self.size_px.0 as usize, self.pixel_pitch_m)?;
        let wavelength = Wavelength::from_m(self.wavelength_m).context("the wavelength is out of range")?;
        let distance = Distance::from_m(self.distance_m).context("the distance is out of range")?;
        Ok(OpticalSetup::try_new(grid, wavelength.m(), distance.m())?.planned()?.0)
    }

    fn place(&self) -> Option<v1::Place> {
        Some(v1::Place::at_m(self.distance_m))
    }

    /// Optimizes holograms, and returns them in the order of the requests.
    pub(super) async fn holograms(
        &self,
        requests: Vec<HologramRequest<'_>>,
        bar: &Bar<'_>,
    ) -> anyhow::Result<Vec<Hologram>> {
        let mut specs = Vec::new();
        for request in requests {
            specs.push(Kind::OptimizeHologram(v1::OptimizeHologram {
                display: names::display(DISPLAY),
                planes: vec![ImagePlane {
                    place: self.place(),
                    target: self.client.upload_bytes(request.target).await?,
                    weight: None,
                }],
                target_fit: Fit::Cover.into(),
                kernel: Some(request.kernel),
                // The figures in docs/results.md were made with Adam.
                method: v1::HologramMethod::Adam.into(),
                iterations: Some(request.iterations),
                seed: request.seed,
                initial_phase: Some(InitialPhase {
                    kind: Some(initial_phase::Kind::Random(initial_phase::Random {
                        range_rad: Some(request.initial_phase_range_rad),
                    })),
                }),
                ..Default::default()
            }));
        }
        let jobs = self.run_jobs(specs, bar).await?;
        jobs.iter().map(hologram_of).collect()
    }

    /// Takes photographs, and returns their digests in the order of the requests.
    pub(super) async fn photographs(&self, requests: Vec<PhotoRequest>, bar: &Bar<'_>) -> anyhow::Result<Vec<String>> {
        let spec = |request: PhotoRequest| {
            Kind::SimulateCapture(v1::SimulateCapture {
                display: names::display(DISPLAY),
                place: self.place(),
                pattern: request.pattern,
                seed: request.seed,
                ..Default::default()
            })
        };
        let jobs = self.run_jobs(requests.into_iter().map(spec).collect(), bar).await?;
        jobs.iter().map(|job| Ok(lightpath::capture_result(job)?.photo.clone())).collect()
    }

    pub(super) async fn create_dataset(&self, id: &str) -> anyhow::Result<()> {
        let dataset = v1::Dataset {
            name: names::dataset(id),
            display: names::display(DISPLAY),
            place: self.place(),
            photo_encoding: v1::Encoding::Linear.into(),
            ..Default::default()
        };
        self.client.create_dataset(v1::CreateDatasetRequest { dataset: Some(dataset) }).await?;
        Ok(())
    }

    pub(super) async fn add_pairs(&self, dataset: &str, pairs: Vec<v1::Pair>) -> anyhow::Result<()> {
        self.client.add_pairs(v1::AddPairsRequest { dataset: names::dataset(dataset), pairs }).await?;
        Ok(())
    }

    /// Finalizes the dataset with a job and returns its digest.
    pub(super) async fn finalize(&self, dataset: &str, bar: &Bar<'_>) -> anyhow::Result<String> {
        let step = Some(v1::prepare_dataset::Step::Finalize(v1::prepare_dataset::Finalize::default()));
        let spec = v1::PrepareDataset { dataset: names::dataset(dataset), step };
        let jobs = self.run_jobs(vec![Kind::PrepareDataset(spec)], bar).await?;
        Ok(lightpath::prepare_result(&jobs[0])?.digest.clone())
    }

    pub(super) async fn learn(
        &self,
        dataset: &str,
        model: KernelModel,
        seed: u64,
        bar: &Bar<'_>,
    ) -> anyhow::Result<v1::LearnKernelResult> {
        let datasets = vec![names::dataset(dataset)];
        let spec = v1::LearnKernel { datasets, model: model.into(), seed, ..Default::default() };
        let jobs = self.run_jobs(vec![Kind::LearnKernel(spec)], bar).await?;
        Ok(lightpath::learn_result(&jobs[0])?.clone())
    }

    /// Losses of kernels on the photographs of the dataset.
    pub(super) async fn losses(
        &self,
        dataset: &str,
        kernels: impl Iterator<Item = v1::KernelChoice>,
        bar: &Bar<'_>,
    ) -> anyhow::Result<Vec<Losses>> {
        let spec = |kernel| {
            let (dataset, kernel) = (names::dataset(dataset), Some(kernel));
            Kind::EvaluateKernel(v1::EvaluateKernel { dataset, kernel, ..Default::default() })
        };
        let jobs = self.run_jobs(kernels.map(spec).collect(), bar).await?;
        let mean = |job: &Job, split: v1::Split| -> anyhow::Result<Loss> {
            let pairs: Vec<_> = lightpath::evaluate_result(job)?.pairs.iter().filter(|p| p.split() == split).collect();
            let mean = |of: fn(&v1::evaluate_kernel_result::PairLoss) -> f64| {
                pairs.iter().map(|pair| of(pair)).sum::<f64>() / pairs.len() as f64
            };
            Ok(Loss { region: mean(|pair| pair.loss), full_frame: mean(|pair| pair.loss_full_frame) })
        };
        let both = |job| Ok(Losses { train: mean(job, v1::Split::Train)?, test: mean(job, v1::Split::Test)? });
        jobs.iter().map(both).collect()
    }

    /// Makes the version with this name active.
    pub(super) async fn promote(&self, version: &str) -> anyhow::Result<()> {
        let request = v1::PromoteKernelRequest {
            kernel: names::kernel_of(version).to_owned(),
            version: names::id(version).parse()?,
            reason: "learned by the demo".to_owned(),
            expected_active_version: Some(0),
            force: false,
        };
        self.client.promote_kernel(request).await?;
        Ok(())
    }

    /// Saves the active version of a kernel to a file, and returns the version and the bytes.
    pub(super) async fn fetch_kernel(&self, kernel: &str, path: &Path) -> anyhow::Result<(v1::KernelVersion, Vec<u8>)> {
        let version = self.client.fetch_kernel_to(kernel, None, path).await?;
        let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
        Ok((version, bytes))
    }

    /// Stores a kernel file as the next version, and returns the name of that version.
    pub(super) async fn import(&self, file: Vec<u8>) -> anyhow::Result<String> {
        let request = v1::ImportKernelRequest {
            display: names::display(DISPLAY),
            wavelength_m: Some(self.wavelength_m),
            place: self.place(),
            artifact: self.client.upload_bytes(file).await?,
            ..Default::default()
        };
        Ok(self.client.import_kernel(request).await?.name)
    }

    pub(super) async fn download(&self, digest: &str) -> anyhow::Result<Vec<u8>> {
        Ok(self.client.download(digest).await?)
    }

    /// Submits all jobs, waits until all have ended, and returns them in the same order.
    async fn run_jobs(&self, specs: Vec<Kind>, bar: &Bar<'_>) -> anyhow::Result<Vec<Job>> {
        let count = specs.len();
        let request = |kind| v1::SubmitJobRequest { spec: Some(lightpath::job_spec(kind)), ..Default::default() };
        let submitted = self.client.submit_all(specs.into_iter().map(request).collect()).await?;
        let mut done = Vec::with_capacity(count);
        for job in submitted {
            let show = |change: JobChange<'_>| {
                if let JobChange::Job(Job { progress: Some(progress), .. }) = change {
                    let share = f64::from(progress.step) / f64::from(progress.steps_total.max(1));
                    bar.set(done.len(), count, share);
                }
            };
            let job = self.client.wait(&job.name, show).await?;
            done.push(job);
        }
        Ok(done)
    }
}

fn hologram_of(job: &Job) -> anyhow::Result<Hologram> {
    let result = lightpath::hologram_result(job)?;
    let parts = result.wavelengths.first().and_then(|hologram| hologram.subframes.first().zip(hologram.planes.first()));
    let (subframe, plane) = parts.context("the result contains no hologram")?;
    let judged = judgements::judgement(&plane.judgements, Stage::Displayed, v1::Detector::Pixel);
    Ok(Hologram { pattern: subframe.pattern.clone(), psnr_db: judged.map_or(f64::NAN, v1::Judgement::psnr) })
}
