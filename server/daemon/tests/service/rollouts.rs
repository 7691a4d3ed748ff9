//! Tests of promotion gates, aliases, devices and staged rollouts over gRPC and HTTP.

use crate::access::{Guarded, create_token, with_token};
use crate::kernels::{KERNEL, import, kernel};
use crate::manifests::{Answer, curl, store_of};
use crate::serving::{Serving, small_display};
use lightpath_domain::access::Role;
use lightpath_domain::kernel::{Cause, KernelKey, KernelMetrics, KernelModel, NewKernelVersion};
use lightpath_domain::lineage::{KernelLineage, KernelOrigin, Learning};
use lightpath_domain::units::{Distance, Wavelength};
use lightpath_manifest::SignedManifest;
use lightpath_proto::v1;
use lightpath_proto::v1::device_service_client::DeviceServiceClient;
use lightpath_proto::v1::display_service_client::DisplayServiceClient;
use lightpath_proto::v1::fetch_kernel_response::Part;
use lightpath_proto::v1::kernel_service_client::KernelServiceClient;
use lightpath_proto::v1::rollout_service_client::RolloutServiceClient;
use lightpath_store::Promotion;
use tonic::transport::Channel;
use tonic::{Code, Status};

const LAB: &str = "displays/lab";

fn kernels(serving: &Serving) -> KernelServiceClient<Channel> {
    KernelServiceClient::new(serving.channel.clone())
}

fn rollouts(serving: &Serving) -> RolloutServiceClient<Channel> {
    RolloutServiceClient::new(serving.channel.clone())
}

fn devices(serving: &Serving) -> DeviceServiceClient<Channel> {
    DeviceServiceClient::new(serving.channel.clone())
}

/// Asserts that an answer is a refusal with this code, whose message has these words.
fn refused<T: std::fmt::Debug>(answer: Result<T, Status>, code: Code, words: &str) {
    let status = answer.unwrap_err();
    assert!(status.code() == code && status.message().contains(words), "{words}: {status:?}");
}

/// A server with a display and an imported version, and further versions of the same file that were measured to have
/// these losses relative to the ideal kernel.
async fn serving(losses: &[f64]) -> Serving {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let imported = import(&serving, &kernel(64, 0.1), 0.05).await.unwrap();
    add_measured(&serving, &imported, losses).await;
    serving
}

async fn add_measured(serving: &Serving, imported: &v1::KernelVersion, losses: &[f64]) {
    let store = store_of(serving).await;
    let (wavelength, distance) = (Wavelength::from_m(515e-9).unwrap(), Distance::from_m(0.05).unwrap());
    let key = KernelKey { display: "lab".to_owned(), wavelength, distance };
    for &test_loss in losses {
        let metrics = KernelMetrics { test_pairs: 4, test_loss, ideal_test_loss: 1.0, ..KernelMetrics::default() };
        let content = NewKernelVersion {
            model: KernelModel::Smooth,
            artifact: imported.artifact.clone(),
            size_bytes: imported.size_bytes,
            metrics,
            lineage: KernelLineage::of(KernelOrigin::Learned(Learning::default())),
        };
        store.add_kernel_version(&key, content, 1).await.unwrap();
    }
}

async fn promote(serving: &Serving, version: u32, force: bool, reason: &str) -> Result<v1::Kernel, Status> {
    let request = v1::PromoteKernelRequest {
        kernel: KERNEL.into(),
        version,
        force,
        reason: reason.to_owned(),
        ..Default::default()
    };
    Ok(kernels(serving).promote_kernel(request).await?.into_inner())
}

async fn set_gate(serving: &Serving, gate: v1::PromotionGate) -> Result<v1::DisplayGate, Status> {
    let request = v1::SetPromotionGateRequest { display: LAB.into(), gate: Some(gate), reason: "why".into() };
    Ok(kernels(serving).set_promotion_gate(request).await?.into_inner())
}

