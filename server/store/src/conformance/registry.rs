//! Tests of displays, artifacts, datasets and kernels.

use super::*;
use crate::sql::{query, query_as};
use crate::{AbortReason, DisplayRecord, KernelFilter, PairFilter, PrivateKey, QueueLimits, StoredKeyring};
use lightpath_domain::dataset::{Finding, FindingKind};
use lightpath_domain::display::Display;
use lightpath_domain::units::Wavelength;

#[tokio::test]
async fn display_is_created_once_and_deleted_when_unused() {
    let (store, _folder) = store().await;
    let (stored, record) = store.create_display(&display("lab"), 99).await.unwrap();
    assert_eq!((stored, record), (display("lab"), DisplayRecord { create_time_ms: 1, revision: 1 }));
    let other = Display { bit_depth: 10, ..display("lab") };
    let refused = store.create_display(&other, 2).await.unwrap_err();
    assert!(
        matches!(&refused, StoreError::AlreadyExists { detail, .. } if detail.contains("properties (bit depth);")),
        "{refused}"
    );
    store.create_display(&display("a-first"), 2).await.unwrap();
    let ids = |page: Vec<(Display, DisplayRecord)>| page.into_iter().map(|(display, _)| display.id).collect::<Vec<_>>();
    assert_eq!(ids(store.displays(None, 50).await.unwrap()), ["a-first", "lab"]);
    assert_eq!(ids(store.displays(None, 1).await.unwrap()), ["a-first"]);
    assert_eq!(ids(store.displays(Some("a-first"), 50).await.unwrap()), ["lab"]);

    submit(&store, "r", 5).await;
    assert!(matches!(store.delete_display("lab").await, Err(StoreError::Precondition { .. })));
    store.delete_display("a-first").await.unwrap();
    assert!(matches!(store.delete_display("a-first").await, Err(StoreError::NotFound { .. })));
    assert!(matches!(store.display("a-first").await, Err(StoreError::NotFound { .. })));
}

/// A display that is created later with the same id has nothing to do with the pause.
#[tokio::test]
async fn pause_ends_with_its_display() {
    let (store, _folder) = store().await;
    store.create_display(&display("bench"), 1).await.unwrap();
    for paused in [None, Some("lab"), Some("bench")] {
        store.pause(paused, "", 2).await.unwrap();
    }
    store.delete_display("bench").await.unwrap();
    store.create_display(&display("bench"), 3).await.unwrap();
    let paused: Vec<_> = store.pauses().await.unwrap().into_iter().map(|pause| pause.display).collect();
    assert_eq!(paused, [None, Some("lab".to_owned())]);
}

#[tokio::test]
async fn owners_without_jobs_and_artifacts_leave_no_rows() {
    let (store, database) = store().await;
    for n in 0..20 {
        let mut new = new_job(&format!("r{n}"), 1);
        new.scheduling.owner = format!("owner {n}");
        let job = store.submit(&new, 5, QUEUE_LIMIT).await.unwrap().0;
        if n % 2 == 0 {
            store.cancel(&job.id, 6).await.unwrap();
        } else {
            let (_, lease) = store.claim(6, LEASE_MS, "w").await.unwrap().unwrap();
            store.finish(&lease, result(), JobEffect::None, 6).await.unwrap();
        }
        store.record_artifact(&digest(100 + n), 7, &new.scheduling.owner, None, 5).await.unwrap().unwrap();
    }
    let ids = store.jobs_ended_before(7, 50).await.unwrap();
    assert_eq!(store.delete_jobs(ids, 7, 8).await.unwrap().jobs, 20);
    for n in 0..20 {
        assert!(store.forget_artifact(&digest(100 + n), 10).await.unwrap());
    }
    store.close().await;
    let mut connection = database.connect().await;
    let sql = "select (select count(*) from job_count), (select count(*) from lane), \
               (select count(*) from owner_bytes where owner <> '')";
    let rows: (i64, i64, i64) = query_as(sql).fetch_one(&mut connection).await.unwrap();
    connection.close().await.unwrap();
    assert_eq!(rows, (0, 0, 0));
}

