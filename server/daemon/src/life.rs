//! The signs of life of this process, by which others know what it can run.

use crate::config::Config;
use crate::upkeep::Result;
use lightpath_artifacts::Artifacts;
use lightpath_domain::ability::{Abilities, Labels};
use lightpath_rigs::Rigs;
use lightpath_store::{Process, ProcessKind, Store};
use std::time::Duration;
use tokio::time::{MissedTickBehavior, interval, timeout};
use tokio_util::sync::CancellationToken;

/// Interval between two signs: four of them come in the time after which a process counts as dead.
const SIGN_INTERVAL: Duration = Duration::from_secs(5);

/// Longest time for saying that this process stops.
const SIGN_OFF_MAX: Duration = Duration::from_secs(2);

/// This process among those that share the database.
#[derive(Debug)]
pub(crate) struct Life {
    store: Store,
    process: Process,
    /// Labels from the settings. The connected rigs add theirs.
    own_labels: Labels,
}

impl Life {
    /// Gives the first sign of life.
    pub(crate) async fn begin(
        store: &Store,
        artifacts: &Artifacts,
        config: &Config,
        kind: ProcessKind,
    ) -> Result<Self> {
        let now_ms = store.now_ms();
        let mut process = Process {
            id: artifacts.folder_identity().await?,
            kind,
            name: config.workers().name,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            abilities: Abilities {
                labels: config.labels()?,
                memory_bytes: config.job_bytes_max(),
                ..Abilities::default()
            },
            workers: config.workers,
            start_time_ms: now_ms,
            seen_time_ms: now_ms,
        };
        if !process.works() {
            (process.abilities, process.workers) = (Abilities { memory_bytes: 0, ..Abilities::default() }, 0);
        }
        store.sign_of_life(&process).await?;
        let own_labels = process.abilities.labels.clone();
        Ok(Self { store: store.clone(), process, own_labels })
    }

    /// Gives signs of life until the process stops, also at once when a rig comes or goes. Calls `with_servers` after each
    /// with the number of living servers, this one included.
    pub(crate) async fn go_on(mut self, rigs: Rigs, stopping: CancellationToken, with_servers: impl Fn(u32)) {
        let mut of_rigs = rigs.labels();
        let mut ticks = interval(SIGN_INTERVAL);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                () = stopping.cancelled() => break,
                _ = ticks.tick() => {}
                Ok(()) = of_rigs.changed() => {}
            }
            if self.process.works() {
                let labels = [self.own_labels.clone(), of_rigs.borrow_and_update().clone()];
                self.process.abilities.labels = Labels::all_of(labels);
            }
            let Some(signed) = stopping.run_until_cancelled(self.store.sign_of_life(&self.process)).await else {
                break;
            };
            if let Err(error) = signed {
                let error: &dyn std::error::Error = &error;
                tracing::warn!(error, "other processes could not be told that this one lives");
            }
            let servers = self.store.living().iter().filter(|process| process.serves()).count();
            with_servers(u32::try_from(servers).unwrap_or(u32::MAX));
        }
        // Without the database, the row ends by itself.
        drop(timeout(SIGN_OFF_MAX, self.store.sign_off(&self.process.id)).await);
    }
}
