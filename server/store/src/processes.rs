//! Signs of life of the processes that work on a database.
//!
//! Each process that shares a database renews its row every few seconds, by the database's clock, and reads those of the
//! others. A row whose time is over is removed by anyone. Without a shared database there is one process, which needs no row.

use super::living::{LIFE, Process};
use super::rows::{json, to_json, to_word, word};
use super::sql::{Row, from_row, query};
use super::{Result, Store};
use lightpath_domain::ability::Abilities;
use std::sync::Arc;

impl Store {
    /// The living processes by name, as this process last read them: after its latest sign of life.
    #[must_use]
    pub fn living(&self) -> Arc<[Process]> {
        self.inner.living.processes()
    }

    /// Gives a sign of life for this process and reads those of the others. Removes those that have ended.
    pub async fn sign_of_life(&self, process: &Process) -> Result<()> {
        let process = Process { seen_time_ms: self.now_ms(), ..process.clone() };
        if !self.is_shared() {
            self.inner.living.set(vec![process]);
            return Ok(());
        }
        let (kind, labels) =
            (to_word("process.kind", &process.kind)?, to_json("process.labels", &process.abilities.labels)?);
        self.write_row(async move |write| {
            let sql = "insert into process values ($1, $2, $3, $4, $5, $6, $7, $8, $9) on conflict (id) do update set \
                       kind = excluded.kind, name = excluded.name, version = excluded.version, \
                       labels = excluded.labels, memory_bytes = excluded.memory_bytes, workers = excluded.workers, \
                       start_time_ms = excluded.start_time_ms, seen_time_ms = excluded.seen_time_ms";
            query(sql)
                .bind((process.id, kind, process.name, process.version, labels))
                .bind((i64::try_from(process.abilities.memory_bytes).unwrap_or(i64::MAX), process.workers))
                .bind((process.start_time_ms, process.seen_time_ms))
                .execute(write.sql())
                .await?;
            Ok(())
        })
        .await?;
        if self.read_living().await? {
            self.remove_ended().await?;
        }
        Ok(())
    }

    /// Reads which processes live. Returns whether there are rows of others.
    pub async fn read_living(&self) -> Result<bool> {
        if !self.is_shared() {
            return Ok(false);
        }
        let (from_ms, to_ms) = self.time_of_living();
        let rows = query("select * from process order by name, id").fetch_all(self.readers()).await?;
        let all: Vec<Process> = rows.iter().map(process_of).collect::<Result<_, _>>()?;
        let count = all.len();
        let lives = |process: &Process| (from_ms..=to_ms).contains(&process.seen_time_ms);
        let living: Vec<Process> = all.into_iter().filter(lives).collect();
        let has_ended = living.len() < count;
        self.inner.living.set(living);
        Ok(has_ended)
    }

    /// Removes the row of a process that stops.
    pub async fn sign_off(&self, id: &str) -> Result<()> {
        if !self.is_shared() {
            return Ok(());
        }
        let id = id.to_owned();
        self.write_row(async move |write| {
            query("delete from process where id = $1").bind(id).execute(write.sql()).await?;
            Ok(())
        })
        .await
    }

    /// Removes the processes whose time is over.
    async fn remove_ended(&self) -> Result<()> {
        let (from_ms, to_ms) = self.time_of_living();
        self.write(async move |write| {
            let sql = "delete from process where seen_time_ms not between $1 and $2";
            query(sql).bind((from_ms, to_ms)).execute(write.sql()).await?;
            Ok(())
        })
        .await
    }

    /// When a living process gave its last sign of life \[ms since 1970\]. A later time is from a clock that was ahead.
    fn time_of_living(&self) -> (i64, i64) {
        let (now_ms, life_ms) = (self.now_ms(), LIFE.as_millis() as i64);
        (now_ms - life_ms, now_ms + life_ms)
    }
}

fn process_of(row: &Row) -> Result<Process> {
    Ok(from_row!(row, Process {
        id, name, version, workers, start_time_ms, seen_time_ms;
        kind: word(row, "process.kind")?,
        abilities: Abilities {
            labels: json(row, "process.labels")?,
            memory_bytes: row.try_get("memory_bytes")?,
            ..Abilities::default()
        },
    }))
}