#[tokio::test]
async fn artifact_is_recorded_once() {
    let (store, _folder) = store().await;
    assert_eq!(store.artifact(&digest(1)).await.unwrap(), None);
    store.record_artifact(&digest(1), 7, "", None, 10).await.unwrap().unwrap();
    let record = store.record_artifact(&digest(1), 7, "", None, 20).await.unwrap().unwrap();
    assert_eq!((record.size_bytes, record.create_time_ms), (7, 10));
    assert_eq!(store.artifact(&digest(1)).await.unwrap(), Some(record));
    assert!(store.record_artifact("sha256-short", 7, "", None, 20).await.is_err());
}

#[tokio::test]
async fn artifact_that_is_being_removed_is_recorded_only_against_its_mark() {
    let (store, _folder) = store().await;
    let record = async |seen: Option<&str>| store.record_artifact(&digest(1), 7, "ada", seen, 20).await.unwrap();
    assert_eq!(store.begin_removal(&digest(1), 100).await.unwrap(), None, "it is not recorded");
    record(None).await.unwrap();
    assert_eq!(store.begin_removal(&digest(1), 20).await.unwrap(), None, "it was used too recently");
    let first = store.begin_removal(&digest(1), 100).await.unwrap().unwrap();
    assert_eq!(store.artifact(&digest(1)).await.unwrap(), None, "nobody may refer to it any more");
    assert_eq!(store.use_artifact(&digest(1), 20).await.unwrap(), None);
    store.require_owner_room("ada", 20, 20).await.unwrap();
    assert_eq!(store.removals("", 9).await.unwrap(), [(digest(1), first.clone())]);
    assert_eq!(store.removals(&digest(1), 9).await.unwrap(), []);
    assert_eq!(record(None).await.unwrap_err(), first);

    let second = store.continue_removal(&digest(1), &first).await.unwrap().unwrap();
    assert!(second != first);
    assert_eq!(store.continue_removal(&digest(1), &first).await.unwrap(), None, "its mark has changed");
    assert_eq!(record(Some(&first)).await.unwrap_err(), second, "another collector has listed newer objects");
    assert!(!store.end_removal(&digest(1), &first).await.unwrap());
    record(Some(&second)).await.unwrap();
    assert!(!store.end_removal(&digest(1), &second).await.unwrap(), "the publisher was faster");
    assert_eq!(store.artifact(&digest(1)).await.unwrap().unwrap().size_bytes, 7);

    let third = store.begin_removal(&digest(1), 100).await.unwrap().unwrap();
    assert!(store.end_removal(&digest(1), &third).await.unwrap());
    record(None).await.unwrap();
}

#[tokio::test]
async fn removal_of_what_nobody_recorded_has_a_mark_too() {
    let (store, _folder) = store().await;
    let all = [1, 2, 3].map(digest);
    store.record_artifact(&all[0], 7, "", None, 20).await.unwrap().unwrap();
    assert_eq!(store.begin_removal_of_unrecorded(&all[0]).await.unwrap(), None, "it is recorded");
    let mut unrecorded = store.unrecorded(&all).await.unwrap();
    unrecorded.sort();
    assert_eq!(unrecorded, all[1..]);
    let mark = store.begin_removal_of_unrecorded(&all[1]).await.unwrap().unwrap();
    assert_eq!(store.begin_removal_of_unrecorded(&all[1]).await.unwrap(), None, "it is being removed");
    assert_eq!(store.unrecorded(&all).await.unwrap(), all[2..]);
    assert_eq!(store.record_artifact(&all[1], 7, "", None, 20).await.unwrap().unwrap_err(), mark);
    assert!(store.end_removal(&all[1], &mark).await.unwrap());
    assert_eq!(store.unrecorded(&[]).await.unwrap(), [""; 0]);
}

#[tokio::test]
async fn place_of_the_artifacts_is_kept_until_they_move() {
    let (store, _folder) = store().await;
    let [folder, bucket, other] = [1, 2, 3].map(|n| format!("{n:036}"));
    assert_eq!(store.artifact_place(&folder, None).await.unwrap(), folder);
    assert_eq!(store.artifact_place(&other, None).await.unwrap(), folder);
    assert_eq!(store.artifact_place(&bucket, Some(&other)).await.unwrap(), folder);
    assert_eq!(store.artifact_place(&bucket, Some(&folder)).await.unwrap(), bucket);
    assert_eq!(store.artifact_place(&folder, None).await.unwrap(), bucket);
}