async fn check(serving: &Serving, version: u32) -> v1::PromotionVerdict {
    let request = v1::CheckPromotionRequest { name: format!("{KERNEL}/versions/{version}") };
    kernels(serving).check_promotion(request).await.unwrap().into_inner()
}

#[tokio::test]
async fn a_version_passes_the_gate_or_is_forced_and_the_history_says_what_failed() {
    let serving = serving(&[0.5, 0.48, 0.4, 1.2]).await;
    promote(&serving, 2, false, "").await.unwrap();
    refused(promote(&serving, 5, false, "").await, Code::FailedPrecondition, "no better than the ideal kernel");
    let gate = v1::PromotionGate {
        loss_reduction_min: Some(0.1),
        test_pairs_min: 4,
        formats: vec!["compact".to_owned()],
        ..Default::default()
    };
    let set = set_gate(&serving, gate.clone()).await.unwrap();
    assert_eq!((set.gate, set.history.len(), set.history[0].reason.as_str()), (Some(gate), 1, "why"));
    let verdict = check(&serving, 3).await;
    let failed: Vec<_> = verdict.checks.iter().filter(|check| !check.passed).map(|check| &check.finding).collect();
    assert!(!verdict.passed && verdict.active_version == Some(2), "{verdict:?}");
    assert!(failed.len() == 1 && failed[0].contains("4.0 % lower; 10 % are required"), "{verdict:?}");
    assert!(check(&serving, 4).await.passed);
    // The imported version was not measured.
    let status = promote(&serving, 1, false, "").await.unwrap_err();
    assert!(status.message().contains("0 test pairs") && status.message().contains("not both"), "{status:?}");
    refused(promote(&serving, 1, true, " ").await, Code::FailedPrecondition, "set force and give a reason");
    promote(&serving, 1, true, "to compare on the bench").await.unwrap();
    let list = v1::ListKernelMovesRequest { kernel: KERNEL.into(), ..Default::default() };
    let moved = kernels(&serving).list_kernel_moves(list).await.unwrap().into_inner().moves.remove(0);
    assert!(moved.overridden.len() == 2 && moved.overridden[0].contains("0 test pairs"), "{moved:?}");
    assert_eq!((moved.alias.as_str(), moved.to_version), ("active", Some(1)));

    let deprecate = |undo| v1::DeprecateKernelVersionRequest {
        name: format!("{KERNEL}/versions/4"),
        reason: "dirty lens".into(),
        undo,
    };
    let deprecated = kernels(&serving).deprecate_kernel_version(deprecate(false)).await.unwrap().into_inner();
    assert_eq!(deprecated.deprecation.unwrap().reason, "dirty lens");
    set_gate(&serving, v1::PromotionGate::default()).await.unwrap();
    refused(promote(&serving, 4, false, "").await, Code::FailedPrecondition, "it is deprecated: dirty lens");
    kernels(&serving).deprecate_kernel_version(deprecate(true)).await.unwrap();
    promote(&serving, 4, false, "").await.unwrap();
    for (gate, problem) in [
        (v1::PromotionGate { formats: vec!["round".into()], ..Default::default() }, "gate.formats is \"round\""),
        (
            v1::PromotionGate { loss_reduction_min: Some(f64::NAN), ..Default::default() },
            "gate.loss_reduction_min is NaN",
        ),
    ] {
        refused(set_gate(&serving, gate).await, Code::InvalidArgument, problem);
    }
    serving.stop().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn of_two_promotions_at_once_one_is_aborted() {
    let serving = serving(&[0.5, 0.4]).await;
    promote(&serving, 1, false, "").await.unwrap();
    let expecting = |version| {
        let (mut kernels, expected) = (kernels(&serving), Some(1));
        async move {
            let request = v1::PromoteKernelRequest {
                kernel: KERNEL.into(),
                version,
                expected_active_version: expected,
                ..Default::default()
            };
            kernels.promote_kernel(request).await
        }
    };
    let (first, second) = tokio::join!(expecting(2), expecting(3));
    let later = if first.is_ok() { second } else { first };
    refused(later, Code::Aborted, "is active now; read the kernel again");
    serving.stop().await.unwrap();
}

#[tokio::test]
async fn forms_that_devices_use_are_required() {
    let serving = serving(&[0.5]).await;
    promote(&serving, 1, false, "").await.unwrap();
    report(&serving, "bench-1", 1, 0).await.unwrap();
    // A dense kernel has no compact form.
    let dense = dense();
    import(&serving, &dense, 0.05).await.unwrap();
    refused(promote(&serving, 3, false, "").await, Code::FailedPrecondition, "it is not available as compact");
    serving.stop().await.unwrap();
}

/// A dense kernel file for the display `lab`.
fn dense() -> Vec<u8> {
    use lightpath_optics::{DisplayModel, Grid, KernelShape, OpticalSetup, Plane};
    let setup = OpticalSetup::try_new(Grid::try_new(48, 64, 8e-6).unwrap(), 515e-9, 0.05).unwrap();
    let ideal = DisplayModel::ideal(setup);
    let free = Plane::from_fn(96, 128, |y, x| num_complex::Complex32::new(1.0, (y * x % 7) as f32));
    let model = DisplayModel { kernel: KernelShape::Bins(free), ..ideal };
    lightpath_media::kernel_file::encode(&model, KernelModel::Dense).unwrap()
}

async fn report(serving: &Serving, device: &str, version: u32, tried_version: u32) -> Result<(), Status> {
    let tried_version = (tried_version > 0).then_some(tried_version);
    let request = v1::ReportDeviceRequest { tried_version, ..report_of(serving, device, version).await };
    devices(serving).report_device(request).await.map(drop)
}

/// The report of a device that uses the compact form of a version.
async fn report_of(serving: &Serving, device: &str, version: u32) -> v1::ReportDeviceRequest {
    let format = v1::KernelFormat::Compact.into();
    let fetch = v1::FetchKernelRequest { kernel: KERNEL.into(), version: Some(version), format, ..Default::default() };
    let mut stream = kernels(serving).fetch_kernel(fetch).await.unwrap().into_inner();
    stream.message().await.unwrap();
    let Some(Part::File(file)) = stream.message().await.unwrap().unwrap().part else { panic!("no file") };
    v1::ReportDeviceRequest {
        name: format!("{LAB}/devices/{device}"),
        kernel: "515nm-50mm".into(),
        version: Some(version),
        format: "compact".into(),
        digest: file.digest,
        generation: 1,
        message: "too noisy".into(),
        agent: "agent 1".into(),
        ..Default::default()
    }
}

/// The version for a device, by its manifest.
async fn version_for(serving: &Serving, device: &str) -> (u32, u64) {
    let answer = curl(serving, &format!("/v1/{KERNEL}/manifest?format=compact&device={device}"), &[]).await;
    assert_eq!(answer.status, 200, "{answer:?}");
    let said = SignedManifest::parse(&answer.body).unwrap().unchecked().clone();
    (said.version, said.generation)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_rollout_goes_to_some_devices_and_halts_when_they_fail() {
    let serving = serving(&[0.5, 0.4]).await;
    promote(&serving, 2, false, "").await.unwrap();
    let start = v1::StartRolloutRequest {
        kernel: KERNEL.into(),
        version: 3,
        group: "first".into(),
        devices_min: Some(2),
        failed_share_max: Some(0.4),
        ..Default::default()
    };
    wrong_plans_are_refused(&serving, &start).await;
    for device in ["bench-1", "bench-2"] {
        let request = v1::SetDeviceGroupRequest { name: format!("{LAB}/devices/{device}"), group: "first".into() };
        devices(&serving).set_device_group(request).await.unwrap();
    }
    let mistyped = v1::StartRolloutRequest { group: "frist".into(), ..start.clone() };
    refused(rollouts(&serving).start_rollout(mistyped).await, Code::InvalidArgument, "its groups are first;");
    let started = rollouts(&serving).start_rollout(start.clone()).await.unwrap().into_inner();
    assert_eq!((started.state(), started.from_version), (v1::rollout::State::Running, Some(2)));
    assert_eq!(started.halting, Some(v1::rollout::Halting::default()), "no device has reported");
    assert_eq!(version_for(&serving, "bench-1").await, (3, 2));
    assert_eq!(version_for(&serving, "bench-3").await, (2, 2));
    assert_eq!(version_for(&serving, "").await, (2, 2));
    refused(promote(&serving, 1, false, "").await, Code::FailedPrecondition, "rollouts/1 is running");
    report(&serving, "bench-1", 3, 0).await.unwrap();
    // Other devices have no say, and a report must be about the version's own file.
    for device in ["bench-3", "bench-4", "bench-5"] {
        report(&serving, device, 2, 3).await.unwrap();
    }
    report(&serving, "bench-2", 2, 0).await.unwrap();
    let get = v1::GetRolloutRequest { name: started.name.clone() };
    let halting = rollouts(&serving).get_rollout(get.clone()).await.unwrap().into_inner().halting.unwrap();
    assert_eq!((halting.devices_known, halting.failures_first, halting.failures_of_all), (2, Some(1), Some(1)));
    let good = report_of(&serving, "bench-2", 3).await;
    let other = v1::ReportDeviceRequest { digest: format!("sha256-{}", "0".repeat(64)), ..good.clone() };
    refused(devices(&serving).report_device(other).await, Code::InvalidArgument, "digest is sha256-000");
    let future = v1::ReportDeviceRequest { generation: 3, ..good.clone() };
    refused(devices(&serving).report_device(future).await, Code::InvalidArgument, "generation is 3");
    let coloured = v1::ReportDeviceRequest { message: "\u{1b}[31m".into(), ..good };
    refused(
        devices(&serving).report_device(coloured).await,
        Code::InvalidArgument,
        "message has the control character",
    );
    report(&serving, "bench-2", 2, 3).await.unwrap();
    let halted = rollouts(&serving).get_rollout(get).await.unwrap().into_inner();
    assert_eq!((halted.state(), halted.devices_passed, halted.devices_failed), (v1::rollout::State::Halted, 1, 1));
    assert_eq!(halted.halting, None);
    assert_eq!(halted.events[1].message, "bench-2 failed: too noisy");
    assert!(halted.events[2].message.contains("1 of 2 devices failed, the last one bench-2"), "{halted:?}");
    assert_eq!(version_for(&serving, "bench-1").await, (2, 3));
    let widen = v1::WidenRolloutRequest { name: started.name, share: 0.5, ..Default::default() };
    refused(rollouts(&serving).widen_rollout(widen).await, Code::FailedPrecondition, "has ended");
    a_rollout_ends_through_the_gate(&serving, start).await;
    serving.stop().await.unwrap();
}

async fn wrong_plans_are_refused(serving: &Serving, start: &v1::StartRolloutRequest) {
    for (request, problem) in [
        (v1::StartRolloutRequest { group: String::new(), ..start.clone() }, "share is 0 and no group is given"),
        (v1::StartRolloutRequest { group: "First".into(), ..start.clone() }, "group is \"First\""),
        (v1::StartRolloutRequest { share: 1.01, ..start.clone() }, "share is 1.01"),
        (start.clone(), "group is \"first\", but no device of displays/lab is in it: it has no groups"),
    ] {
        refused(rollouts(serving).start_rollout(request).await, Code::InvalidArgument, problem);
    }
}

/// Widens a rollout to all devices, and completes it.
async fn a_rollout_ends_through_the_gate(serving: &Serving, start: v1::StartRolloutRequest) {
    let second = rollouts(serving).start_rollout(start).await.unwrap().into_inner();
    let complete = |expected_revision| v1::CompleteRolloutRequest { name: second.name.clone(), expected_revision };
    let widen = v1::WidenRolloutRequest { name: second.name.clone(), share: 1.0, ..Default::default() };
    rollouts(serving).widen_rollout(widen).await.unwrap();
    assert_eq!(version_for(serving, "").await.0, 3);
    // The gate is checked again at the end.
    let deprecate = |undo| v1::DeprecateKernelVersionRequest {
        name: format!("{KERNEL}/versions/3"),
        reason: "burns the panel".into(),
        undo,
    };
    kernels(serving).deprecate_kernel_version(deprecate(false)).await.unwrap();
    let gate = rollouts(serving).complete_rollout(complete(Some(2))).await;
    refused(gate, Code::FailedPrecondition, "any more: it is deprecated: burns the panel");
    kernels(serving).deprecate_kernel_version(deprecate(true)).await.unwrap();
    refused(rollouts(serving).complete_rollout(complete(Some(1))).await, Code::Aborted, "has the revision 2 now");
    rollouts(serving).complete_rollout(complete(Some(2))).await.unwrap();
    let get = v1::GetKernelRequest { name: KERNEL.into() };
    let kernel = kernels(serving).get_kernel(get).await.unwrap().into_inner();
    assert_eq!((kernel.active_version, kernel.rollout.as_str()), (Some(3), ""));
}

async fn post_report(serving: &Serving, device: &str, token: &str, body: &str) -> Answer {
    let authorization = format!("authorization: Bearer {token}");
    let more = ["--header", "content-type: application/json", "--header", &authorization, "--data", body];
    curl(serving, &format!("/v1/{LAB}/devices/{device}:report"), &more).await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_device_reports_for_itself_alone() {
    let guarded = Guarded::start().await;
    let request = v1::CreateDisplayRequest { display: Some(small_display("lab")) };
    let admin = &guarded.tokens["admin"];
    let serving = &guarded.serving;
    DisplayServiceClient::new(serving.channel.clone()).create_display(with_token(admin, request)).await.unwrap();
    let store = guarded.store().await;
    let token = create_token(&store, "bench-7", Role::Firmware, &["lab".to_owned()], None).await;
    let key = KernelKey {
        display: "lab".to_owned(),
        wavelength: Wavelength::from_m(515e-9).unwrap(),
        distance: Distance::from_m(0.05).unwrap(),
    };
    let digest = format!("sha256-{}", "0".repeat(64));
    // Now, because the server removes old artifacts that nothing refers to.
    store.record_artifact(&digest, 1, "", None, store.now_ms()).await.unwrap().unwrap();
    let content = NewKernelVersion {
        model: KernelModel::Smooth,
        artifact: digest.clone(),
        size_bytes: 1,
        metrics: KernelMetrics::default(),
        lineage: KernelLineage::of(KernelOrigin::Learned(Learning::default())),
    };
    store.add_kernel_version(&key, content, 1).await.unwrap();
    let (cause, overridden) = (Cause::default(), Vec::new());
    store.promote(&key, Promotion { version: 1, expected_active: None, cause, overridden }, 2).await.unwrap();

    let body = format!(
        r#"{{"kernel":"515nm-50mm","version":1,"format":"safetensors","digest":"{digest}","generation":"1","agent":"a 1"}}"#
    );
    let done = post_report(serving, "bench-7", &token, &body).await;
    assert_eq!((done.status, done.text().as_str()), (200, "{}"), "{done:?}");
    // Newer firmware reports what this server does not know.
    let newer =
        post_report(serving, "bench-7", &token, &body.replace("\"agent\"", "\"temperatureK\":300,\"agent\"")).await;
    assert_eq!((newer.status, newer.field("lightpath-ignored-fields")), (200, Some("temperatureK")), "{newer:?}");
    let other = post_report(serving, "bench-8", &token, &body).await;
    assert!(other.status == 403 && other.text().contains("stands for the device bench-7"), "{}", other.text());
    for (body, problem) in [
        (body.replace("safetensors", "round"), "format is"),
        (body.replace("515nm-50mm", "515nm-60mm"), "does not exist"),
        (body.replace("\"version\":1", "\"version\":9"), "versions/9 does not exist"),
        (body.replace("n\":\"1\"", "n\":\"18446744073709551615\""), "generation is 18446744073709551615"),
        ("{".to_owned(), "the body is no valid JSON: EOF"),
        (body.replace("a 1\"", &format!("a 1\",\"message\":\"{}\"", "x".repeat(20_000))), "message has 20000 bytes"),
    ] {
        let answer = post_report(serving, "bench-7", &token, &body).await;
        assert!(answer.status >= 400 && answer.text().contains(problem), "{problem}: {}", answer.text());
    }
    let authorization = format!("authorization: Bearer {admin}");
    let listed = curl(serving, &format!("/v1/{LAB}/devices"), &["--header", &authorization]).await;
    let text = listed.text();
    assert!(text.contains("\"generation\":\"1\"") && text.contains("devices/bench-7"), "{text}");
    assert_eq!(text.matches("displays/lab/devices/").count(), 1, "{text}");
    let own = format!("authorization: Bearer {token}");
    let list = curl(serving, &format!("/v1/{LAB}/devices"), &["--header", &own]).await;
    assert_eq!(list.status, 403, "a device does not see the others");
}

#[tokio::test]
async fn aliases_name_versions_and_nearest_distances_are_found() {
    let serving = serving(&[0.5]).await;
    promote(&serving, 1, false, "").await.unwrap();
    let set = |alias: &str, version, expected_version| v1::SetKernelAliasRequest {
        kernel: KERNEL.into(),
        alias: alias.to_owned(),
        version: Some(version),
        expected_version,
        ..Default::default()
    };
    let named = kernels(&serving).set_kernel_alias(set("candidate", 2, Some(0))).await.unwrap().into_inner();
    assert_eq!(named.aliases["candidate"], 2);
    refused(kernels(&serving).set_kernel_alias(set("candidate", 1, Some(0))).await, Code::Aborted, "names version 2");
    for reserved in ["active", "ideal", "latest"] {
        refused(
            kernels(&serving).set_kernel_alias(set(reserved, 1, None)).await,
            Code::InvalidArgument,
            "another meaning",
        );
    }
    refused(
        kernels(&serving).set_kernel_alias(set("2", 1, None)).await,
        Code::InvalidArgument,
        "starting with a letter",
    );
    refused(kernels(&serving).set_kernel_alias(set("x", 9, None)).await, Code::NotFound, "versions/9");

    let nearest = |distance_m| {
        let mut kernels = kernels(&serving);
        async move {
            let request = v1::FindNearestKernelsRequest {
                display: LAB.into(),
                place: Some(v1::Place::at_m(distance_m)),
                ..Default::default()
            };
            let found = kernels.find_nearest_kernels(request).await.unwrap().into_inner();
            found.kernels.into_iter().map(|kernel| kernel.name).collect::<Vec<_>>()
        }
    };
    assert_eq!(nearest(0.05).await, [KERNEL]);
    assert_eq!(nearest(0.06).await, [KERNEL]);
    let answer = curl(&serving, &format!("/v1/{LAB}/kernels:nearest?place.distance_m=0.049"), &[]).await;
    assert!(answer.status == 200 && answer.text().contains(KERNEL), "{}", answer.text());
    let nowhere = curl(&serving, &format!("/v1/{LAB}/kernels:nearest"), &[]).await;
    assert!(nowhere.status == 400 && nowhere.text().contains("distance_m"), "{}", nowhere.text());
    serving.stop().await.unwrap();
}
