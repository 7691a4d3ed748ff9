//! Tests of kernels: import, promotion, rollback, fetch and reports.

use crate::jobs::submit;
use crate::preparing;
use crate::serving::{Serving, expect, small_display};
use lightpath_artifacts::digest_of;
use lightpath_domain::kernel::KernelModel;
use lightpath_media::kernel_file;
use lightpath_optics::{DisplayModel, Grid, KernelShape, OpticalSetup, SmoothField};
use lightpath_proto::v1::fetch_kernel_response::Part;
use lightpath_proto::v1::kernel_lineage::Origin;
use lightpath_proto::v1::kernel_service_client::KernelServiceClient;
use lightpath_proto::v1::{self, job_spec};
use num_complex::Complex64;
use tonic::transport::Channel;
use tonic::{Code, Status};

pub(crate) const KERNEL: &str = "displays/lab/kernels/515nm-50mm";

/// A kernel file for a display of 48 rows at 50 mm.
pub(crate) fn kernel(width_px: usize, phase: f64) -> Vec<u8> {
    let setup = OpticalSetup::try_new(Grid::try_new(48, width_px, 8e-6).unwrap(), 515e-9, 0.05).unwrap();
    let mut errors = SmoothField::flat(3);
    errors.phase[1] = phase;
    let model = DisplayModel { kernel: KernelShape::Smooth(errors), ..DisplayModel::ideal(setup) };
    kernel_file::encode(&model, KernelModel::Smooth).unwrap()
}

/// Stores a kernel file as the next version.
pub(crate) async fn import(serving: &Serving, bytes: &[u8], distance_m: f64) -> Result<v1::KernelVersion, Status> {
    let artifact = serving.upload(bytes).await;
    let request = v1::ImportKernelRequest {
        display: "displays/lab".into(),
        place: Some(v1::Place::at_m(distance_m)),
        artifact,
        ..Default::default()
    };
    Ok(client(serving).import_kernel(request).await?.into_inner())
}

async fn fetch(serving: &Serving, version: u32) -> Result<(v1::KernelVersion, Vec<u8>), Status> {
    fetch_version(serving, KERNEL, version).await
}

/// Fetches a version of a kernel and its file.
pub(crate) async fn fetch_version(
    serving: &Serving,
    kernel: &str,
    version: u32,
) -> Result<(v1::KernelVersion, Vec<u8>), Status> {
    let request = v1::FetchKernelRequest {
        kernel: kernel.into(),
        version: (version > 0).then_some(version),
        ..Default::default()
    };
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

pub(crate) fn client(serving: &Serving) -> KernelServiceClient<Channel> {
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
    assert_eq!(watched.message().await.unwrap().unwrap().active_version, None);
    expect(
        fetch(&serving, 0).await,
        Code::FailedPrecondition,
        "no version of displays/lab/kernels/515nm-50mm is active",
    );

    assert_eq!(promote(&serving, 1, Some(0)).await.unwrap().active_version, Some(1));
    assert_eq!(watched.message().await.unwrap().unwrap().active_version, Some(1));
    expect(promote(&serving, 2, Some(0)).await, Code::Aborted, "");
    expect(promote(&serving, 3, None).await, Code::NotFound, "");
    assert_eq!(promote(&serving, 2, Some(1)).await.unwrap().active_version, Some(2));
    let (version, bytes) = fetch(&serving, 0).await.unwrap();
    assert_eq!((version.version, version.active, &bytes), (2, true, &files[1]));
    assert_eq!(fetch(&serving, 1).await.unwrap().1, files[0]);

    let request =
        v1::RollbackKernelRequest { kernel: KERNEL.into(), reason: "worse".into(), expected_active_version: None };
    let answer = client(&serving).rollback_kernel(request.clone()).await;
    expect(answer, Code::InvalidArgument, "expected_active_version is not set");
    let request = v1::RollbackKernelRequest { expected_active_version: Some(2), ..request };
    assert_eq!(client(&serving).rollback_kernel(request.clone()).await.unwrap().into_inner().active_version, Some(1));
    expect(client(&serving).rollback_kernel(request).await, Code::Aborted, "version 1 of displays/");
    let request = v1::ListKernelMovesRequest { kernel: KERNEL.into(), page_size: 2, ..Default::default() };
    let page = client(&serving).list_kernel_moves(request.clone()).await.unwrap().into_inner();
    let moves: Vec<_> = page.moves.iter().map(|entry| (entry.from_version, entry.to_version, entry.rollback)).collect();
    assert_eq!(moves, [(Some(2), Some(1), true), (Some(1), Some(2), false)]);
    let request = v1::ListKernelMovesRequest { page_token: page.next_page_token, ..request };
    assert_eq!(client(&serving).list_kernel_moves(request).await.unwrap().into_inner().moves.len(), 1);
    let versions = v1::ListKernelVersionsRequest { kernel: KERNEL.into(), ..Default::default() };
    let versions = client(&serving).list_kernel_versions(versions).await.unwrap().into_inner().versions;
    assert_eq!(versions.iter().map(|entry| (entry.version, entry.active)).collect::<Vec<_>>(), [(2, false), (1, true)]);
}

#[tokio::test]
async fn kernels_of_other_displays_are_not_imported() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let good = kernel(64, 0.1);
    expect(import(&serving, &good, 0.051).await, Code::InvalidArgument, "artifact is a kernel for 64×48 px");
    expect(import(&serving, &kernel(63, 0.1), 0.05).await, Code::InvalidArgument, "artifact is a kernel for 63×48 px");
    expect(import(&serving, &good[..good.len() - 1], 0.05).await, Code::InvalidArgument, "artifact (sha256-");
    expect(import(&serving, b"text", 0.05).await, Code::InvalidArgument, "artifact (sha256-");
    let filter = v1::OrderFilter { height: Some(0.5), ..Default::default() };
    let orders = Some(v1::display::Orders::OrderFilter(filter));
    let display = Some(v1::Display { orders, ..small_display("relay") });
    serving.displays().create_display(v1::CreateDisplayRequest { display }).await.unwrap();
    let artifact = serving.upload(&good).await;
    let (display, wavelength_m) = ("displays/relay".to_owned(), 515e-9);
    let request = v1::ImportKernelRequest {
        display,
        wavelength_m: Some(wavelength_m),
        place: Some(v1::Place::at_m(0.05)),
        artifact,
        ..Default::default()
    };
    let start = "artifact is a kernel of a display that shows the whole first order, but displays/relay shows the first \
                 order through a filter of 1×0.5 orders";
    expect(client(&serving).import_kernel(request).await, Code::InvalidArgument, start);
    let listed = client(&serving).list_kernels(v1::ListKernelsRequest::default()).await.unwrap().into_inner();
    assert_eq!(listed.kernels, []);
}