#[tokio::test]
async fn artifacts_count_towards_owner_limits_and_belong_to_displays() {
    let (store, _folder) = store().await;
    for owner in ["ada", "ada", "bob"] {
        store.record_artifact(&digest(1), 7, owner, None, 10).await.unwrap().unwrap();
    }
    store.record_artifact(&digest(2), 5, "ada", None, 10).await.unwrap().unwrap();
    store.require_owner_room("ada", 8, 20).await.unwrap();
    let full = store.require_owner_room("ada", 9, 20).await.unwrap_err();
    assert!(matches!(full, StoreError::OwnerBytes { stored_bytes: 12, stored_bytes_max: 20 }), "{full}");
    store.require_owner_room("bob", 13, 20).await.unwrap();
    assert!(store.require_owner_room("bob", 14, 20).await.is_err());
    store.require_owner_room("ada", u64::MAX, 0).await.unwrap();

    let limits = QueueLimits { stored_bytes_per_owner: 12, ..QueueLimits::from(QUEUE_LIMIT) };
    let mut new = new_job("r", 1);
    new.scheduling.owner = "ada".to_owned();
    assert!(matches!(store.submit(&new, 1, limits).await, Err(StoreError::OwnerBytes { .. })));
    assert!(store.forget_artifact(&digest(2), 11).await.unwrap());
    store.submit(&new, 1, limits).await.unwrap();

    let lab = ["lab".to_owned()];
    let concerns = |n: u32, owner: &'static str, displays: &'static [&'static str]| {
        let (store, displays) = (store.clone(), displays.iter().map(|id| (*id).to_owned()).collect::<Vec<_>>());
        async move { store.artifact_concerns(&digest(n), owner, &displays).await.unwrap() }
    };
    assert!(concerns(0, "cyd", &["lab"]).await, "a job on the display reads the artifact");
    assert!(!concerns(0, "cyd", &["other"]).await);
    assert!(concerns(1, "bob", &["other"]).await && !concerns(1, "cyd", &["lab"]).await);
    store.create_dataset(&dataset("d"), 5).await.unwrap();
    record(&store, 12).await;
    store.add_pairs("d", &[pair(4)], &[]).await.unwrap();
    assert!(store.artifact_concerns(&pair(4).photo, "cyd", &lab).await.unwrap());
    assert!(!store.artifact_concerns(&pair(4).photo, "cyd", &["other".to_owned()]).await.unwrap());
}

#[tokio::test]
async fn pairs_are_added_all_or_none_and_read_in_pages() {
    let (store, _folder) = store().await;
    record(&store, 12).await;
    store.create_dataset(&dataset("d"), 5).await.unwrap();
    let unknown = Pair { pattern: digest(98), ..pair(1) };
    let refused = store.add_pairs("d", &[pair(0), unknown], &[]).await;
    assert!(matches!(refused, Err(StoreError::NotFound { .. })), "{refused:?}");
    assert_eq!(store.dataset_alone("d").await.unwrap().pair_count, 0, "none was added");

    let finding = |pair: &str, message: &str| Finding {
        pair: pair.to_owned(),
        kind: FindingKind::LowContrast,
        excludes: false,
        message: message.to_owned(),
    };
    let findings = [finding(&pair(2).id, "is grey"), finding("", "is small")];
    let added = store.add_pairs("d", &[pair(2), pair(0), pair(1)], &findings).await.unwrap();
    assert_eq!((added.pair_count, added.pairs.len(), added.findings.len()), (3, 0, 1));
    let again = store.add_pairs("d", &[pair(1), pair(3)], &findings[1..]).await.unwrap();
    assert_eq!((again.pair_count, again.revision), (4, added.revision + 1), "one of the two was new");

    let ids = async |filter, after: Option<&str>, limit| {
        let found = store.pairs("d", filter, after, limit).await.unwrap();
        assert_eq!(found.dataset, again);
        found.pairs.into_iter().map(|(pair, findings)| (pair.id, findings.len())).collect::<Vec<_>>()
    };
    let all: Vec<(String, usize)> = (0..4).map(|n| (pair(n).id, usize::from(n == 2))).collect();
    assert_eq!(ids(PairFilter::All, None, 2).await, all[..2]);
    assert_eq!(ids(PairFilter::All, Some(&all[1].0), 9).await, all[2..]);
    assert_eq!(ids(PairFilter::WithFindings, None, 9).await, all[2..3]);
    let finalized = preparing::finalize(&store, "d").await;
    let counts = finalized.split_counts.unwrap();
    assert_eq!(counts.train + counts.validation + counts.test + counts.excluded, 4, "{counts:?}");
    assert_eq!(store.dataset("d").await.unwrap().split_counts, Some(counts));
}

