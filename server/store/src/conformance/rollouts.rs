//! Tests of aliases, deprecations, promotion gates, devices and staged rollouts.

use super::*;
use crate::{AbortReason, AliasMove, Widening};
use lightpath_domain::device::{InstalledFile, InstalledKernel, Report};
use lightpath_domain::kernel_format::KernelFormat;
use lightpath_domain::promotion::PromotionGate;
use lightpath_domain::reason::PreconditionReason;
use lightpath_domain::rollout::{RolloutPlan, RolloutState, is_in_share};

/// A store with three versions of the kernel, of which the first is active.
async fn with_versions() -> (Store, TestDatabase) {
    let (store, folder) = store().await;
    record(&store, 5).await;
    for version in 1..=3 {
        store.add_kernel_version(&key(), new_version(version), 5).await.unwrap();
    }
    store.promote(&key(), promotion(1, None), 6).await.unwrap();
    (store, folder)
}

fn step(alias: &str, version: Option<u32>, expected: Option<Option<u32>>) -> AliasMove {
    AliasMove { alias: alias.to_owned(), version, expected, cause: cause("to try") }
}

fn widening(share: f64, expected_revision: Option<u32>) -> Widening {
    Widening { share, expected_revision, caller: "ada".to_owned() }
}

fn plan(version: u32, share: f64) -> RolloutPlan {
    RolloutPlan {
        version,
        share,
        group: String::new(),
        failed_share_max: 0.1,
        devices_min: 10,
        self_test_loss_max: Some(0.1),
        cause: cause("a better lens"),
        overridden: vec!["it was measured with 1 test pairs".to_owned()],
    }
}

fn report(device: &str, version: u32, tried_version: Option<u32>, self_test_loss: Option<f64>) -> Report {
    let file = InstalledFile { version, form: KernelFormat::Compact, digest: digest(version) };
    let installed = InstalledKernel {
        kernel: key(),
        file: Some(file),
        generation: 2,
        tried_version,
        message: "self-test".to_owned(),
        self_test_loss,
        report_time_ms: 40,
    };
    Report { device: device.to_owned(), agent: "agent 1".to_owned(), installed }
}

/// Version and generation for a device.
async fn seen(store: &Store, device: Option<&str>) -> (u32, u64) {
    let moment = store.kernel_moment(&key(), device).await.unwrap();
    (moment.version.unwrap(), moment.generation)
}

#[tokio::test]
async fn aliases_are_compared_and_swapped_and_leave_the_generation() {
    let (store, _folder) = with_versions().await;
    let set = |version, expected| {
        let store = store.clone();
        async move { store.set_alias(&key(), step("candidate", version, expected), 9).await }
    };
    assert!(matches!(set(Some(4), None).await, Err(StoreError::NotFound { .. })));
    assert_eq!(set(Some(2), Some(None)).await.unwrap().aliases["candidate"], 2);
    let refused = set(Some(3), Some(None)).await;
    assert!(matches!(refused, Err(StoreError::Aborted { reason: AbortReason::AliasChanged, .. })), "{refused:?}");
    set(Some(3), Some(Some(2))).await.unwrap();
    assert!(set(None, None).await.unwrap().aliases.is_empty());
    set(None, None).await.unwrap();
    assert_eq!(seen(&store, None).await, (1, 1));

    let moves = store.kernel_moves(&key(), None, 9).await.unwrap();
    let listed: Vec<_> = moves.iter().map(|m| (m.alias.as_str(), m.from_version, m.to_version)).collect();
    let candidate = "candidate";
    assert_eq!(
        listed,
        [
            (candidate, Some(3), None),
            (candidate, Some(2), Some(3)),
            (candidate, None, Some(2)),
            ("active", None, Some(1))
        ]
    );
    // A rollback is about `active` alone.
    store.promote(&key(), promotion(2, Some(1)), 10).await.unwrap();
    set(Some(3), None).await.unwrap();
    assert_eq!(store.rollback(&key(), Some(2), &cause("worse"), 11).await.unwrap().active_version, Some(1));
    for n in 0..63 {
        store.set_alias(&key(), step(&format!("lab-{n}"), Some(1), None), 12).await.unwrap();
    }
    let full = store.set_alias(&key(), step("one-more", Some(1), None), 12).await;
    assert!(matches!(full, Err(StoreError::Precondition { reason: PreconditionReason::KernelFull, .. })), "{full:?}");
}