async fn fetch_as(
    serving: &Serving,
    version: u32,
    format: v1::KernelFormat,
) -> Result<(v1::KernelFile, Vec<u8>), Status> {
    let request = v1::FetchKernelRequest {
        kernel: KERNEL.into(),
        version: (version > 0).then_some(version),
        format: format.into(),
        offset_bytes: 0,
    };
    let mut stream = client(serving).fetch_kernel(request).await?.into_inner();
    let Some(Part::Version(_)) = stream.message().await?.unwrap().part else { panic!("no version first") };
    let Some(Part::File(file)) = stream.message().await?.unwrap().part else { panic!("no file second") };
    let mut bytes = Vec::new();
    while let Some(message) = stream.message().await? {
        let Some(Part::Chunk(chunk)) = message.part else { panic!("no chunk") };
        bytes.extend_from_slice(&chunk);
    }
    assert_eq!((&digest_of(&bytes), bytes.len() as u64), (&file.digest, file.size_bytes));
    Ok((file, bytes))
}

#[tokio::test]
async fn every_format_is_fetched_and_imported_again() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    import(&serving, &kernel(64, 0.3), 0.05).await.unwrap();
    // At this distance the band limit leaves H zero outside the inner half of the band, so the published form has all
    // of it.
    let array = vec!["parameters", "precision"];
    for (format, size, error, losses) in [
        (v1::KernelFormat::Compact, 60 + 4 * 18 + 4, 1e-6, vec!["precision"]),
        (v1::KernelFormat::Complex64, 128 + 8 * 96 * 128, 1e-6, array.clone()),
        (v1::KernelFormat::F16, 128 + 4 * 96 * 128, 1e-3, array.clone()),
        (v1::KernelFormat::Npy, 128 + 8 * 48 * 64, 1e-6, array.clone()),
        (v1::KernelFormat::Pt, 0, 1e-6, array),
        (v1::KernelFormat::Npz, 0, 0.0, vec![]),
    ] {
        let (file, bytes) = fetch_as(&serving, 1, format).await.unwrap();
        assert!(size == 0 || bytes.len() == size, "{format:?}: {} bytes", bytes.len());
        assert!(file.relative_error <= error, "{format:?}: {}", file.relative_error);
        assert_eq!(file.losses.iter().map(|loss| &loss.name).collect::<Vec<_>>(), losses, "{format:?}");
        assert_eq!(fetch_as(&serving, 1, format).await.unwrap().0, file, "a kept conversion says the same");
        let imported = import(&serving, &bytes, 0.05).await.unwrap();
        let is_whole = matches!(format, v1::KernelFormat::Compact | v1::KernelFormat::Npz);
        assert_eq!(imported.model() == v1::KernelModel::Smooth, is_whole, "{format:?}");
        let Some(Origin::Imported(from)) = imported.lineage.unwrap().origin else { panic!("{format:?}") };
        assert_eq!((from.format(), &from.artifact), (format, &file.digest));
        let note = "the file does not hold source, crosstalk, uneven response, light blur";
        assert_eq!(from.note.starts_with(note), !is_whole, "{from:?}");
        // The server stores the native format, which can be fetched and read.
        let (_, native) = fetch(&serving, imported.version).await.unwrap();
        kernel_file::decode(&native).unwrap();
        if format == v1::KernelFormat::Npz {
            assert_eq!(native, kernel(64, 0.3), "an archive restores the kernel exactly");
        }
    }
    // Kernels imported from arrays have a value for each frequency. Such a kernel has no compact form.
    expect(
        fetch_as(&serving, 4, v1::KernelFormat::Compact).await,
        Code::FailedPrecondition,
        "format: a kernel with a value",
    );
}