#[tokio::test]
async fn dataset_accepts_pairs_until_finalized() {
    let (store, _folder) = store().await;
    record(&store, 12).await;
    store.create_dataset(&dataset("d"), 5).await.unwrap();
    let again = store.create_dataset(&dataset("d"), 9).await.unwrap();
    assert_eq!(again.create_time_ms, 5);
    let other = Dataset { distance: Distance { nm: 1 }, ..dataset("d") };
    assert!(matches!(store.create_dataset(&other, 9).await, Err(StoreError::AlreadyExists { .. })));
    let lost = Dataset { display: "nowhere".into(), ..dataset("e") };
    assert!(matches!(store.create_dataset(&lost, 9).await, Err(StoreError::NotFound { .. })));

    for n in 0..5 {
        store.add_pairs("d", &[pair(n)], &[]).await.unwrap();
    }
    assert_eq!(
        store.add_pairs("d", &[pair(4)], &[]).await.unwrap().pair_count,
        5,
        "the same pair again changes nothing"
    );
    let same_id = Pair { photo: digest(11), ..pair(4) };
    let same_phase = Pair { id: "x".into(), photo: digest(11), ..pair(4) };
    let same_photo = Pair { id: "x".into(), pattern: digest(11), ..pair(4) };
    for taken in [same_id, same_phase, same_photo] {
        assert!(matches!(store.add_pairs("d", &[taken], &[]).await, Err(StoreError::AlreadyExists { .. })));
    }
    let unknown = Pair { id: "y".into(), pattern: digest(98), photo: digest(99), ..Pair::default() };
    assert!(matches!(store.add_pairs("d", &[unknown], &[]).await, Err(StoreError::NotFound { .. })));

    let finalized = preparing::finalize(&store, "d").await;
    assert_eq!(finalized.finalize_time_ms, Some(20));
    assert_eq!(store.dataset("d").await.unwrap(), finalized);
    let late = Pair { id: "late".into(), pattern: digest(10), photo: digest(11), ..Pair::default() };
    assert!(matches!(store.add_pairs("d", &[late], &[]).await, Err(StoreError::Precondition { .. })));
    store.add_pairs("d", &[pair(0)], &[]).await.unwrap();

    store.create_dataset(&dataset("e"), 5).await.unwrap();
    let ids: Vec<String> =
        store.datasets(Some("lab"), Some("d"), 50).await.unwrap().into_iter().map(|d| d.id).collect();
    assert_eq!(ids, ["e"]);
    assert!(store.datasets(Some("elsewhere"), None, 50).await.unwrap().is_empty());
}

