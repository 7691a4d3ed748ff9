//! Jobs of all kinds and sizes, for the tests of their memory and of their ends.

use crate::material::{DISTANCE_M, WAVELENGTH_M, simulated, target};
use lightpath::v1::display::Orders;
use lightpath::v1::optimize_hologram::{ImagePlane, InitialPhase, initial_phase};
use lightpath::v1::{self, Detector, HologramMethod, job_spec};
use lightpath::{Client, names};
use lightpath_domain::kernel::KernelModel;
use lightpath_media::{kernel_file, pictures};
use lightpath_optics::hologram::initial_phase as random_phase;
use lightpath_optics::{
    DisplayModel, Engine, FurtherMode, Grid, KernelShape, OpticalSetup, PartialCoherence, Plane, SmoothField,
};
use num_complex::Complex32;
use std::f64::consts::PI;

/// Number of pairs of each dataset.
const PAIRS: u64 = 8;

/// A job, or the jobs of a dataset, on a display of some size.
pub(crate) struct Shape {
    pub(crate) name: String,
    pub(crate) size_px: (u32, u32),
    pub(crate) spec: Spec,
}

pub(crate) enum Spec {
    Hologram(Box<Hologram>),
    /// The jobs of a dataset with this model: finalize, learn, evaluate, report.
    Dataset(v1::KernelModel),
    Capture,
    /// The judgement of a hologram.
    Verify,
    /// The report on a kernel with a value for each frequency, with as many other versions.
    DenseReport(u32),
}

#[derive(Clone)]
pub(crate) struct Hologram {
    pub(crate) method: HologramMethod,
    pub(crate) detector: Detector,
    pub(crate) subframes: u32,
    pub(crate) planes: u32,
    pub(crate) wavelengths: u32,
    pub(crate) iterations: u32,
    pub(crate) masked: bool,
    pub(crate) back_propagated: bool,
    pub(crate) quantization_aware: bool,
    /// What the display shows; `None`: the first order of its pixels.
    pub(crate) orders: Option<Orders>,
}

pub(crate) const LBFGS: Hologram = Hologram {
    method: HologramMethod::Lbfgs,
    detector: Detector::Pixel,
    subframes: 1,
    planes: 1,
    wavelengths: 1,
    iterations: 12,
    masked: false,
    back_propagated: false,
    quantization_aware: false,
    orders: None,
};

pub(crate) fn hologram(name: &str, size_px: (u32, u32), hologram: Hologram) -> Shape {
    Shape { name: format!("{name}, {}×{}", size_px.0, size_px.1), size_px, spec: Spec::Hologram(hologram.into()) }
}

pub(crate) const SMALL: (u32, u32) = (960, 540);
pub(crate) const HD: (u32, u32) = (1920, 1080);
pub(crate) const UHD: (u32, u32) = (3840, 2160);

pub(crate) fn adam() -> Hologram {
    Hologram { method: HologramMethod::Adam, ..LBFGS }
}

pub(crate) fn gerchberg_saxton() -> Hologram {
    Hologram { method: HologramMethod::GerchbergSaxton, ..LBFGS }
}

pub(crate) fn double_phase() -> Hologram {
    Hologram { method: HologramMethod::DoublePhase, iterations: 0, ..LBFGS }
}

pub(crate) fn all_orders() -> Orders {
    Orders::AllOrders(v1::AllOrders::default())
}

pub(crate) fn half_order() -> Orders {
    Orders::OrderFilter(v1::OrderFilter { height: Some(0.5), ..Default::default() })
}