#[tokio::test]
async fn two_versions_are_compared_part_by_part_with_numbers_and_units() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let ideal = DisplayModel::ideal(OpticalSetup::try_new(Grid::try_new(48, 64, 8e-6).unwrap(), 515e-9, 0.05).unwrap());
    let bright = DisplayModel { zero_order: Complex64::new(0.03, 0.04), gain: 1.25, ..ideal };
    import(&serving, &kernel(64, 0.3), 0.05).await.unwrap();
    import(&serving, &kernel_file::encode(&bright, KernelModel::Display).unwrap(), 0.05).await.unwrap();
    let [first, second] = [1, 2].map(|number| format!("{KERNEL}/versions/{number}"));
    let request = v1::CompareKernelVersionsRequest { first, second };
    let found = client(&serving).compare_kernel_versions(request).await.unwrap().into_inner();
    let numbers = |part: Option<v1::Part>| {
        let number = |value: v1::PartValue| (value.name, value.unit, value.value.unwrap().value);
        part.map(|part| part.values.into_iter().map(number).collect::<Vec<_>>())
    };
    let parts = found.parts.into_iter().map(|part| (part.name, numbers(part.first), numbers(part.second)));
    let number = |name: &str, unit: &str, value| Some(vec![(name.to_owned(), unit.to_owned(), value)]);
    let expected = [
        ("transfer_function".to_owned(), number("degree", "1", 3.0), None),
        ("zero_order".to_owned(), None, number("amplitude", "fraction", 0.05)),
        ("gain".to_owned(), number("gain", "1", 1.0), number("gain", "1", 1.25)),
    ];
    assert_eq!(parts.collect::<Vec<_>>(), expected);
}

#[tokio::test]
async fn code_in_a_tensor_file_is_refused_and_never_run() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    import(&serving, &kernel(64, 0.3), 0.05).await.unwrap();
    let (_, good) = fetch_as(&serving, 1, v1::KernelFormat::Pt).await.unwrap();
    let name = b"ctorch._utils\n_rebuild_tensor_v2\n";
    let at = good.windows(name.len()).position(|window| window == name).unwrap();
    // The same archive with a pickle that calls another function, and with a correct checksum.
    let mut evil = good.clone();
    let call = b"cposix\nsystem\n(X\x05\x00\x00\x00touchtR.";
    evil[at..at + call.len()].copy_from_slice(call);
    let start = at - 2;
    let length = u32::from_le_bytes(good[18..22].try_into().unwrap()) as usize;
    let crc = crc32(&evil[start..start + length]).to_le_bytes();
    evil[14..18].copy_from_slice(&crc);
    let central = good.windows(4).position(|window| window == b"PK\x01\x02").unwrap();
    evil[central + 16..central + 20].copy_from_slice(&crc);
    let answer = import(&serving, &evil, 0.05).await;
    let message = answer.as_ref().unwrap_err().message().to_owned();
    assert!(message.contains("posix.system") && message.contains("nothing of it was executed"), "{message}");
    expect(answer, Code::InvalidArgument, "artifact (sha256-");
}

/// CRC-32 as in zip files.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
    })
}

#[tokio::test]
async fn report_is_one_file_with_embedded_pictures() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    for phase in [0.3, 0.5] {
        import(&serving, &kernel(64, phase), 0.05).await.unwrap();
    }
    let name = format!("{KERNEL}/versions/2");
    let report = preparing::report(&serving, &name).await.unwrap();
    assert_eq!(preparing::report(&serving, &name).await.unwrap(), report, "a second report has the same bytes");
    let html = serving.read(&report.html).await;
    let html = String::from_utf8(html).unwrap();
    for text in ["astigmatism", "Strehl", "Modulation transfer function", "data:image/png;base64,", "versions/2"] {
        assert!(html.contains(text), "{text}");
    }
    // The report refers to no other file or server.
    for text in ["src=\"http", "href=\"http", "url(", ">NaN", "\"NaN", ",NaN"] {
        assert!(!html.contains(text), "{text}");
    }
    assert!(report.figures.iter().any(|figure| figure.name == "mtf.svg"));
    assert!(serving.read(&report.arrays).await.starts_with(b"PK"));
    let missing = v1::ReportKernel { kernel_version: format!("{KERNEL}/versions/9") };
    let answer = submit(&serving, job_spec::Kind::ReportKernel(missing), "").await;
    expect(answer, Code::NotFound, "spec.report_kernel.kernel_version: displays/lab/kernels/515nm-50mm/versions/9");
}
