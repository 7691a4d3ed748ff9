//! Tests of conversions: each file is made once, by a task that no client ends, and before a version becomes active.

use crate::manifests::curl;
use crate::serving::{Serving, sized_display};
use lightpath_media::kernel_file;
use lightpath_optics::{DisplayModel, Grid, KernelModel, KernelShape, OpticalSetup, SmoothField};
use lightpath_proto::v1;
use lightpath_proto::v1::device_service_client::DeviceServiceClient;
use lightpath_proto::v1::kernel_service_client::KernelServiceClient;
use lightpath_server::config::Config;
use std::time::{Duration, Instant};
use tonic::transport::Channel;
use tonic::{Request, Status};

const HEIGHT_PX: u32 = 384;
const WIDTH_PX: u32 = 512;
/// Time for a conversion on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

/// A server with a display of its own name, of which metrics are counted, and versions of its kernel.
async fn serving(display: &str, versions: u32) -> Serving {
    serving_with(display, versions, |_| {}).await
}

async fn serving_with(display: &str, versions: u32, change: impl FnOnce(&mut Config)) -> Serving {
    let serving = Serving::start_with(change).await;
    let display = sized_display(display, WIDTH_PX, HEIGHT_PX);
    let name = display.name.clone();
    let create = v1::CreateDisplayRequest { display: Some(display) };
    serving.displays().create_display(create).await.unwrap();
    for version in 1..=versions {
        let artifact = serving.upload(&kernel(0.1 * f64::from(version))).await;
        let import = v1::ImportKernelRequest {
            display: name.clone(),
            place: Some(v1::Place::at_m(0.05)),
            artifact,
            ..Default::default()
        };
        kernels(&serving).import_kernel(import).await.unwrap();
    }
    serving
}

fn kernel(phase: f64) -> Vec<u8> {
    let grid = Grid::try_new(HEIGHT_PX as usize, WIDTH_PX as usize, 8e-6).unwrap();
    let mut errors = SmoothField::flat(3);
    errors.phase[1] = phase;
    let ideal = DisplayModel::ideal(OpticalSetup::try_new(grid, 515e-9, 0.05).unwrap());
    kernel_file::encode(&DisplayModel { kernel: KernelShape::Smooth(errors), ..ideal }, KernelModel::Smooth).unwrap()
}

fn kernels(serving: &Serving) -> KernelServiceClient<Channel> {
    KernelServiceClient::new(serving.channel.clone())
}

fn name(display: &str) -> String {
    format!("displays/{display}/kernels/515nm-50mm")
}

async fn promote(serving: &Serving, display: &str, version: u32) {
    let request = v1::PromoteKernelRequest { kernel: name(display), version, ..Default::default() };
    kernels(serving).promote_kernel(request).await.unwrap();
}

async fn manifest(serving: &Serving, display: &str, limit: Duration) -> Result<v1::KernelManifest, Status> {
    let format = v1::KernelFormat::Complex64.into();
    let request = v1::GetKernelManifestRequest { kernel: name(display), format, ..Default::default() };
    let mut request = Request::new(request);
    request.set_timeout(limit);
    Ok(kernels(serving).get_kernel_manifest(request).await?.into_inner())
}

/// The conversions of a display that have succeeded.
async fn conversions(serving: &Serving, display: &str) -> u32 {
    let text = curl(serving, "/metrics", &[]).await.text();
    let name = format!("lightpath_kernel_conversions_total{{display=\"{display}\",outcome=\"succeeded\"}} ");
    text.lines().find_map(|line| line.strip_prefix(&name)).map_or(0, |count| count.parse().unwrap())
}

