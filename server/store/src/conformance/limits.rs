//! Tests of the limits on stored records, and of deleting datasets.

use super::preparing::finalize;
use super::*;
use crate::dependencies::DEPENDENCIES_MAX;
use crate::events::EVENTS_MAX;
use crate::sql::scalar;
use lightpath_domain::dataset::DATASETS_MAX;
use lightpath_domain::job::JobState;
use lightpath_domain::kernel::VERSIONS_MAX;
use lightpath_domain::reason::PreconditionReason;

fn reason_of<T: std::fmt::Debug>(refused: Result<T, StoreError>) -> PreconditionReason {
    match refused {
        Err(StoreError::Precondition { reason, .. }) => reason,
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn display_takes_no_more_datasets_at_its_limit() {
    let (store, database) = store().await;
    store.create_display(&display("other"), 1).await.unwrap();
    database
        .change(&format!(
            "with recursive n(i) as (select 1 union all select i + 1 from n where i < {DATASETS_MAX}) \
             insert into dataset (id, display, wavelength_pm, distance_nm, photo_encoding, create_time_ms) \
             select 'd' || i, 'lab', {}, {}, 'linear', 5 from n",
            WAVELENGTH.pm, DISTANCE.nm
        ))
        .await;
    assert_eq!(reason_of(store.create_dataset(&dataset("more"), 6).await), PreconditionReason::DisplayFull);
    store.create_dataset(&dataset("d1"), 6).await.unwrap();
    let elsewhere = Dataset { display: "other".to_owned(), ..dataset("elsewhere") };
    store.create_dataset(&elsewhere, 6).await.unwrap();
    store.delete_dataset("d7", 6).await.unwrap();
    store.create_dataset(&dataset("more"), 6).await.unwrap();
}

#[tokio::test]
async fn kernel_takes_no_more_versions_at_its_limit() {
    let (store, database) = store().await;
    record(&store, 3).await;
    store.add_kernel_version(&key(), new_version(1), 5).await.unwrap();
    database.change(&format!("update kernel set latest_version = {VERSIONS_MAX}")).await;
    let refused = store.add_kernel_version(&key(), new_version(2), 6).await;
    assert_eq!(reason_of(refused), PreconditionReason::KernelFull);
    let far = KernelKey { distance: Distance { nm: 200_000_000 }, ..key() };
    store.add_kernel_version(&far, new_version(2), 6).await.unwrap();
}

#[tokio::test]
async fn job_keeps_its_newest_events() {
    let (store, database) = store().await;
    let id = submit(&store, "r", 1).await;
    let limit = i64::from(EVENTS_MAX);
    database
        .change(&format!(
            "with recursive n(i) as (select 1 union all select i + 1 from n where i < {}) \
             insert into job_event (job, time_ms, attempt, message) select '{id}', i, 0, 'again' from n; \
             update job set revision = {} where id = '{id}'",
            limit - 2,
            limit - 1
        ))
        .await;
    let other = submit(&store, "other", 1).await;
    store.cancel(&id, 5).await.unwrap();
    assert_eq!(store.events(&id, None, 1001).await.unwrap().len() as i64, limit);
    for _ in 0..3 {
        store.retry(&id, 6).await.unwrap();
        store.cancel(&id, 7).await.unwrap();
    }
    let events = store.events(&id, None, 1001).await.unwrap();
    let ends = (events[0].message.as_str(), events[events.len() - 1].message.as_str());
    assert_eq!((events.len() as i64, ends), (limit, ("again", "cancelled")));
    assert_eq!(store.events(&other, None, 9).await.unwrap().len(), 1);
}

async fn dependencies(database: &TestDatabase) -> i64 {
    let mut connection = database.connect().await;
    let count = scalar("select count(*) from job_dependency").fetch_one(&mut connection).await.unwrap();
    connection.close().await.unwrap();
    count
}

async fn submit_after(store: &Store, request_id: &str, after: &[&String]) -> Result<String, StoreError> {
    let mut new = new_job(request_id, 1);
    new.scheduling.after = after.iter().map(|id| (*id).clone()).collect();
    Ok(store.submit(&new, 10, QUEUE_LIMIT).await?.0.id)
}

#[tokio::test]
async fn only_waiting_jobs_have_stored_dependencies() {
    let (store, database) = store().await;
    let [a, b] = [submit(&store, "a", 1).await, submit(&store, "b", 2).await];
    let c = submit_after(&store, "c", &[&a, &b]).await.unwrap();
    let d = submit_after(&store, "d", &[&a, &c]).await.unwrap();
    assert_eq!(dependencies(&database).await, 4);
    let (_, lease) = store.claim(20, LEASE_MS, "w").await.unwrap().unwrap();
    store.finish(&lease, result(), JobEffect::None, 21).await.unwrap();
    assert_eq!(dependencies(&database).await, 2, "a has succeeded");
    store.cancel(&b, 22).await.unwrap();
    assert_eq!(dependencies(&database).await, 0, "c and d have failed");
    for id in [&b, &c, &d] {
        assert_eq!(store.retry(id, 23).await.unwrap().state, JobState::Queued);
    }
    assert_eq!((dependencies(&database).await, store.job(&d).await.unwrap().waiting_for), (2, 1));
    for expected in [&b, &c, &d] {
        let (job, lease) = store.claim(24, LEASE_MS, "w").await.unwrap().unwrap();
        assert_eq!(&job.id, expected);
        store.finish(&lease, result(), JobEffect::None, 25).await.unwrap();
    }
    assert_eq!(dependencies(&database).await, 0);
}

#[tokio::test]
async fn jobs_wait_for_a_limited_number_of_other_jobs() {
    let (store, database) = store().await;
    let first = submit(&store, "first", 1).await;
    let spec = serde_json::to_string(&new_job("", 1).spec).unwrap();
    database.change(&format!(
            "with recursive n(i) as (select 1 union all select i + 1 from n where i < 320) \
             insert into job (id, request_id, display, kind, words, spec, state, priority, attempts_max, create_time_ms, \
             run_time_ms) select 'j' || i, 'j' || i, 'lab', 'simulate_capture', 'j' || i, '{spec}', 'queued', 0, 3, 1, 1 from n; \
             insert into job_dependency select a.id, b.id from job a join job b on a.id <> b.id limit {}",
            DEPENDENCIES_MAX - 1
        )).await;
    let one = async |request_id| {
        let mut new = new_job(request_id, 1);
        new.scheduling.after = vec![first.clone()];
        store.submit(&new, 10, 1000).await.map(|(job, _)| job.id)
    };
    one("last").await.unwrap();
    let refused = one("refused").await;
    assert!(matches!(refused, Err(StoreError::DependenciesFull { limit: DEPENDENCIES_MAX })), "{refused:?}");
    store.submit(&new_job("without", 1), 10, 1000).await.unwrap();
}

#[tokio::test]
async fn dataset_is_deleted_when_no_job_needs_it() {
    let (store, database) = store().await;
    record(&store, 12).await;
    for id in ["d", "e"] {
        store.create_dataset(&dataset(id), 5).await.unwrap();
        for n in 0..5 {
            store.add_pairs(id, &[pair(n)], &[]).await.unwrap();
        }
    }
    finalize(&store, "d").await;
    // The second dataset of a job counts, too.
    let learn = r#"{"kind":"learn_kernel","datasets":["e","d"],"display":"lab","start_version":null,"parameters":
        {"model":"display","degree":null,"epochs":null,"learning_rate":null,"refinement_evaluations":null,"seed":1,
        "detector":"pixel","region_of_interest":{"x_px":0,"y_px":0,"width_px":9,"height_px":9}}}"#;
    let new = NewJob { spec: serde_json::from_str(learn).unwrap(), ..new_job("learn", 1) };
    let job = store.submit(&new, 10, QUEUE_LIMIT).await.unwrap().0;
    for id in ["d", "e"] {
        assert_eq!(reason_of(store.delete_dataset(id, 30).await), PreconditionReason::DatasetInUse);
    }
    store.cancel(&job.id, 31).await.unwrap();
    store.delete_dataset("d", 40).await.unwrap();
    assert!(matches!(store.dataset("d").await, Err(StoreError::NotFound { .. })));
    assert!(matches!(store.delete_dataset("d", 40).await, Err(StoreError::NotFound { .. })));
    assert_eq!(store.dataset("e").await.unwrap().pairs.len(), 5);
    assert_eq!(store.artifact(&pair(1).photo).await.unwrap().unwrap().use_time_ms, 40, "the grace period begins");
    store.create_dataset(&dataset("d"), 50).await.unwrap();
    store.close().await;
    let mut inspection = database.inspect().await;
    assert_eq!(inspection.damages().await.unwrap(), Vec::<String>::new());
    inspection.close().await.unwrap();
}
