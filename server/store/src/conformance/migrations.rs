//! Migrations of databases of every version since 0.1.0, with data as that version wrote it.

use super::*;
use crate::connect::connect_options;
use crate::migrations::{MIGRATIONS, STEPS_OF_0_1_0, migrator};
use crate::{Inspection, JobFilter};
use lightpath_domain::display::Display;
use lightpath_domain::job::JobState;
use lightpath_domain::kernel_format::KernelFormat;
use lightpath_domain::rollout::RolloutState;
use sqlx::{ConnectOptions as _, Connection as _, Row};
use std::path::Path;

/// Rows as the version whose last migration has this number wrote them. Every table has rows, and every state of a job
/// occurs.
const ROWS: &[(usize, &str)] = &[(
    STEPS_OF_0_1_0,
    r#"
    insert into display (id, content, create_time_ms) values ('lab', '{"id":"lab","width_px":64,"height_px":64,"pixel_pitch_m":8e-6,
    "bit_depth":8,"wavelengths":[{"pm":515000}],"phase_response_rad":null,"carrier":null,"orders":"first","camera_fill_factor":1.0,"notes":"",
    "simulated_bench":null}', 1);

    insert into artifact (digest, size_bytes, create_time_ms, use_time_ms)
    select 'sha256-' || printf('%064x', value), 7, 1, 1 from json_each('[0, 1, 2, 3]');
    insert into artifact_owner select digest, 'ada' from artifact;

    insert into dataset (id, display, wavelength_pm, distance_nm, photo_encoding, create_time_ms)
    values ('d', 'lab', 515000, 150000000, 'linear', 5), ('open', 'lab', 515000, 150000000, 'srgb', 6);
    insert into pair (dataset, id, pattern, photo, split)
    values ('d', 'p0', 'sha256-' || printf('%064x', 0), 'sha256-' || printf('%064x', 1), 'train'),
    ('d', 'p1', 'sha256-' || printf('%064x', 2), 'sha256-' || printf('%064x', 3), 'test');
    update dataset set pair_count = 2, digest = 'sha256-d', finalize_time_ms = 7, finalization =
    '{"validation_fraction":0.0,"test_fraction":0.2,"seed":0,"keep_alignment":false}' where id = 'd';

    insert into kernel (id, name, display, wavelength_pm, distance_nm, latest_version, create_time_ms)
    values (1, 'displays/lab/kernels/515nm-150mm', 'lab', 515000, 150000000, 1, 8);
    insert into kernel_version (kernel, version, model, artifact, size_bytes, metrics, lineage, create_time_ms,
    interpolated, datasets, job)
    select 1, 1, 'display', 'sha256-' || printf('%064x', 1), 7,
    '{"train_pairs":1,"validation_pairs":0,"test_pairs":1,"train_loss":0.1,"validation_loss":0.0,"test_loss":0.2,
    "ideal_test_loss":0.3,"test_loss_full_frame":0.2,"ideal_test_loss_full_frame":0.3,"captured":null}',
    '{"origin":{"learned":{"job":"","datasets":[],"parent_version":null,"parameters":null}},"code_version":"0.1.0"}', 9, 0, 0, '';
    update kernel set active_version = 1;
    insert into kernel_move (kernel, alias, time_ms, caller, from_version, to_version, reason, generation)
    values (1, 'active', 10, 'ada', null, 1, 'good', 1);
    update display set generation = 1, generation_time_ms = 10;
    insert into kernel_alias values (1, 'candidate', 1);
    insert into kernel_deprecation (kernel, version, deprecated, time_ms, caller, reason)
    values (1, 1, 1, 10, 'ada', 'old lens');
    insert into promotion_gate (display, time_ms, caller, reason, gate) values ('lab', 10, 'ada', 'why',
    '{"loss_reduction_min":0.05,"worse_than_ideal_allowed":false,"test_pairs_min":2,"forms":["compact"]}');
    insert into device values ('lab', 'bench-7', 'first', 'lightpath-agent 0.1.0', 10);
    insert into device_kernel values ('lab', 'bench-7', 1, 1, 'compact', 'sha256-c', 1, null, '', 0.5, 10);
    insert into rollout values (1, 1, 1, null, 'completed', 0.05, 'first', 0.1, 10, 0.5, 'ada', 'good', '[]', 9, 10, 2);
    insert into rollout_event (kernel, number, time_ms, caller, message, generation)
    values (1, 1, 9, 'ada', 'started', 1);
    insert into rollout_report values (1, 1, 'bench-7', 1, 10);

    insert into job (id, request_id, display, kind, words, spec, state, attempt, start_time_ms, finish_time_ms, lease_id,
    lease_until_ms, worker, error, result, checkpoint, owner, priority, attempts_max, create_time_ms, run_time_ms)
    select column1, 'request-' || column1, 'lab', 'simulate_capture', 'ada', '{"kind":"simulate_capture","display":"lab",
    "wavelength":{"pm":515000},"distance":{"nm":150000000},"pattern":"sha256-' || printf('%064x', 0) || '","seed":1,
    "elapsed_s":0.0}', column2, column3, column4, column5, column6, column7, column8, column9, column10, column11,
    'ada', 0, 3, 11, 11
    from (values
    ('a', 'queued', 0, null, null, null, null, null, null, null, null),
    ('b', 'running', 1, 12, null, 'lease', 99, 'w', null, null, 'sha256-c'),
    ('c', 'succeeded', 1, 12, 13, null, null, null, null,
        '{"kind":"simulate_capture","photo":"sha256-' || printf('%064x', 1) || '","propagation":{"method":"band_limited",
        "explanation":"","window":{"height_px":64,"width_px":64,"pitch_x_m":8e-6,"pitch_y_m":8e-6,"centre_x_m":0.0,
        "centre_y_m":0.0},"critical_distance_x_m":0.016,"critical_distance_y_m":0.016,"band_kept_x":1.0,"band_kept_y":1.0,
        "band_kept_area":1.0,"fresnel_number":0.8,"diffraction_angle_rad":0.03,"spread_m":null,"full_cone_x_m":0.0,
        "full_cone_y_m":0.0,"neglected_phase_rad":0.0,"warnings":[]}}', null),
    ('d', 'failed', 3, 12, 13, null, null, null, '{"reason":"IO","message":"no","retryable":false}', null, null),
    ('e', 'cancelled', 1, 12, 13, null, null, null, null, null, null));
    insert into job (id, request_id, display, kind, words, spec, state, owner, priority, attempts_max, create_time_ms,
    run_time_ms, needs, estimated_bytes, counted_bytes)
    select 'f', 'request-f', display, kind, words, spec, 'queued', owner, priority, attempts_max, 11, 11, '["bench-2","gpu"]',
    33554433, 35651584 from job where id = 'a';
    insert into job_event (job, time_ms, attempt, message)
    select id, 11, 0, 'queued' from job union all select 'c', 13, 1, 'succeeded';

    insert into artifact_removal values ('sha256-' || printf('%064x', 9), printf('%036x', 1));
    insert into artifact_place values (1, '0193f0a0-0000-7000-8000-000000000000');

    insert into keyring values (1, 'lightpath keyring 1', 15);
    insert into signing_key values (printf('%064x', 2), 'private', 15);

    insert into webhook values
        ('ci', 'https://hooks.example/', '["job.failed"]', null, 'secret', 'ada', 16, 1, null, null);
    insert into webhook_delivery values (1, 'ci', printf('%032x', 1), 'job.failed', '{"job":"jobs/d"}', 13, 2, 17, 0, 'HTTP 503');

    insert into process values ('0193f0a0-0000-7000-8000-000000000000', 'both', 'lab', '0.1.0', '["gpu"]', 7, 1, 1, 2);

    insert into older_programs values (9, 8);

    insert into pause values ('', 14, 'the laser is off');
    insert into token values ('ada', printf('%064x', 1), 'submitter', '[]', 1, null, null)"#,
)];