#[tokio::test]
async fn versions_are_numbered_and_rollbacks_undo_promotions_in_reverse_order() {
    let (store, _folder) = store().await;
    record(&store, 10).await;
    let mut changes = store.subscribe_kernel_changes();
    assert!(matches!(store.kernel(&key()).await, Err(StoreError::NotFound { .. })));
    assert!(matches!(store.add_kernel_version(&key(), new_version(77), 1).await, Err(StoreError::NotFound { .. })));
    assert!(
        matches!(store.kernel(&key()).await, Err(StoreError::NotFound { .. })),
        "the failed call creates no kernel"
    );
    for n in 1..=4 {
        assert_eq!(store.add_kernel_version(&key(), new_version(n), i64::from(n)).await.unwrap().version, n);
    }
    assert_eq!(changes.try_recv().unwrap(), key());
    assert_eq!(store.kernel(&key()).await.unwrap().active_version, None);
    assert!(matches!(store.rollback(&key(), None, &cause(""), 1).await, Err(StoreError::Precondition { .. })));

    let promote = |version, expected| {
        let store = store.clone();
        async move { store.promote(&key(), promotion(version, expected), 9).await }
    };
    assert!(matches!(promote(5, None).await, Err(StoreError::NotFound { .. })));
    promote(1, None).await.unwrap();
    promote(2, Some(1)).await.unwrap();
    assert!(matches!(promote(3, Some(1)).await, Err(StoreError::Aborted { .. })));
    assert!(matches!(promote(3, None).await, Err(StoreError::Aborted { .. })));
    promote(3, Some(2)).await.unwrap();
    promote(3, Some(3)).await.unwrap();
    assert_eq!(store.rollback(&key(), Some(3), &cause("worse"), 10).await.unwrap().active_version, Some(2));
    assert_eq!(store.rollback(&key(), Some(2), &cause("worse"), 11).await.unwrap().active_version, Some(1));
    let refused = store.rollback(&key(), Some(1), &cause("worse"), 12).await;
    assert!(matches!(refused, Err(StoreError::Precondition { .. })));
    promote(4, Some(1)).await.unwrap();
    assert_eq!(store.rollback(&key(), Some(4), &cause("worse"), 13).await.unwrap().active_version, Some(1));

    let moves = store.kernel_moves(&key(), None, 50).await.unwrap();
    assert_eq!(moves.iter().map(|m| m.generation).collect::<Vec<_>>(), [7, 6, 5, 4, 3, 2, 1]);
    let listed: Vec<_> = moves.iter().map(|m| (m.from_version, m.to_version, m.rollback)).collect();
    assert_eq!(
        listed,
        [
            (Some(4), Some(1), true),
            (Some(1), Some(4), false),
            (Some(2), Some(1), true),
            (Some(3), Some(2), true),
            (Some(2), Some(3), false),
            (Some(1), Some(2), false),
            (None, Some(1), false),
        ]
    );
    assert!(moves.iter().all(|m| m.cause.caller == "ada" && !m.cause.reason.is_empty()), "{moves:?}");
    let page = store.kernel_moves(&key(), Some(moves[1].sequence), 2).await.unwrap();
    assert_eq!(page, moves[2..4]);

    let versions = store.kernel_versions(&key(), Some(4), 2).await.unwrap();
    assert_eq!(versions.iter().map(|v| (v.version, v.active)).collect::<Vec<_>>(), [(3, false), (2, false)]);
    let first = store.kernel_version(&key(), 1).await.unwrap();
    assert_eq!((first.active, first.content), (true, new_version(1)));
    assert!(matches!(store.kernel_version(&key(), 5).await, Err(StoreError::NotFound { .. })));
    filter_finds_the_only_kernel(&store).await;
}

/// Lists the kernels by their displays and optics. There is one kernel.
async fn filter_finds_the_only_kernel(store: &Store) {
    let of = |display: &str| KernelFilter { display: Some(display.to_owned()), ..KernelFilter::default() };
    let kernels = store.kernels(&of("lab"), None, 50).await.unwrap();
    assert_eq!(kernels.len(), 1);
    assert_eq!((kernels[0].active_version, kernels[0].latest_version), (Some(1), 4));
    let all = KernelFilter::default();
    assert!(store.kernels(&all, Some(&key().to_string()), 50).await.unwrap().is_empty());
    let KernelKey { wavelength, distance, .. } = key();
    let there = KernelFilter { wavelength: Some(wavelength), distance: Some(distance), ..all.clone() };
    assert_eq!(store.kernels(&there, None, 50).await.unwrap(), kernels);
    let elsewhere = KernelFilter { distance: Distance::from_m(0.07), ..there.clone() };
    let other_colour = KernelFilter { wavelength: Wavelength::from_m(700e-9), ..there };
    for nothing in [elsewhere, other_colour, of("other")] {
        assert!(store.kernels(&nothing, None, 50).await.unwrap().is_empty(), "{nothing:?}");
    }
}

#[tokio::test]
async fn no_rollback_goes_to_a_deprecated_version() {
    let (store, _folder) = store().await;
    record(&store, 10).await;
    for n in 1..=2 {
        store.add_kernel_version(&key(), new_version(n), 1).await.unwrap();
        store.promote(&key(), promotion(n, (n > 1).then_some(1)), 2).await.unwrap();
    }
    store.deprecate_kernel_version(&key(), 1, true, &cause("dirty lens"), 3).await.unwrap();
    let refused = store.rollback(&key(), Some(2), &cause("worse"), 4).await;
    assert!(refused.is_err_and(|error| error.to_string().contains("version 1, which is deprecated: dirty lens")));
    assert_eq!(store.kernel(&key()).await.unwrap().active_version, Some(2));
    store.deprecate_kernel_version(&key(), 1, false, &cause("cleaned"), 5).await.unwrap();
    assert_eq!(store.rollback(&key(), Some(2), &cause("worse"), 6).await.unwrap().active_version, Some(1));
}