/// Waits for a number of conversions without asking for any.
async fn until_converted(serving: &Serving, display: &str, count: u32) {
    let begin = Instant::now();
    while conversions(serving, display).await < count {
        assert!(begin.elapsed() < PATIENCE, "{count} conversions");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn sixty_four_devices_that_ask_at_once_cost_one_conversion() {
    let serving = serving("crowded", 1).await;
    promote(&serving, "crowded", 1).await;
    let asked = (0..64).map(|_| manifest(&serving, "crowded", PATIENCE));
    let manifests: Vec<_> = futures::future::join_all(asked).await.into_iter().map(Result::unwrap).collect();
    assert!(manifests.iter().all(|manifest| manifest.digest == manifests[0].digest));
    assert_eq!(conversions(&serving, "crowded").await, 1);
    serving.stop().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_conversion_goes_on_when_its_client_leaves() {
    let serving = serving("left", 1).await;
    promote(&serving, "left", 1).await;
    let left = manifest(&serving, "left", Duration::from_millis(20)).await;
    assert!(left.is_err(), "a conversion of {WIDTH_PX}×{HEIGHT_PX} px takes longer than this client waits");
    until_converted(&serving, "left", 1).await;
    manifest(&serving, "left", PATIENCE).await.unwrap();
    assert_eq!(conversions(&serving, "left").await, 1);
    serving.stop().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_files_that_devices_use_are_ready_before_a_version_is_active() {
    let serving = serving("ready", 3).await;
    promote(&serving, "ready", 1).await;
    let installed = manifest(&serving, "ready", PATIENCE).await.unwrap();
    let report = v1::ReportDeviceRequest {
        name: "displays/ready/devices/bench-1".into(),
        kernel: "515nm-50mm".into(),
        version: Some(1),
        format: "complex64".into(),
        digest: installed.digest,
        generation: installed.generation,
        ..Default::default()
    };
    DeviceServiceClient::new(serving.channel.clone()).report_device(report).await.unwrap();
    promote(&serving, "ready", 2).await;
    assert_eq!(conversions(&serving, "ready").await, 2, "before the answer");
    let start = v1::StartRolloutRequest { kernel: name("ready"), version: 3, share: 1.0, ..Default::default() };
    let mut rollouts = v1::rollout_service_client::RolloutServiceClient::new(serving.channel.clone());
    let rollout = rollouts.start_rollout(start).await.unwrap().into_inner();
    assert_eq!(conversions(&serving, "ready").await, 3, "before the answer");
    assert_eq!(manifest(&serving, "ready", PATIENCE).await.unwrap().version, 3);
    assert_eq!(conversions(&serving, "ready").await, 3);
    let serving = serving.restart().await;
    assert_eq!(manifest(&serving, "ready", PATIENCE).await.unwrap().version, 3);
    assert_eq!(conversions(&serving, "ready").await, 3, "files survive a restart");
    // Going back does not wait for files that are missing, but begins to make them.
    std::fs::remove_dir_all(serving.config.data_dir.join("conversions")).unwrap();
    let serving = serving.restart().await;
    let halt = v1::HaltRolloutRequest { name: rollout.name, ..Default::default() };
    let mut rollouts = v1::rollout_service_client::RolloutServiceClient::new(serving.channel.clone());
    rollouts.halt_rollout(halt).await.unwrap();
    until_converted(&serving, "ready", 4).await;
    let back =
        v1::RollbackKernelRequest { kernel: name("ready"), expected_active_version: Some(2), ..Default::default() };
    kernels(&serving).rollback_kernel(back).await.unwrap();
    until_converted(&serving, "ready", 5).await;
    serving.stop().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_form_that_takes_too_much_memory_fails_the_gate_and_can_be_forced() {
    let serving = serving_with("large", 1, |config| config.computing_mib_max = 64.0).await;
    let gate = v1::PromotionGate { formats: vec!["complex64".into()], ..Default::default() };
    let gate = v1::SetPromotionGateRequest { display: "displays/large".into(), gate: Some(gate), reason: "why".into() };
    kernels(&serving).set_promotion_gate(gate).await.unwrap();
    let request = v1::PromoteKernelRequest { kernel: name("large"), version: 1, ..Default::default() };
    let refused = kernels(&serving).promote_kernel(request.clone()).await.unwrap_err();
    assert!(refused.message().contains("it is not available as complex64: the call needs"), "{refused:?}");
    let forced = v1::PromoteKernelRequest { force: true, reason: "compact devices alone".into(), ..request };
    kernels(&serving).promote_kernel(forced).await.unwrap();
    serving.stop().await.unwrap();
}