/// Creates a database as the version with this number of migrations left it.
pub(super) async fn create_database(path: &Path, steps: usize) {
    let mut connection = connect_options(path).connect().await.unwrap();
    for step in 1..=steps {
        migrator(step, |step| step.sqlite).run(&mut connection).await.unwrap();
        for (_, rows) in ROWS.iter().filter(|(after, _)| *after == step) {
            sqlx::raw_sql(*rows).execute(&mut connection).await.unwrap();
        }
    }
    connection.close().await.unwrap();
}

/// SQL text of every table, index and trigger, without white space.
async fn schema(path: &Path) -> Vec<(String, String)> {
    let mut connection = connect_options(path).connect().await.unwrap();
    let sql = "select type || ' ' || name as name, coalesce(sql, '') as sql from sqlite_master order by 1";
    let rows = sqlx::query(sql).fetch_all(&mut connection).await.unwrap();
    connection.close().await.unwrap();
    rows.iter().map(|row| (row.get("name"), row.get("sql"))).collect()
}

/// The schema of a database that the present program creates.
async fn current_schema(folder: &Path) -> Vec<(String, String)> {
    let fresh = folder.join("fresh.db");
    Store::open(&fresh).await.unwrap().close().await;
    schema(&fresh).await
}

#[tokio::test]
async fn migration_keeps_the_data_of_every_version() {
    let folder = tempfile::tempdir().unwrap();
    let expected = current_schema(folder.path()).await;
    for steps in STEPS_OF_0_1_0..=MIGRATIONS.len() {
        let path = folder.path().join(format!("{steps}.db"));
        create_database(&path, steps).await;
        let store = Store::open(&path).await.unwrap();
        let square = Display { height_px: 64, ..display("lab") };
        assert_eq!(store.display("lab").await.unwrap().0, square, "after {steps} steps");
        assert_eq!(store.artifact(&digest(3)).await.unwrap().unwrap().size_bytes, 7);
        let dataset = store.dataset("d").await.unwrap();
        assert_eq!((dataset.pairs.len(), dataset.digest.as_deref()), (2, Some("sha256-d")));
        store.add_pairs("open", &[pair(0)], &[]).await.unwrap();
        assert_registry_kept(&store).await;
        assert_kernels_kept(&store).await;
        assert_eq!(store.tokens().await.unwrap().len(), 1);
        assert_jobs_kept(&store).await;
        store.record_artifact(&digest(0), 7, "", None, 20).await.unwrap().unwrap();
        submit(&store, "new", 20).await;
        assert!(store.claim(20, LEASE_MS, "w").await.unwrap().is_some());
        store.close().await;
        assert_eq!(schema(&path).await, expected, "after {steps} steps");
        let mut inspection = Inspection::open(&path).await.unwrap();
        assert_eq!(inspection.damages().await.unwrap(), Vec::<String>::new(), "after {steps} steps");
        assert_eq!(inspection.contradictions().await.unwrap(), Vec::<String>::new());
        inspection.close().await.unwrap();
    }
}