/// Two callers see that version 3 is worse. One goes back, and the other one learns that another version is active.
#[tokio::test]
async fn only_one_of_two_rollbacks_goes_back() {
    let (store, _folder) = store().await;
    record(&store, 5).await;
    for version in 1..=3 {
        store.add_kernel_version(&key(), new_version(version), 5).await.unwrap();
        store.promote(&key(), promotion(version, version.checked_sub(1).filter(|n| *n > 0)), 6).await.unwrap();
    }
    let rollback = |expected| {
        let store = store.clone();
        async move { store.rollback(&key(), expected, &cause("worse"), 10).await }
    };
    let (first, second) = tokio::join!(rollback(Some(3)), rollback(Some(3)));
    let (done, refused) = if first.is_ok() { (first, second) } else { (second, first) };
    assert_eq!(done.unwrap().active_version, Some(2));
    assert!(matches!(refused, Err(StoreError::Aborted { .. })), "{refused:?}");
    assert!(matches!(rollback(None).await, Err(StoreError::Aborted { .. })));
    assert_eq!(store.kernel(&key()).await.unwrap().active_version, Some(2));
}

/// A device that has seen a generation refuses a lower one, so the generation rises with every move on any kernel of
/// the display, and after a restore.
#[tokio::test]
async fn generation_of_a_display_rises_with_every_move_and_never_falls() {
    let (store, database) = store().await;
    record(&store, 5).await;
    let other = KernelKey { distance: Distance::from_m(0.2).unwrap(), ..key() };
    for key in [key(), other.clone()] {
        store.add_kernel_version(&key, new_version(1), 5).await.unwrap();
    }
    let moment = |key: KernelKey| {
        let store = store.clone();
        async move { store.kernel_moment(&key, None).await.unwrap() }
    };
    let first = moment(key()).await;
    assert_eq!((first.generation, first.version, first.keyring_version), (0, None, None));
    store.promote(&key(), promotion(1, None), 20).await.unwrap();
    store.promote(&other, promotion(1, None), 30).await.unwrap();
    // A clock that went back does not take the time back.
    store.add_kernel_version(&key(), new_version(2), 5).await.unwrap();
    store.promote(&key(), promotion(2, Some(1)), 25).await.unwrap();
    for (key, active) in [(key(), 2), (other, 1)] {
        let found = moment(key).await;
        assert_eq!((found.generation, found.generation_time_ms, found.version), (3, 30, Some(active)));
    }
    store.raise_generations(1_000).await.unwrap();
    store.raise_generations(900).await.unwrap();
    assert_eq!(moment(key()).await.generation, 1_000);
    store.close().await;
    let mut connection = database.connect().await;
    let fall = query("update display set generation = 999").execute(&mut connection).await.unwrap_err();
    assert!(fall.to_string().contains("never falls"), "{fall}");
}

#[tokio::test]
async fn keyrings_have_rising_numbers_and_private_keys_are_forgotten() {
    let (store, _folder) = store().await;
    assert_eq!(store.keyring().await.unwrap(), None);
    let ring = |version| StoredKeyring { version, document: format!("keyring {version}") };
    let private = |number: u8| PrivateKey { public: format!("{number:064x}"), private: format!("private {number}") };
    store.add_keyring(ring(1), vec![private(1), private(2)], vec![], 5).await.unwrap();
    assert!(!format!("{:?}", private(1)).contains("private 1"));
    for version in [0, 1] {
        let refused = store.add_keyring(ring(version), vec![private(3)], vec![], 6).await;
        assert!(matches!(refused, Err(StoreError::Aborted { reason: AbortReason::KeyringChanged, .. })), "{refused:?}");
    }
    store.add_keyring(ring(7), vec![private(4)], vec![private(1).public], 7).await.unwrap();
    assert_eq!(store.keyring().await.unwrap(), Some(ring(7)));
    assert_eq!(store.private_keys().await.unwrap(), [private(2), private(4)]);
    assert!(store.forget_private_key(&private(2).public).await.unwrap());
    assert!(!store.forget_private_key(&private(2).public).await.unwrap());
    store.add_private_keys(vec![private(4), private(5)], 8).await.unwrap();
    assert_eq!(store.private_keys().await.unwrap(), [private(4), private(5)]);
}
