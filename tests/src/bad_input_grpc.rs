use crate::material::{DISTANCE_M, declare, display, hologram, png, png_header, request, target};
use crate::server::TestServer;
use lightpath::v1::display_service_client::DisplayServiceClient;
use lightpath::v1::optimize_hologram::{
    ImagePlane, InitialPhase,
    initial_phase::{Kind, Random},
};
use lightpath::v1::{self, OptimizeHologram, job_service_client::JobServiceClient};
use lightpath::v1::{dataset_service_client::DatasetServiceClient, kernel_service_client::KernelServiceClient};
use lightpath::{digest_of, names};
use tonic::{Code, Response, Status};
use tonic_types::StatusExt as _;

/// Starts a server with the display `lab`.
async fn start() -> TestServer {
    let server = TestServer::start().await;
    declare(&server.client, "lab", 64, 48).await;
    server
}

/// Checks that a call was refused with this code, a message that contains all of `signs`, and a reason for programs.
#[track_caller]
fn assert_refused<T: std::fmt::Debug>(answer: Result<Response<T>, Status>, code: Code, signs: &[&str]) {
    let status = answer.unwrap_err();
    assert_eq!(status.code(), code, "{status:?}");
    for sign in signs {
        assert!(status.message().contains(sign), "{sign:?} is not in {:?}", status.message());
    }
    let info = status.get_details_error_info().expect("every refusal has a reason");
    assert_eq!(info.domain, "lightpath");
    assert!(!info.reason.is_empty());
    if code == Code::InvalidArgument && info.reason == "INVALID_FIELD" {
        let fields = status.get_details_bad_request().expect("a refused field is named").field_violations;
        assert_eq!(fields.len(), 1, "{fields:?}");
    }
}