/// Every migration is a transaction of its own, so a program that dies between two migrations leaves only some of them
/// done.
#[tokio::test]
async fn only_the_server_completes_an_interrupted_migration() {
    let folder = tempfile::tempdir().unwrap();
    let expected = current_schema(folder.path()).await;
    for steps in 1..MIGRATIONS.len() {
        let path = folder.path().join(format!("{steps}.db"));
        create_database(&path, steps).await;
        let opened = Store::open_shared(&path).await.map(drop);
        assert!(matches!(opened, Err(StoreError::OlderDatabase)), "after {steps} steps: {opened:?}");
        Store::open(&path).await.unwrap().close().await;
        assert_eq!(schema(&path).await, expected, "after {steps} steps");
        Store::open_shared(&path).await.unwrap().close().await;
    }
}

async fn assert_kernels_kept(store: &Store) {
    assert_eq!(store.kernel(&key()).await.unwrap().active_version, Some(1));
    let moved = &store.kernel_moves(&key(), None, 9).await.unwrap()[0];
    assert_eq!((moved.cause.caller.as_str(), moved.cause.reason.as_str()), ("ada", "good"));
    for model in [KernelModel::Display, KernelModel::Varying] {
        let content = NewKernelVersion { model, ..new_version(2) };
        let added = store.add_kernel_version(&key(), content, 20).await.unwrap();
        assert_eq!(store.kernel_version(&key(), added.version).await.unwrap().content.model, model);
    }
}

async fn assert_registry_kept(store: &Store) {
    assert_eq!(store.kernel(&key()).await.unwrap().aliases["candidate"], 1);
    let deprecation = store.kernel_version(&key(), 1).await.unwrap().deprecation.unwrap();
    assert_eq!((deprecation.time_ms, deprecation.cause.reason.as_str()), (10, "old lens"));
    let gate = &store.gates("lab", 9).await.unwrap()[0].gate;
    assert_eq!((gate.loss_reduction_min, gate.forms.as_slice()), (Some(0.05), &[KernelFormat::Compact][..]));
    let device = &store.devices("lab", None, 9).await.unwrap()[0];
    let installed = &device.kernels[0];
    assert_eq!((device.group.as_str(), installed.file.as_ref().unwrap().digest.as_str()), ("first", "sha256-c"));
    assert_eq!((&installed.kernel, installed.self_test_loss), (&key(), Some(0.5)));
    let (rollout, events) = store.rollout(&key(), 1).await.unwrap();
    assert_eq!((rollout.state, rollout.devices_passed, events.len()), (RolloutState::Completed, 1, 1));
}

