//! Test of kernels for distances without photographs: one model is learned from datasets at several distances.

use crate::preparing::{prepare, report};
use crate::serving::{Serving, expect, small_display};
use lightpath_bench::{SimulatedBench, SimulatedDisplay};
use lightpath_media::{kernel_file, pictures};
use lightpath_optics::hologram::initial_phase;
use lightpath_optics::learning::{Pair, compare};
use lightpath_optics::{Detector, DisplayModel, Engine, Grid, OpticalSetup, Plane, RegionOfInterest};
use lightpath_proto::v1;
use lightpath_proto::v1::dataset_service_client::DatasetServiceClient;
use lightpath_proto::v1::kernel_lineage::Origin;
use lightpath_proto::v1::kernel_service_client::KernelServiceClient;
use lightpath_proto::v1::prepare_dataset::{Finalize, Step};
use std::f32::consts::TAU;
use tonic::transport::Channel;
use tonic::{Code, Status};

const PHOTOGRAPHED_MM: [u32; 3] = [4, 5, 6];
const PAIRS: u64 = 6;

pub(crate) fn bench(distance_m: f64) -> SimulatedDisplay {
    let grid = Grid::try_new(48, 64, 8e-6).unwrap();
    let (setup, _) = OpticalSetup::try_new(grid, 515e-9, distance_m).unwrap().planned().unwrap();
    let rail = SimulatedBench {
        seed: 2,
        strength: 0.6,
        rail_tilt_rad: 0.1_f64.to_radians(),
        aberrations_at_m: 5e-3,
        ..SimulatedBench::FAIR
    };
    SimulatedDisplay::draw(setup, None, rail).unwrap()
}

/// Grey levels of a hologram, and its photograph.
pub(crate) fn hologram_and_photo(bench: &SimulatedDisplay, seed: u64) -> (Plane<u16>, Plane<f32>) {
    let range_rad = if seed.is_multiple_of(2) { 6.0 } else { 2.0 };
    let phase = initial_phase(48, 64, range_rad, seed).unwrap();
    let levels = phase.map(|phase| (phase / TAU * 256.0).round().rem_euclid(256.0) as u16);
    let photo = bench.capture(&phase_of_levels(&levels), seed).unwrap().map(|level| f32::from(level) / 255.0);
    (levels, photo)
}

fn phase_of_levels(levels: &Plane<u16>) -> Plane<f32> {
    levels.map(|level| f32::from(level) / 256.0 * TAU)
}

fn kernels(serving: &Serving) -> KernelServiceClient<Channel> {
    KernelServiceClient::new(serving.channel.clone())
}

/// Creates and finalizes the dataset `at-{mm}mm` with photographs at that distance.
pub(crate) async fn create_dataset_at(serving: &Serving, mm: u32) -> String {
    let (bench, name) = (bench(f64::from(mm) / 1e3), format!("datasets/at-{mm}mm"));
    let mut client = DatasetServiceClient::new(serving.channel.clone());
    let dataset = v1::Dataset {
        name: name.clone(),
        display: "displays/lab".into(),
        place: Some(v1::Place::at_m(f64::from(mm) / 1e3)),
        ..Default::default()
    };
    client.create_dataset(v1::CreateDatasetRequest { dataset: Some(dataset) }).await.unwrap();
    for seed in 0..PAIRS {
        let (levels, photo) = hologram_and_photo(&bench, 100 * u64::from(mm) + seed);
        let phase = serving.upload(&pictures::levels_png(&levels, 8).unwrap()).await;
        let photo = serving.upload(&pictures::grey_png_linear(&photo).unwrap()).await;
        let pair = v1::Pair { id: format!("p{seed}"), pattern: phase, photo, ..Default::default() };
        let request = v1::AddPairsRequest { dataset: name.clone(), pairs: vec![pair] };
        client.add_pairs(request).await.unwrap();
    }
    let how = Finalize { keep_alignment: true, ..Default::default() };
    prepare(serving, &name, Step::Finalize(how)).await.unwrap();
    name
}

async fn learn_together(serving: &Serving, datasets: &[String]) -> Result<v1::Job, Status> {
    let learn = v1::LearnKernel { datasets: datasets.to_vec(), degree: Some(4), ..Default::default() };
    let spec = Some(v1::JobSpec { kind: Some(v1::job_spec::Kind::LearnKernel(learn)) });
    let request = v1::SubmitJobRequest { spec, ..Default::default() };
    let mut job = serving.jobs().submit_job(request).await?.into_inner();
    let watched = v1::WatchJobRequest { name: job.name.clone() };
    let mut changes = serving.jobs().watch_job(watched).await?.into_inner();
    while let Some(change) = changes.message().await? {
        job = change;
    }
    Ok(job)
}

async fn interpolate(serving: &Serving, distance_m: f64) -> Result<v1::KernelVersion, Status> {
    let request = v1::InterpolateKernelRequest {
        display: "displays/lab".into(),
        place: Some(v1::Place::at_m(distance_m)),
        ..Default::default()
    };
    Ok(kernels(serving).interpolate_kernel(request).await?.into_inner())
}