impl Shape {
    /// Declares the display, uploads what the jobs read, and returns their kinds and specs. Each job needs that those
    /// before it have succeeded.
    pub(crate) async fn prepare(&self, client: &Client) -> Vec<(&'static str, job_spec::Kind)> {
        let orders = if let Spec::Hologram(hologram) = &self.spec { hologram.orders } else { None };
        let display = v1::Display {
            name: names::display("lab"),
            modulator: Some(v1::Modulator::of_phase(self.size_px.0, self.size_px.1, 8e-6)),
            wavelengths_m: vec![450e-9, WAVELENGTH_M, 638e-9],
            bench: if orders.is_none() { simulated(7) } else { None },
            orders,
            ..Default::default()
        };
        client.create_display(v1::CreateDisplayRequest { display: Some(display) }).await.unwrap();
        match &self.spec {
            Spec::Hologram(hologram) => vec![("optimize", hologram_spec(client, self.size_px, hologram).await)],
            Spec::Verify => vec![("verify", verify_spec(client, self.size_px).await)],
            Spec::Capture => vec![("simulate", capture_spec(client, self.size_px).await)],
            Spec::Dataset(model) => dataset_specs(client, self.size_px, *model).await,
            Spec::DenseReport(others) => vec![("report", dense_report_spec(client, self.size_px, *others).await)],
        }
    }
}

async fn hologram_spec(client: &Client, size_px: (u32, u32), shape: &Hologram) -> job_spec::Kind {
    let mut planes = Vec::new();
    for p in 0..shape.planes {
        let target = client.upload_bytes(target(size_px.0, size_px.1, p)).await.unwrap();
        planes.push(ImagePlane {
            place: Some(v1::Place::at_m(DISTANCE_M + 0.01 * f64::from(p))),
            target,
            weight: None,
        });
    }
    let wavelengths_m = [WAVELENGTH_M, 450e-9, 638e-9][..shape.wavelengths as usize].to_vec();
    let mask = if shape.masked { planes[0].target.clone() } else { String::new() };
    let from_target = initial_phase::Kind::BackPropagated(v1::optimize_hologram::initial_phase::Random::default());
    job_spec::Kind::OptimizeHologram(v1::OptimizeHologram {
        display: names::display("lab"),
        wavelengths_m,
        planes,
        kernel: Some(v1::KernelChoice::ideal()),
        method: shape.method.into(),
        detector: shape.detector.into(),
        iterations: Some(shape.iterations),
        subframes: Some(shape.subframes),
        weight_mask: mask,
        initial_phase: shape.back_propagated.then_some(InitialPhase { kind: Some(from_target) }),
        quantization_aware: shape.quantization_aware,
        ..Default::default()
    })
}

/// Makes a hologram. Returns the spec of the job that judges it.
async fn verify_spec(client: &Client, size_px: (u32, u32)) -> job_spec::Kind {
    let spec = hologram_spec(client, size_px, &Hologram { iterations: 2, ..adam() }).await;
    let request = v1::SubmitJobRequest { spec: Some(lightpath::job_spec(spec)), ..Default::default() };
    let job = client.submit(request).await.unwrap().name;
    client.wait(&job, |_| ()).await.unwrap();
    job_spec::Kind::VerifyHologram(v1::VerifyHologram { job })
}

async fn capture_spec(client: &Client, size_px: (u32, u32)) -> job_spec::Kind {
    let pattern = client.upload_bytes(target(size_px.0, size_px.1, 1)).await.unwrap();
    job_spec::Kind::SimulateCapture(v1::SimulateCapture {
        display: names::display("lab"),
        wavelength_m: Some(WAVELENGTH_M),
        place: Some(v1::Place::at_m(DISTANCE_M)),
        pattern,
        ..Default::default()
    })
}

fn setup(size_px: (u32, u32)) -> OpticalSetup {
    let grid = Grid::try_new(size_px.1 as usize, size_px.0 as usize, 8e-6).unwrap();
    OpticalSetup::try_new(grid, WAVELENGTH_M, DISTANCE_M).unwrap().planned().unwrap().0
}

/// Makes a finalized dataset and a kernel. Returns the specs of the jobs that made them and that use them.
/// A display that needs the part that takes most memory: modes of light, here shifted by a pixel to either side.
fn partially_coherent(size_px: (u32, u32)) -> DisplayModel {
    let shifted = |tilt_rad: f64| {
        let mut errors = SmoothField::flat(1);
        errors.phase[1] = tilt_rad;
        FurtherMode { light: 1.0, errors }
    };
    DisplayModel {
        kernel: KernelShape::Smooth(SmoothField::flat(1)),
        coherence: PartialCoherence::new(vec![shifted(PI), shifted(-PI)]),
        ..DisplayModel::ideal(setup(size_px))
    }
}