#[tokio::test]
async fn deprecations_are_kept_and_taken_back() {
    let (store, _folder) = with_versions().await;
    assert_eq!(store.kernel_version(&key(), 2).await.unwrap().deprecation, None);
    let deprecated = store.deprecate_kernel_version(&key(), 2, true, &cause("dirty lens"), 20).await.unwrap();
    let deprecation = deprecated.deprecation.clone().unwrap();
    assert_eq!((deprecation.time_ms, deprecation.cause), (20, cause("dirty lens")));
    let listed = store.kernel_versions(&key(), None, 9).await.unwrap();
    assert_eq!(listed.iter().filter(|version| version.deprecation.is_some()).count(), 1);
    assert_eq!(listed[1], deprecated);
    let again = store.deprecate_kernel_version(&key(), 2, false, &cause("cleaned"), 21).await.unwrap();
    assert_eq!(again.deprecation, None);
    assert!(store.deprecate_kernel_version(&key(), 4, true, &cause("x"), 22).await.is_err());
}

#[tokio::test]
async fn gates_are_kept_in_order_and_go_with_their_display() {
    let (store, _folder) = with_versions().await;
    assert!(store.gates("lab", 9).await.unwrap().is_empty());
    let gate = PromotionGate { test_pairs_min: 4, forms: vec![KernelFormat::F16], ..PromotionGate::default() };
    store.set_gate("lab", &PromotionGate::default(), &cause("first"), 7).await.unwrap();
    store.set_gate("lab", &gate, &cause("stricter"), 8).await.unwrap();
    let gates = store.gates("lab", 9).await.unwrap();
    assert_eq!((gates.len(), &gates[0].gate, &gates[0].cause), (2, &gate, &cause("stricter")));
    assert!(matches!(store.set_gate("x", &gate, &cause(""), 8).await, Err(StoreError::NotFound { .. })));
    store.create_display(&display("spare"), 1).await.unwrap();
    store.set_gate("spare", &gate, &cause(""), 8).await.unwrap();
    store.set_device_group("spare", "bench-1", "first", 8).await.unwrap();
    store.delete_display("spare").await.unwrap();
    assert!(store.gates("spare", 9).await.unwrap().is_empty());
}

#[tokio::test]
async fn a_rollout_reaches_its_share_and_its_group_and_then_all() {
    let (store, _folder) = with_versions().await;
    let first = RolloutPlan { group: "first".to_owned(), ..plan(2, 0.2) };
    let refused = store.start_rollout(&key(), first.clone(), Some(3), 20).await;
    assert!(matches!(refused, Err(StoreError::Aborted { .. })), "{refused:?}");
    assert!(store.start_rollout(&key(), plan(1, 0.2), Some(1), 20).await.is_err(), "it is active already");
    let rollout = store.start_rollout(&key(), first, Some(1), 20).await.unwrap();
    assert_eq!((rollout.number, rollout.from_version, rollout.revision), (1, Some(1), 1));
    let devices: Vec<String> = (0..100).map(|n| format!("bench-{n}")).collect();
    for device in &devices {
        let version = if is_in_share(&key(), 1, device, 0.2) { 2 } else { 1 };
        assert_eq!(seen(&store, Some(device)).await, (version, 2), "{device}");
    }
    assert_eq!(seen(&store, None).await, (1, 2));
    let other = devices.iter().find(|device| !is_in_share(&key(), 1, device, 0.6)).unwrap();
    store.set_device_group("lab", other, "first", 21).await.unwrap();
    assert_eq!(seen(&store, Some(other)).await, (2, 3), "what a device gets has changed");

    for refused in [
        store.promote(&key(), promotion(3, Some(1)), 22).await.map(|_| ()),
        store.rollback(&key(), Some(1), &cause(""), 22).await.map(|_| ()),
        store.start_rollout(&key(), plan(3, 0.2), Some(1), 22).await.map(|_| ()),
    ] {
        assert!(
            matches!(refused, Err(StoreError::Precondition { reason: PreconditionReason::RolloutRunning, .. })),
            "{refused:?}"
        );
    }
    assert!(store.widen_rollout(&key(), 1, widening(0.1, None), 23).await.is_err(), "it does not shrink");
    assert!(store.widen_rollout(&key(), 1, widening(0.6, Some(2)), 23).await.is_err(), "another revision");
    let widened = store.widen_rollout(&key(), 1, widening(0.6, Some(1)), 24).await.unwrap();
    assert_eq!((widened.revision, widened.plan.share), (2, 0.6));
    store.widen_rollout(&key(), 1, widening(1.0, None), 25).await.unwrap();
    assert_eq!(seen(&store, None).await, (2, 5), "also devices without a name");
    let done = store.complete_rollout(&key(), 1, Some(3), "ada", 26).await.unwrap();
    assert_eq!((done.state, done.end_time_ms), (RolloutState::Completed, Some(26)));
    let kernel = store.kernel(&key()).await.unwrap();
    assert_eq!((kernel.active_version, kernel.rollout), (Some(2), None));
    let moved = &store.kernel_moves(&key(), None, 1).await.unwrap()[0];
    assert_eq!((&moved.cause, &moved.overridden), (&done.plan.cause, &done.plan.overridden));
    let (_, events) = store.rollout(&key(), 1).await.unwrap();
    let generations: Vec<_> = events.iter().map(|event| event.generation).collect();
    assert_eq!((events.len(), generations), (4, vec![2, 4, 5, 6]), "{events:?}");
    assert_eq!(moved.generation, 6);
    assert!(store.complete_rollout(&key(), 1, None, "ada", 27).await.is_err());
    assert_eq!(store.start_rollout(&key(), plan(3, 0.05), Some(2), 28).await.unwrap().number, 2);
}