async fn report_html(serving: &Serving, name: String) -> String {
    let report = report(serving, &name).await.unwrap();
    String::from_utf8(serving.read(&report.html).await).unwrap()
}

fn loss(bench: &SimulatedDisplay, model: &DisplayModel) -> f64 {
    let engine = Engine::new(model, Detector::Pixel, None).unwrap();
    let region = RegionOfInterest::middle(&bench.setup().grid());
    let one = |seed| {
        let (levels, photo) = hologram_and_photo(bench, seed);
        compare(&engine, &Pair { phase: phase_of_levels(&levels), photo }, region).unwrap().fitted_loss()
    };
    (900..904).map(one).sum()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn interpolated_kernel_predicts_photographs_at_a_new_distance() {
    let serving = Serving::start().await;
    let request = v1::CreateDisplayRequest { display: Some(small_display("lab")) };
    serving.displays().create_display(request).await.unwrap();
    let mut datasets = Vec::new();
    for mm in PHOTOGRAPHED_MM {
        datasets.push(create_dataset_at(&serving, mm).await);
    }
    expect(
        interpolate(&serving, 4.6e-3).await,
        Code::FailedPrecondition,
        "place.distance_m: no kernels of displays/lab",
    );
    let twice = [datasets[0].clone(), datasets[0].clone()];
    let refusal = "spec.learn_kernel.datasets[1] is of 4mm, but another dataset is already";
    expect(learn_together(&serving, &twice).await, Code::InvalidArgument, refusal);

    let job = learn_together(&serving, &datasets).await.unwrap();
    let Some(v1::job_result::Kind::LearnKernel(result)) = job.result.and_then(|result| result.kind) else {
        panic!("{:?}", job.error);
    };
    let learned: Vec<&str> = result.kernels.iter().map(|kernel| kernel.kernel_version.as_str()).collect();
    assert_eq!(learned, [4, 5, 6].map(|mm| format!("displays/lab/kernels/515nm-{mm}mm/versions/1")));
    assert!(result.kernels.iter().map(|kernel| &kernel.dataset).eq(&datasets));
    for metrics in result.kernels.iter().map(|kernel| kernel.metrics.as_ref().unwrap()) {
        assert!(metrics.test_pairs > 0 && metrics.test_loss < 0.2 * metrics.ideal_test_loss, "{metrics:?}");
    }

    let version = interpolate(&serving, 4.6e-3).await.unwrap();
    assert_eq!(version.name, "displays/lab/kernels/515nm-4.6mm/versions/1");
    let Some(Origin::Interpolated(lineage)) = version.lineage.unwrap().origin else { panic!("it was interpolated") };
    assert!(lineage.datasets.iter().map(|dataset| dataset.place).eq([4e-3, 5e-3, 6e-3].map(v1::Place::at_m).map(Some)));
    assert!(lineage.datasets.iter().map(|dataset| &dataset.name).eq(&datasets));
    let listed = kernels(&serving).list_kernels(v1::ListKernelsRequest::default()).await.unwrap().into_inner().kernels;
    let marked: Vec<_> = listed.iter().map(|kernel| (kernel.name.as_str(), kernel.interpolated)).collect();
    assert_eq!(marked.len(), 4);
    assert_eq!(marked.iter().filter(|(_, marked)| *marked).count(), 1);
    assert!(marked.contains(&("displays/lab/kernels/515nm-4.6mm", true)));

    let file = serving.read(&version.artifact).await;
    assert_eq!(kernel_file::origin(&file).unwrap().interpolated_from_m, [4e-3, 5e-3, 6e-3]);
    let (model, _) = kernel_file::decode(&file).unwrap();
    let there = bench(4.6e-3);
    let (found, ideal) = (loss(&there, &model), loss(&there, &DisplayModel::ideal(there.setup())));
    assert!(found < 0.1 * ideal, "{found} against {ideal}");
    let html = report_html(&serving, version.name).await;
    assert!(html.contains("as interpolated") && html.contains("4mm, 5mm, 6mm"));
    assert!(html.contains("Aberrations over the distance") && !html.contains("one standard deviation"));
    let html = report_html(&serving, result.kernels[0].kernel_version.clone()).await;
    assert!(html.contains("as learned") && html.contains("Aberrations over the distance"));
    assert!(
        html.contains("one standard deviation") && html.contains("<polygon"),
        "the report shows the uncertainty of the phase response"
    );

    let beyond = "place.distance_m is 6.5mm, but displays/lab was photographed at 515nm from 4mm to 6mm only";
    expect(interpolate(&serving, 6.5e-3).await, Code::InvalidArgument, beyond);
    let there = "place.distance_m is 5mm, which was photographed; use displays/lab/kernels/515nm-5mm/versions/1";
    expect(interpolate(&serving, 5e-3).await, Code::InvalidArgument, there);
}