async fn dataset_specs(
    client: &Client,
    size_px: (u32, u32),
    model: v1::KernelModel,
) -> Vec<(&'static str, job_spec::Kind)> {
    let engine = Engine::new(&partially_coherent(size_px), lightpath_optics::Detector::Pixel, None).unwrap();
    let dataset = names::dataset("d");
    client
        .create_dataset(v1::CreateDatasetRequest {
            dataset: Some(v1::Dataset {
                name: dataset.clone(),
                display: names::display("lab"),
                wavelength_m: Some(WAVELENGTH_M),
                place: Some(v1::Place::at_m(DISTANCE_M)),
                ..Default::default()
            }),
        })
        .await
        .unwrap();
    for seed in 0..PAIRS {
        let phase = random_phase(size_px.1 as usize, size_px.0 as usize, 6.0, seed).unwrap();
        let photo = engine.light(&phase).unwrap().map(|light| 0.2 * light);
        let phase = client.upload_bytes(pictures::npy_f32(&phase).unwrap()).await.unwrap();
        let photo = client.upload_bytes(pictures::grey_png_linear(&photo).unwrap()).await.unwrap();
        let pairs = vec![v1::Pair { id: format!("p{seed}"), pattern: phase, photo, ..Default::default() }];
        client.add_pairs(v1::AddPairsRequest { dataset: dataset.clone(), pairs }).await.unwrap();
    }
    let finalize = v1::prepare_dataset::Finalize { validation_fraction: Some(0.2), ..Default::default() };
    let step = Some(v1::prepare_dataset::Step::Finalize(finalize));
    let smooth = model == v1::KernelModel::Display;
    let learn = v1::LearnKernel {
        datasets: vec![dataset.clone()],
        model: model.into(),
        epochs: Some(1),
        degree: smooth.then_some(5),
        refinement_evaluations: smooth.then_some(2),
        ..Default::default()
    };
    let kernel_version = format!("{}/kernels/515nm-50mm/versions/1", names::display("lab"));
    let kernel = Some(v1::KernelChoice::version(kernel_version.clone()));
    let mut jobs = vec![
        ("finalize", job_spec::Kind::PrepareDataset(v1::PrepareDataset { dataset: dataset.clone(), step })),
        ("learn", job_spec::Kind::LearnKernel(learn)),
        ("evaluate", job_spec::Kind::EvaluateKernel(v1::EvaluateKernel { dataset, kernel, ..Default::default() })),
        ("report", job_spec::Kind::ReportKernel(v1::ReportKernel { kernel_version: kernel_version.clone() })),
    ];
    if smooth {
        let suggest = v1::SuggestHolograms { kernel_version, ..Default::default() };
        jobs.push(("suggest", job_spec::Kind::SuggestHolograms(suggest)));
    }
    jobs
}

async fn dense_report_spec(client: &Client, size_px: (u32, u32), others: u32) -> job_spec::Kind {
    let setup = setup(size_px);
    let (rows, columns) = (setup.padded_height_px(), setup.padded_width_px());
    for version in 0..=others {
        let bins = Plane::from_fn(rows, columns, |y, x| Complex32::cis((x * y) as f32 * 1e-6 + version as f32));
        let model = DisplayModel { kernel: KernelShape::Bins(bins), ..DisplayModel::ideal(setup) };
        let artifact = client.upload_bytes(kernel_file::encode(&model, KernelModel::Dense).unwrap()).await.unwrap();
        let display = names::display("lab");
        let request = v1::ImportKernelRequest {
            display,
            wavelength_m: Some(WAVELENGTH_M),
            place: Some(v1::Place::at_m(DISTANCE_M)),
            artifact,
            ..Default::default()
        };
        client.import_kernel(request).await.unwrap();
    }
    let kernel_version = format!("{}/kernels/515nm-50mm/versions/1", names::display("lab"));
    job_spec::Kind::ReportKernel(v1::ReportKernel { kernel_version })
}
