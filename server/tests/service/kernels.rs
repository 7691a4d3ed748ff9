//! Kernels: imported, fetched, promoted, rolled back, watched.

use crate::serving::{Serving, expect};
use lightpath_optics::{DisplayModel, Grid, KernelShape, OpticalSetup, SmoothField};
use lightpath_proto::v1;
use lightpath_proto::v1::fetch_kernel_response::Part;
use lightpath_proto::v1::kernel_service_client::KernelServiceClient;
use lightpath_server::kernel::KernelModel;
use lightpath_server::kernel_file;
use tonic::transport::Channel;
use tonic::{Code, Status};

const KERNEL: &str = "displays/lab/kernels/515nm-50mm";

fn kernel(width_px: usize, phase: f64) -> Vec<u8> {
    let setup = OpticalSetup::try_new(Grid::try_new(48, width_px, 8e-6).unwrap(), 515e-9, 0.05).unwrap();
    let mut errors = SmoothField::flat(3);
    errors.phase[1] = phase;
    let model = DisplayModel { kernel: KernelShape::Smooth(errors), ..DisplayModel::ideal(setup) };
    kernel_file::encode(&model, KernelModel::Smooth).unwrap()
}

async fn import(serving: &Serving, bytes: &[u8], distance_m: f64) -> Result<v1::KernelVersion, Status> {
    let artifact = serving.upload(bytes).await;
    let request =
        v1::ImportKernelRequest { display: "displays/lab".into(), distance_m, artifact, ..Default::default() };
    Ok(client(serving).import_kernel(request).await?.into_inner())
}

async fn fetch(serving: &Serving, version: u32) -> Result<(v1::KernelVersion, Vec<u8>), Status> {
    let request = v1::FetchKernelRequest { kernel: KERNEL.into(), version };
    let mut stream = client(serving).fetch_kernel(request).await?.into_inner();
    let Some(Part::Version(version)) = stream.message().await?.unwrap().part else { panic!("no version first") };
    let mut bytes = Vec::new();
    while let Some(message) = stream.message().await? {
        let Some(Part::Chunk(chunk)) = message.part else { panic!("no chunk") };
        bytes.extend_from_slice(&chunk);
    }
    Ok((version, bytes))
}

async fn promote(serving: &Serving, version: u32, expected: Option<u32>) -> Result<v1::Kernel, Status> {
    let request = v1::PromoteKernelRequest {
        kernel: KERNEL.into(),
        version,
        reason: "looks better".into(),
        expected_active_version: expected,
        force: false,
    };
    Ok(client(serving).promote_kernel(request).await?.into_inner())
}

fn client(serving: &Serving) -> KernelServiceClient<Channel> {
    KernelServiceClient::new(serving.channel.clone())
}

#[tokio::test]
async fn versions_are_imported_promoted_fetched_and_rolled_back() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let files = [kernel(64, 0.1), kernel(64, 0.2)];
    for (file, number) in files.iter().zip(1..) {
        let version = import(&serving, file, 0.05).await.unwrap();
        assert_eq!(version.name, format!("{KERNEL}/versions/{number}"));
        assert_eq!((version.version, version.size_bytes), (number, file.len() as u64));
    }
    let request = v1::WatchKernelRequest { name: KERNEL.into() };
    let mut watched = client(&serving).watch_kernel(request).await.unwrap().into_inner();
    assert_eq!(watched.message().await.unwrap().unwrap().active_version, 0);
    expect(
        fetch(&serving, 0).await,
        Code::FailedPrecondition,
        "no version of displays/lab/kernels/515nm-50mm is active",
    );

    assert_eq!(promote(&serving, 1, Some(0)).await.unwrap().active_version, 1);
    assert_eq!(watched.message().await.unwrap().unwrap().active_version, 1);
    expect(promote(&serving, 2, Some(0)).await, Code::Aborted, "");
    expect(promote(&serving, 3, None).await, Code::NotFound, "");
    assert_eq!(promote(&serving, 2, Some(1)).await.unwrap().active_version, 2);
    let (version, bytes) = fetch(&serving, 0).await.unwrap();
    assert_eq!((version.version, version.active, &bytes), (2, true, &files[1]));
    assert_eq!(fetch(&serving, 1).await.unwrap().1, files[0]);

    let request = v1::RollbackKernelRequest { kernel: KERNEL.into(), reason: "worse".into() };
    assert_eq!(client(&serving).rollback_kernel(request).await.unwrap().into_inner().active_version, 1);
    let request = v1::ListKernelMovesRequest { kernel: KERNEL.into(), page_size: 2, ..Default::default() };
    let page = client(&serving).list_kernel_moves(request.clone()).await.unwrap().into_inner();
    let moves: Vec<_> = page.moves.iter().map(|it| (it.from_version, it.to_version, it.rollback)).collect();
    assert_eq!(moves, [(2, 1, true), (1, 2, false)]);
    let request = v1::ListKernelMovesRequest { page_token: page.next_page_token, ..request };
    assert_eq!(client(&serving).list_kernel_moves(request).await.unwrap().into_inner().moves.len(), 1);
    let versions = v1::ListKernelVersionsRequest { kernel: KERNEL.into(), ..Default::default() };
    let versions = client(&serving).list_kernel_versions(versions).await.unwrap().into_inner().versions;
    assert_eq!(versions.iter().map(|it| (it.version, it.active)).collect::<Vec<_>>(), [(2, false), (1, true)]);
}

#[tokio::test]
async fn only_kernels_of_just_this_display_are_imported() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let good = kernel(64, 0.1);
    expect(import(&serving, &good, 0.051).await, Code::InvalidArgument, "artifact is a kernel for 64×48 px");
    expect(import(&serving, &kernel(63, 0.1), 0.05).await, Code::InvalidArgument, "artifact is a kernel for 63×48 px");
    expect(import(&serving, &good[..good.len() - 1], 0.05).await, Code::InvalidArgument, "artifact (sha256-");
    expect(import(&serving, b"text", 0.05).await, Code::InvalidArgument, "artifact (sha256-");
    let listed = client(&serving).list_kernels(v1::ListKernelsRequest::default()).await.unwrap().into_inner();
    assert_eq!(listed.kernels, []);
}
