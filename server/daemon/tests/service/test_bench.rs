//! A simulated bench for tests, and a dataset of its photographs on a server.

use crate::preparing::{WholeDataset, finalize, prepare};
use crate::serving::{Serving, sized_display};
use lightpath_bench::{SimulatedBench, SimulatedDisplay, TestCard};
use lightpath_camera::alignment::{Homography, warp};
use lightpath_media::pictures;
use lightpath_optics::hologram::{HologramMethod, HologramOptions, ImagePlane, Loss, initial_phase};
use lightpath_optics::{
    Detector, DisplayModel, Engine, Grid, HologramProblem, OpticalSetup, Optimization, Plane, RegionOfInterest,
};
use lightpath_proto::v1;
use lightpath_proto::v1::dataset_service_client::DatasetServiceClient;
use lightpath_proto::v1::prepare_dataset::align::Source;
use lightpath_proto::v1::prepare_dataset::{Align, Step};
use tonic::transport::Channel;

pub(crate) const HEIGHT: usize = 216;
pub(crate) const WIDTH: usize = 384;
const DISTANCE_M: f64 = 0.03;
pub(crate) const CENTRE: [f64; 2] = [(WIDTH as f64 - 1.0) / 2.0, (HEIGHT as f64 - 1.0) / 2.0];

/// A simulated bench, and an engine of the ideal display, for which holograms are optimized.
pub(crate) struct TestBench {
    pub(crate) setup: OpticalSetup,
    pub(crate) engine: Engine,
    bench: SimulatedDisplay,
}

impl TestBench {
    pub(crate) fn new(seed: u64) -> Self {
        let grid = Grid::try_new(HEIGHT, WIDTH, 8e-6).unwrap();
        let (setup, _) = OpticalSetup::try_new(grid, 515e-9, DISTANCE_M).unwrap().planned().unwrap();
        let imperfections = SimulatedBench {
            seed,
            strength: 1.0,
            camera_noise: 0.003,
            misalignment_px: 0.0,
            ..SimulatedBench::default()
        };
        Self {
            setup,
            engine: Engine::new(&DisplayModel::ideal(setup), Detector::Pixel, None).unwrap(),
            bench: SimulatedDisplay::draw(setup, None, imperfections).unwrap(),
        }
    }

    /// Optimizes the phase of a target for the ideal display.
    pub(crate) fn phase(&self, target: &Plane<f32>, iterations: u32) -> Plane<f32> {
        self.phase_through(&self.engine, target, iterations)
    }

    /// Optimizes the phase of a target through `engine`.
    pub(crate) fn phase_through(&self, engine: &Engine, target: &Plane<f32>, iterations: u32) -> Plane<f32> {
        let plane = ImagePlane { engine: engine.clone(), target: target.clone(), weight: None, share: 1.0 };
        let problem = HologramProblem::with_planes(vec![plane], 1, self.region(), Loss::default()).unwrap();
        let start = initial_phase(HEIGHT, WIDTH, 1.0, 1).unwrap().into_vec();
        let mut optimization =
            Optimization::start(problem, HologramOptions::new(HologramMethod::Lbfgs, iterations), start).unwrap();
        while optimization.step().is_some() {}
        Plane::try_from_vec(HEIGHT, WIDTH, optimization.phases().to_vec()).unwrap()
    }

    pub(crate) fn region(&self) -> RegionOfInterest {
        RegionOfInterest::middle(&self.setup.grid())
    }

    pub(crate) fn hologram(&self, card: usize) -> Plane<f32> {
        self.phase(&TestCard::ALL[card].render(HEIGHT, WIDTH, card as u64).unwrap(), 40)
    }

    /// A photograph of a phase in linear light. `map` maps pixels of the display to pixels of the camera, which has
    /// `height` × `width` pixels.
    pub(crate) fn photo(
        &self,
        phase: &Plane<f32>,
        seed: u64,
        map: &Homography,
        height: usize,
        width: usize,
    ) -> Plane<f32> {
        self.expose(&self.light(phase), seed, map, height, width)
    }

    /// Light in the image plane for a phase, in units of the camera's full scale.
    pub(crate) fn light(&self, phase: &Plane<f32>) -> Plane<f32> {
        self.bench.light(&levels(phase).map(|level| f32::from(level) * std::f32::consts::TAU / 256.0)).unwrap()
    }

    /// A photograph of the given light. `map` maps pixels of the display to pixels of the camera.
    pub(crate) fn expose(
        &self,
        light: &Plane<f32>,
        seed: u64,
        map: &Homography,
        height: usize,
        width: usize,
    ) -> Plane<f32> {
        let seen = self.bench.expose(&warp(light, &map.inverse(), height, width, 9.0, 0.0), seed);
        seen.map(|level| f32::from(level) / 255.0)
    }
}

pub(crate) fn levels(phase: &Plane<f32>) -> Plane<u16> {
    phase.map(|phase| (phase / std::f32::consts::TAU * 256.0).round().rem_euclid(256.0) as u16)
}

/// An open dataset on a server of its own.
pub(crate) struct Dataset {
    pub(crate) serving: Serving,
    pub(crate) client: DatasetServiceClient<Channel>,
}

impl Dataset {
    pub(crate) async fn open() -> Self {
        let serving = Serving::start().await;
        let display = sized_display("bench", WIDTH as u32, HEIGHT as u32);
        let request = v1::CreateDisplayRequest { display: Some(display) };
        serving.displays().create_display(request).await.unwrap();
        let mut client = DatasetServiceClient::new(serving.channel.clone());
        let dataset = v1::Dataset {
            name: "datasets/d".into(),
            display: "displays/bench".into(),
            place: Some(v1::Place::at_m(DISTANCE_M)),
            ..Default::default()
        };
        client.create_dataset(v1::CreateDatasetRequest { dataset: Some(dataset) }).await.unwrap();
        Self { serving, client }
    }

    pub(crate) async fn add(&mut self, id: &str, phase: &Plane<f32>, photo: &Plane<f32>) -> v1::Pair {
        let phase = self.serving.upload(&pictures::levels_png(&levels(phase), 8).unwrap()).await;
        let photo = self.serving.upload(&pictures::grey_png_linear(photo).unwrap()).await;
        let pair = v1::Pair { id: id.into(), pattern: phase, photo, ..Default::default() };
        let request = v1::AddPairsRequest { dataset: "datasets/d".into(), pairs: vec![pair] };
        self.client.add_pairs(request).await.unwrap().into_inner().pairs.remove(0)
    }

    pub(crate) async fn finalize(&mut self) -> Result<WholeDataset, String> {
        finalize(&self.serving, "datasets/d").await
    }

    pub(crate) async fn align(&mut self, source: Source) -> Result<WholeDataset, String> {
        let step = Step::Align(Align { source: Some(source) });
        prepare(&self.serving, "datasets/d", step).await
    }
}