async fn assert_jobs_kept(store: &Store) {
    use JobState::{Cancelled, Failed, Queued, Running, Succeeded};
    let mut jobs = store.jobs(&JobFilter::default(), None, 9).await.unwrap();
    jobs.reverse();
    let states: Vec<_> = jobs.iter().map(|job| (job.id.as_str(), job.state)).collect();
    assert_eq!(
        states,
        [("a", Queued), ("b", Running), ("c", Succeeded), ("d", Failed), ("e", Cancelled), ("f", Queued)]
    );
    assert!(matches!(&jobs[2].result, Some(JobResult::SimulateCapture(capture)) if capture.photo == digest(1)));
    assert_eq!(jobs[0].spec, new_job("", 1).spec);
    assert_eq!(jobs[5].scheduling.needs.to_string(), "bench-2, gpu");
    store.recover_orphans(None, 14).await.unwrap();
    let job = store.job("b").await.unwrap();
    assert_eq!((job.state, job.checkpoint.as_deref()), (Queued, Some("sha256-c")));
    assert_eq!(store.retry("d", 15).await.unwrap().state, Queued);
    assert!(store.claim(16, LEASE_MS, "w").await.unwrap().is_none(), "the queue is paused");
    store.resume(None).await.unwrap();
    for _ in ["a", "b", "d"] {
        let (_, lease) = store.claim(16, LEASE_MS, "w").await.unwrap().unwrap();
        store.finish(&lease, result(), JobEffect::None, 17).await.unwrap();
    }
}

/// A program of the version before works on a database that a newer one has migrated only if each new migration says so.
#[tokio::test]
async fn older_program_works_where_newer_migrations_allow_it() {
    let database = TestDatabase::new().await;
    let old = database.open().await;
    prepare(&old).await;
    let known = MIGRATIONS.len() as i64;
    let bytes = if database.url.is_some() { "bytea" } else { "blob" };
    let migrate = async |version: i64, allows: Option<i64>| {
        let insert = "insert into _sqlx_migrations (version, description, success, checksum, execution_time)";
        database
            .change(&format!("{insert} values ({version}, '00{version}_later', true, cast('x' as {bytes}), 1)"))
            .await;
        if let Some(known_min) = allows {
            database.change(&format!("insert into older_programs values ({version}, {known_min})")).await;
        }
    };
    migrate(known + 1, Some(known)).await;
    // One that was open before goes on, and one of the same version starts.
    submit(&old, "before", 2).await;
    let again = database.open().await;
    assert!(again.claim(3, LEASE_MS, "w").await.unwrap().is_some());
    let mut inspection = database.inspect().await;
    assert_eq!(inspection.steps().await.unwrap().last().unwrap(), &format!("00{}_later", known + 1));
    inspection.close().await.unwrap();
    again.close().await;

    // The second one demands a program that knows the first one.
    migrate(known + 2, Some(known + 1)).await;
    assert_newer(&database, known + 2).await;
    database.change(&format!("delete from older_programs where migration = {}", known + 1)).await;
    assert_newer(&database, known + 1).await;
}

/// Checks that the database is refused because of this migration, and stays as it is.
async fn assert_newer(database: &TestDatabase, step: i64) {
    let (opened, shared, inspected) = match &database.url {
        None => (
            Store::open(&database.file()).await.map(drop),
            Store::open_shared(&database.file()).await.map(drop),
            Inspection::open(&database.file()).await.map(drop),
        ),
        Some(url) => (
            Store::connect(url).await.map(drop),
            Store::connect_shared(url).await.map(drop),
            Inspection::connect(url).await.map(drop),
        ),
    };
    for refused in [opened, shared, inspected] {
        assert!(matches!(refused, Err(StoreError::NewerDatabase { step: found }) if found == step), "{refused:?}");
    }
}

#[tokio::test]
async fn database_with_a_changed_migration_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lightpath.db");
    Store::open(&path).await.unwrap().close().await;
    let mut connection = connect_options(&path).connect().await.unwrap();
    sqlx::query("update _sqlx_migrations set checksum = x'00' where version = 3")
        .execute(&mut connection)
        .await
        .unwrap();
    connection.close().await.unwrap();
    let refused = Store::open(&path).await.map(drop);
    assert!(matches!(refused, Err(StoreError::Migration(_))), "{refused:?}");
}
