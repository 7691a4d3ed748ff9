//! Random histories of a whole queue, compared with a simple model. The model keeps only a list of jobs and examines
//! all of them for every question. It has no lanes and no counts.
//!
//! `LIGHTPATH_MODEL_COMMANDS=100000 cargo test --release -p lightpath-store --lib the_queue_agrees_with_its_model` runs
//! that many commands; by default the test is short.

mod command;
mod comparison;
mod model;

use self::command::command;
use self::comparison::Comparison;
use self::model::Model;
use super::*;
use crate::sql::scalar;
use crate::{ClaimLimits, JobFilter, QueueLimits};
use lightpath_domain::ability::{Abilities, Labels};
use lightpath_domain::job::{JobState, Lease, Scheduling};
use proptest::prelude::*;
use std::collections::BTreeSet;

/// Number of commands in one history.
const HISTORY: usize = 250;
/// Number of commands in a normal test run.
const COMMANDS: usize = 3000;
const OWNERS: [&str; 3] = ["", "ada", "bob"];
const DISPLAYS: [&str; 2] = ["lab", "other"];
/// Sets of needs, and of labels of processes.
const LABELS: [&str; 4] = ["", "a", "b", "a,b"];
/// Memory of jobs, what it counts for, and limits of processes \[bytes\].
const MEMORY: [u64; 4] = [0, 33 << 20, (33 << 20) + 1, 90 << 20];
const COUNTED: [u64; 4] = [0, 34 << 20, 34 << 20, 92 << 20];
const LIMITS: [u64; 4] = [u64::MAX, 34 << 20, 64 << 20, (34 << 20) - 1];
const KEYS: [&str; 2] = ["k", "l"];
const QUEUE: QueueLimits = QueueLimits { queued: 12, queued_per_owner: 6, stored_bytes_per_owner: 0 };

fn histories() -> u32 {
    let commands = std::env::var("LIGHTPATH_MODEL_COMMANDS").map_or(COMMANDS, |commands| commands.parse().unwrap());
    commands.div_ceil(HISTORY) as u32
}

proptest! {
    #![proptest_config(ProptestConfig { cases: histories(), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_queue_agrees_with_its_model(commands in prop::collection::vec(command(), HISTORY)) {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let (store, database) = store().await;
            store.create_display(&display("other"), 1).await.unwrap();
            let mut comparison = Comparison { store, model: Model { now_ms: 1000, ..Model::default() }, submitted: 0 };
            for command in commands {
                comparison.run(command.clone()).await;
                comparison.compare().await;
            }
            comparison.store.close().await;
            // Only a job with many revisions can have too many events.
            let more_events = "select count(*) from job where revision < (select count(*) from job_event where job = job.id)";
            let mut connection = database.connect().await;
            let found: i64 = scalar(more_events).fetch_one(&mut connection).await.unwrap();
            assert_eq!(found, 0);
            // Lanes and their needs are those of the jobs that are ready.
            let lanes = "select count(*) from (select priority, owner, display, needs, counted_bytes, count(*) as ready \
                         from job where state = 'queued' and waiting_for = 0 group by 1, 2, 3, 4, 5) counted \
                         natural full join lane where coalesce(counted.ready, 0) <> coalesce(lane.ready, 0)";
            let found: i64 = scalar(lanes).fetch_one(&mut connection).await.unwrap();
            assert_eq!(found, 0);
            let needs = "select count(*) from (select needs, count(*) as lanes from lane where needs <> '[]' group by needs) \
                         counted natural full join lane_needs where coalesce(counted.lanes, 0) <> coalesce(lane_needs.lanes, 0)";
            let found: i64 = scalar(needs).fetch_one(&mut connection).await.unwrap();
            assert_eq!(found, 0);
            connection.close().await.unwrap();
            let mut inspection = database.inspect().await;
            assert_eq!(inspection.damages().await.unwrap(), Vec::<String>::new());
            assert_eq!(inspection.contradictions().await.unwrap(), Vec::<String>::new());
            inspection.close().await.unwrap();
        });
    }
}