#[tokio::test]
async fn failing_devices_halt_a_rollout_and_all_go_back() {
    let (store, _folder) = with_versions().await;
    // The share of failures is that of at least ten devices.
    for n in 0..10 {
        store.report_device(report(&format!("quiet-{n}"), 1, None, None)).await.unwrap();
    }
    store.start_rollout(&key(), plan(2, 1e-9), Some(1), 20).await.unwrap();
    // Devices that do not get the version have no say.
    store.report_device(report("elsewhere", 1, Some(2), None)).await.unwrap();
    assert_eq!(store.rollouts(&key(), None, 9).await.unwrap()[0].devices_failed, 0);
    store.widen_rollout(&key(), 1, widening(1.0, None), 20).await.unwrap();
    store.report_device(report("elsewhere", 1, None, None)).await.unwrap();
    store.report_device(report("a", 2, None, Some(0.05))).await.unwrap();
    store.report_device(report("b", 1, Some(2), None)).await.unwrap();
    let rollouts = store.rollouts(&key(), None, 9).await.unwrap();
    assert_eq!((rollouts[0].devices_passed, rollouts[0].devices_failed), (1, 1));
    // The device tried again, and it works now.
    store.report_device(report("b", 2, None, Some(0.1))).await.unwrap();
    store.report_device(report("c", 2, None, Some(0.2))).await.unwrap();
    assert_eq!(seen(&store, Some("d")).await, (2, 3));
    store.report_device(report("d", 1, Some(2), None)).await.unwrap();
    assert_eq!(seen(&store, Some("d")).await, (1, 4));
    let (rollout, events) = store.rollout(&key(), 1).await.unwrap();
    assert_eq!((rollout.state, rollout.devices_passed, rollout.devices_failed), (RolloutState::Halted, 2, 2));
    let last = events.last().unwrap();
    assert!(last.message.starts_with("halted: 2 of 4 devices failed, the last one d;"), "{}", last.message);
    assert_eq!((last.caller.as_str(), last.generation), ("", 4));
    let told: Vec<_> = events.iter().filter(|event| event.message.contains(" failed: ")).collect();
    assert_eq!(told.len(), 3, "{events:?}");
    assert_eq!(told[0].message, "b failed: self-test");
    assert_eq!(told[1].message, "c failed: its self-test measured a loss of 0.2");
    assert_eq!(store.kernel(&key()).await.unwrap().active_version, Some(1));
    assert!(store.halt_rollout(&key(), 1, &cause("late"), 50).await.is_err());

    store.start_rollout(&key(), plan(3, 1.0), Some(1), 51).await.unwrap();
    let halted = store.halt_rollout(&key(), 2, &cause("noise"), 52).await.unwrap();
    assert_eq!(halted.state, RolloutState::Halted);
    assert_eq!(seen(&store, None).await, (1, 6));
    store.start_rollout(&key(), plan(3, 1.0), Some(1), 53).await.unwrap();
    store.halt_all_rollouts("restored", 54).await.unwrap();
    store.halt_all_rollouts("restored", 55).await.unwrap();
    let (rollout, events) = store.rollout(&key(), 3).await.unwrap();
    assert_eq!((rollout.state, events.last().unwrap().message.as_str()), (RolloutState::Halted, "restored"));
    assert_eq!(seen(&store, None).await, (1, 8));
}