/// Checks that the server still answers and has stored no job and no incomplete file.
async fn assert_unharmed(server: &TestServer) {
    server.assert_answers().await;
    server.assert_tidy();
    let jobs = server.client.list_jobs(v1::ListJobsRequest::default()).await.unwrap().jobs;
    assert_eq!(jobs, [], "a refused job was stored");
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_targets_are_refused() {
    let server = start().await;
    let mut jobs = JobServiceClient::new(server.channel());
    let whole = target(64, 48, 0);
    for (bytes, signs) in [
        (whole[..whole.len() / 2].to_vec(), ["PNG", "cut off"]),
        (whole[..40].to_vec(), ["PNG", ""]),
        (Vec::new(), ["empty", "PNG, JPEG, TIFF, BMP or .npy"]),
        (b"This is a letter, not a picture.".to_vec(), ["not a readable picture", "PNG, JPEG, TIFF, BMP or .npy"]),
        (png_header(60_000, 60_000), ["60000×60000", "at most"]),
        (png(1, 1, |_, _| 255), ["1×1", "at least"]),
        (png(64, 48, |_, _| 0), ["black", "must have light"]),
    ] {
        let digest = server.client.upload_bytes(bytes).await.unwrap();
        let answer = jobs.submit_job(request(hologram("lab", &digest, 5, 1), "")).await;
        assert_refused(
            answer,
            Code::InvalidArgument,
            &[&["spec.optimize_hologram.planes[0].target"], &signs[..]].concat(),
        );
    }
    let absent = digest_of(b"never uploaded");
    let answer = jobs.submit_job(request(hologram("lab", &absent, 5, 1), "")).await;
    assert_refused(answer, Code::NotFound, &["spec.optimize_hologram.planes[0].target", "upload it first"]);
    let answer = jobs.submit_job(request(hologram("lab", "../../etc/passwd", 5, 1), "")).await;
    assert_refused(answer, Code::InvalidArgument, &["spec.optimize_hologram.planes[0].target", "sha256-"]);
    assert_unharmed(&server).await;
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_specs_are_refused() {
    let server = start().await;
    let mut jobs = JobServiceClient::new(server.channel());
    let picture = server.client.upload_bytes(target(64, 48, 0)).await.unwrap();
    let good = || hologram("lab", &picture, 5, 1);
    let at = |distance_m| {
        let plane = ImagePlane { place: Some(v1::Place::at_m(distance_m)), ..good().planes[0].clone() };
        OptimizeHologram { planes: vec![plane], ..good() }
    };
    let range = Random { range_rad: Some(-1.0) };
    let seventh = v1::KernelChoice::version("displays/lab/kernels/515nm-50mm/versions/7");
    let region = |x_px, width_px| v1::Region { x_px, y_px: 0, width_px, height_px: 48 };
    let cases: [(OptimizeHologram, Code, &[&str]); 14] = [
        (at(f64::NAN), Code::InvalidArgument, &["distance_m", "NaN"]),
        (at(f64::INFINITY), Code::InvalidArgument, &["distance_m", "inf"]),
        (at(0.0), Code::InvalidArgument, &["distance_m is 0"]),
        (at(150.0), Code::InvalidArgument, &["distance_m is 150", "±10 m"]),
        (
            OptimizeHologram { wavelengths_m: vec![633e-9], ..good() },
            Code::InvalidArgument,
            &["wavelengths_m", "515nm"],
        ),
        (OptimizeHologram { learning_rate: Some(f64::NAN), ..good() }, Code::InvalidArgument, &["learning_rate"]),
        (OptimizeHologram { learning_rate: Some(-1.0), ..good() }, Code::InvalidArgument, &["learning_rate"]),
        (OptimizeHologram { iterations: Some(1_000_000), ..good() }, Code::InvalidArgument, &["iterations", "10000"]),
        (
            OptimizeHologram { initial_phase: Some(InitialPhase { kind: Some(Kind::Random(range)) }), ..good() },
            Code::InvalidArgument,
            &["initial_phase.random.range_rad"],
        ),
        (OptimizeHologram { region: Some(region(u32::MAX, 2)), ..good() }, Code::InvalidArgument, &["region"]),
        (OptimizeHologram { region: Some(region(0, 0)), ..good() }, Code::InvalidArgument, &["region"]),
        (OptimizeHologram { method: 99, ..good() }, Code::InvalidArgument, &["method", "99"]),
        (OptimizeHologram { display: names::display("nowhere"), ..good() }, Code::NotFound, &["display", "nowhere"]),
        (OptimizeHologram { kernel: Some(seventh), ..good() }, Code::NotFound, &["kernel.version", "7"]),
    ];
    for (spec, code, signs) in cases {
        assert_refused(jobs.submit_job(request(spec, "")).await, code, signs);
    }
    let answer = jobs.submit_job(v1::SubmitJobRequest::default()).await;
    assert_refused(answer, Code::InvalidArgument, &["spec"]);
    let answer = jobs.submit_job(v1::SubmitJobRequest { priority: 101, ..request(good(), "") }).await;
    assert_refused(answer, Code::InvalidArgument, &["priority is 101"]);
    let answer = jobs.submit_job(request(good(), &"x".repeat(129))).await;
    assert_refused(answer, Code::InvalidArgument, &["request_id", "128"]);
    assert_refused(jobs.get_job(v1::GetJobRequest { name: "jobs/none".into() }).await, Code::NotFound, &["jobs/none"]);
    assert_unharmed(&server).await;
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_displays_are_refused() {
    let server = start().await;
    let mut displays = DisplayServiceClient::new(server.channel());
    let good = || display("new", 64, 48);
    let with = |modulator| v1::Display { modulator: Some(modulator), ..good() };
    let mut cases = Vec::new();
    for pixel_pitch_m in [0.0, -8e-6, f64::NAN, 8.0] {
        cases.push((with(v1::Modulator::of_phase(64, 48, pixel_pitch_m)), "display.modulator.pixel_pitch_x_m"));
    }
    for width_px in [0, 15, 8193, u32::MAX] {
        cases.push((with(v1::Modulator::of_phase(width_px, 48, 8e-6)), "display.modulator.width_px"));
    }
    for wavelengths_m in [vec![], vec![0.0], vec![f64::NAN], vec![515.0], vec![515e-9, 515e-9]] {
        cases.push((v1::Display { wavelengths_m, ..good() }, "display.wavelengths_m"));
    }
    for name in ["", "new", "displays/", "displays/New", "displays/../x", "displays/1st", "datasets/new"] {
        cases.push((v1::Display { name: name.into(), ..good() }, "display.name"));
    }
    let ok = v1::Modulator::of_phase(64, 48, 8e-6);
    cases.push((with(v1::Modulator { bit_depth: Some(17), ..ok.clone() }), "display.modulator.bit_depth"));
    cases.push((v1::Display { carrier: 9, ..good() }, "display.carrier"));
    cases.push((v1::Display { notes: "x".repeat(4097), ..good() }, "display.notes"));
    let with_nan = (0..256).map(|level| if level == 7 { f64::NAN } else { 0.02 * f64::from(level) }).collect();
    for response_rad in [vec![0.0; 255], with_nan, vec![0.0; 256]] {
        let kind = Some(v1::modulator::Kind::Phase(v1::PhaseModulator { response_rad }));
        cases.push((with(v1::Modulator { kind, ..ok.clone() }), "display.modulator.phase.response_rad"));
    }
    for (display, field) in cases {
        let answer = displays.create_display(v1::CreateDisplayRequest { display: Some(display) }).await;
        assert_refused(answer, Code::InvalidArgument, &[field]);
    }
    let answer = displays.create_display(v1::CreateDisplayRequest { display: None }).await;
    assert_refused(answer, Code::InvalidArgument, &["display"]);
    let other = display("lab", 128, 48);
    let answer = displays.create_display(v1::CreateDisplayRequest { display: Some(other) }).await;
    assert_refused(answer, Code::AlreadyExists, &["displays/lab"]);
    let answer = displays.get_display(v1::GetDisplayRequest { name: names::display("nowhere") }).await;
    assert_refused(answer, Code::NotFound, &["displays/nowhere"]);
    let listed = displays.list_displays(v1::ListDisplaysRequest::default()).await.unwrap().into_inner().displays;
    assert_eq!(listed.len(), 1, "a refused display was stored");
    assert_unharmed(&server).await;
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_pairs_and_datasets_are_refused() {
    let server = start().await;
    let mut datasets = DatasetServiceClient::new(server.channel());
    let mut jobs = JobServiceClient::new(server.channel());
    let dataset = v1::Dataset {
        name: names::dataset("bench"),
        display: names::display("lab"),
        place: Some(v1::Place::at_m(DISTANCE_M)),
        ..Default::default()
    };
    let unknown = v1::Dataset { display: names::display("nowhere"), ..dataset.clone() };
    let answer = datasets.create_dataset(v1::CreateDatasetRequest { dataset: Some(unknown) }).await;
    assert_refused(answer, Code::NotFound, &["displays/nowhere"]);
    datasets.create_dataset(v1::CreateDatasetRequest { dataset: Some(dataset) }).await.unwrap();

    let phase = server.client.upload_bytes(png(64, 48, |x, y| (x * y) as u8)).await.unwrap();
    let photo = server.client.upload_bytes(png(64, 48, |x, y| (x + y) as u8)).await.unwrap();
    let small = server.client.upload_bytes(png(63, 48, |x, y| (x + y) as u8)).await.unwrap();
    let text = server.client.upload_bytes(*b"no photograph at all").await.unwrap();
    let absent = digest_of(b"never uploaded");
    for (phase, photo, code, signs) in [
        (&phase, &small, Code::InvalidArgument, ["pairs[0].photo", "63×48", "64×48"]),
        (&small, &photo, Code::InvalidArgument, ["pairs[0].pattern", "63×48", "64×48"]),
        (&phase, &text, Code::InvalidArgument, ["pairs[0].photo", "not a readable picture", ""]),
        (&absent, &photo, Code::NotFound, ["pairs[0].pattern", "upload it first", ""]),
        (&String::new(), &photo, Code::InvalidArgument, ["pairs[0].pattern is empty", "", ""]),
        (&phase, &String::new(), Code::InvalidArgument, ["pairs[0].photo is empty", "", ""]),
    ] {
        let pair = v1::Pair { id: "p1".into(), pattern: phase.clone(), photo: photo.clone(), ..Default::default() };
        let answer =
            datasets.add_pairs(v1::AddPairsRequest { dataset: names::dataset("bench"), pairs: vec![pair] }).await;
        assert_refused(answer, code, &signs);
    }
    for (test_fraction, code, sign) in
        [(0.2, Code::FailedPrecondition, "datasets/bench"), (f64::NAN, Code::InvalidArgument, "test_fraction")]
    {
        let finalize = v1::prepare_dataset::Finalize { test_fraction: Some(test_fraction), ..Default::default() };
        let step = Some(v1::prepare_dataset::Step::Finalize(finalize));
        let prepare = v1::PrepareDataset { dataset: names::dataset("bench"), step };
        let spec = Some(lightpath::job_spec(v1::job_spec::Kind::PrepareDataset(prepare)));
        let answer = jobs.submit_job(v1::SubmitJobRequest { spec, ..Default::default() }).await;
        assert_refused(answer, code, &[sign]);
    }

    for (name, code) in [("bench", Code::FailedPrecondition), ("nowhere", Code::NotFound)] {
        let learn = v1::LearnKernel { datasets: vec![names::dataset(name)], ..Default::default() };
        let spec = Some(lightpath::job_spec(v1::job_spec::Kind::LearnKernel(learn)));
        let answer = jobs.submit_job(v1::SubmitJobRequest { spec, ..Default::default() }).await;
        assert_refused(answer, code, &[&format!("datasets/{name}")]);
    }
    let stored = server.client.get_dataset(v1::GetDatasetRequest { name: names::dataset("bench") }).await.unwrap();
    assert_eq!((stored.pair_count, stored.digest.as_str()), (0, ""));
    assert_unharmed(&server).await;
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn unknown_kernels_are_not_found() {
    let server = start().await;
    let mut kernels = KernelServiceClient::new(server.channel());
    let kernel = "displays/lab/kernels/515nm-50mm".to_owned();
    let fetch = v1::FetchKernelRequest { kernel: kernel.clone(), version: Some(3), ..Default::default() };
    assert_refused(kernels.fetch_kernel(fetch).await, Code::NotFound, &[&kernel]);
    let promote = v1::PromoteKernelRequest { kernel: kernel.clone(), version: 3, ..Default::default() };
    assert_refused(kernels.promote_kernel(promote).await, Code::NotFound, &[&kernel]);
    let name = names::kernel_version(&kernel, 3);
    assert_refused(kernels.get_kernel_version(v1::GetKernelVersionRequest { name }).await, Code::NotFound, &[&kernel]);
    for name in ["", "kernels/x", "displays/lab/kernels/515-150", "displays/lab/kernels/515nm-150mm/versions/1"] {
        let answer = kernels.get_kernel(v1::GetKernelRequest { name: name.into() }).await;
        assert_refused(answer, Code::InvalidArgument, &["name"]);
    }
    let artifact = server.client.upload_bytes(*b"no safetensors").await.unwrap();
    let display = names::display("lab");
    let import =
        v1::ImportKernelRequest { display, place: Some(v1::Place::at_m(DISTANCE_M)), artifact, ..Default::default() };
    assert_refused(kernels.import_kernel(import).await, Code::InvalidArgument, &["artifact"]);
    assert_unharmed(&server).await;
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn uploads_that_do_not_match_their_digest_are_refused_and_not_stored() {
    use lightpath::v1::artifact_service_client::ArtifactServiceClient;
    use lightpath::v1::write_artifact_request::Part;
    let server = start().await;
    let mut artifacts = ArtifactServiceClient::new(server.channel());
    let part = |part| v1::WriteArtifactRequest { part: Some(part) };
    let first =
        |digest: String, size_bytes| part(Part::Start(v1::WriteArtifactStart { digest, size_bytes, offset_bytes: 0 }));
    let chunk = |bytes: &'static [u8]| part(Part::Chunk(bytes.into()));
    let digest = digest_of(b"the content");
    for messages in [
        vec![first(digest.clone(), 11), chunk(b"THE CONTENT")],
        vec![first(digest.clone(), 5), chunk(b"the content")],
        vec![first("sha256-short".into(), 11), chunk(b"the content")],
        vec![chunk(b"the content")],
        vec![first(digest.clone(), 11), first(digest.clone(), 11)],
        vec![first(digest.clone(), u64::MAX), chunk(b"the content")],
        vec![],
    ] {
        let answer = artifacts.write_artifact(futures::stream::iter(messages)).await;
        let status = answer.unwrap_err();
        assert!(matches!(status.code(), Code::InvalidArgument | Code::ResourceExhausted), "{status:?}");
    }
    let get = v1::GetArtifactRequest { digest };
    assert_refused(artifacts.get_artifact(get).await, Code::NotFound, &["sha256-"]);
    server.assert_answers().await;
    server.stop().await;
}