#[tokio::test]
async fn one_failed_device_of_five_halts_a_rollout_of_which_a_tenth_may_fail() {
    let (store, _folder) = with_versions().await;
    for device in ["a", "b", "c", "d", "e"] {
        store.report_device(report(device, 1, None, None)).await.unwrap();
    }
    store.set_device_group("lab", "e", "first", 19).await.unwrap();
    store.set_device_group("lab", "silent", "first", 19).await.unwrap();
    assert_eq!(store.device_groups("lab").await.unwrap(), ["first"]);
    let of_group = RolloutPlan { group: "first".to_owned(), ..plan(2, 0.0) };
    let rollout = store.start_rollout(&key(), of_group, Some(1), 20).await.unwrap();
    assert_eq!(store.rollout_devices(&rollout).await.unwrap(), 1, "a device that never reported is not known");
    let rollout = store.widen_rollout(&key(), 1, widening(1.0, None), 20).await.unwrap();
    let known = store.rollout_devices(&rollout).await.unwrap();
    assert_eq!((known, rollout.halting(known).failures_first), (5, Some(1)));
    store.report_device(report("a", 2, None, Some(0.05))).await.unwrap();
    store.report_device(report("b", 1, Some(2), None)).await.unwrap();
    let (rollout, events) = store.rollout(&key(), 1).await.unwrap();
    let last = &events.last().unwrap().message;
    assert_eq!(rollout.state, RolloutState::Halted);
    assert!(last.ends_with("1 of 2 devices failed, the last one b; above 10 % of at least 5 devices"), "{last}");
}

#[tokio::test]
async fn reports_say_who_runs_what() {
    let (store, _folder) = with_versions().await;
    assert!(store.report_device(report("a", 9, None, None)).await.is_err(), "no such version");
    assert!(store.devices("lab", None, 9).await.unwrap().is_empty());
    for device in ["b", "a"] {
        store.report_device(report(device, 1, None, None)).await.unwrap();
    }
    store.report_device(report("b", 2, Some(3), Some(0.5))).await.unwrap();
    let nothing = Report {
        installed: InstalledKernel { file: None, ..report("c", 1, None, None).installed },
        ..report("c", 1, None, None)
    };
    store.report_device(nothing.clone()).await.unwrap();
    let devices = store.devices("lab", None, 9).await.unwrap();
    assert_eq!(devices.iter().map(|device| device.id.as_str()).collect::<Vec<_>>(), ["a", "b", "c"]);
    assert_eq!(devices[1].kernels, [report("b", 2, Some(3), Some(0.5)).installed]);
    assert_eq!(devices[2].kernels, [nothing.installed]);
    assert_eq!((devices[0].agent.as_str(), devices[0].report_time_ms), ("agent 1", Some(40)));
    assert_eq!(store.devices("lab", Some("a"), 1).await.unwrap()[0].id, "b");
    assert_eq!(store.forms_in_use(&key()).await.unwrap(), [KernelFormat::Compact]);
    store.delete_device("lab", "b").await.unwrap();
    assert!(matches!(store.delete_device("lab", "b").await, Err(StoreError::NotFound { .. })));
    assert_eq!(store.devices("lab", None, 9).await.unwrap().len(), 2);
}

#[tokio::test]
async fn a_deleted_device_counts_no_more_in_a_running_rollout() {
    let (store, _folder) = with_versions().await;
    let plan = RolloutPlan { failed_share_max: 1.0, ..plan(2, 1.0) };
    store.start_rollout(&key(), plan, Some(1), 30).await.unwrap();
    for device in ["a", "b"] {
        store.report_device(report(device, 1, Some(2), None)).await.unwrap();
    }
    store.delete_device("lab", "a").await.unwrap();
    assert_eq!(store.rollout(&key(), 1).await.unwrap().0.devices_failed, 1);
    store.halt_rollout(&key(), 1, &cause("noise"), 31).await.unwrap();
    store.delete_device("lab", "b").await.unwrap();
    assert_eq!(store.rollout(&key(), 1).await.unwrap().0.devices_failed, 1, "an ended rollout keeps its history");
}
