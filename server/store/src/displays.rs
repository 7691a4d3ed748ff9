//! Stored displays.

use super::changes::Changed;
use super::rows::{json, to_json};
use super::sql::{Connection, Row, query, scalar};
use super::{AbortReason, Result, Store, StoreError, page};
use lightpath_domain::display::Display;
use lightpath_domain::reason::PreconditionReason;
use serde_json::{Map, Value};
use std::collections::BTreeSet;

/// What is known of a stored display besides its properties.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DisplayRecord {
    /// Time when it was first stored \[ms since 1970\].
    pub create_time_ms: i64,
    /// Number of changes so far and 1.
    pub revision: u32,
}

/// Names of the properties in which two displays differ.
fn differing(stored: &str, new: &str) -> String {
    let properties = |json: &str| serde_json::from_str::<Map<String, Value>>(json).unwrap_or_default();
    let (stored, new) = (properties(stored), properties(new));
    let names: BTreeSet<&String> = stored.keys().chain(new.keys()).collect();
    let names = names.into_iter().filter(|name| stored.get(*name) != new.get(*name));
    names.map(|name| name.replace('_', " ")).collect::<Vec<_>>().join(", ")
}

impl Store {
    /// Stores a display and returns it. Storing the same display again changes
    /// nothing.
    ///
    /// # Errors
    ///
    /// [`StoreError::AlreadyExists`] if a display with other properties has this id.
    pub async fn create_display(&self, display: &Display, now_ms: i64) -> Result<(Display, DisplayRecord)> {
        let (id, content) = (display.id.clone(), to_json("display.content", display)?);
        self.write(async move |write| {
            query("insert into display (id, content, create_time_ms) values ($1, $2, $3) on conflict do nothing")
                .bind((&id, &content, now_ms))
                .execute(write.sql())
                .await?;
            let row = query("select * from display where id = $1").bind(&id).fetch_one(write.sql()).await?;
            let stored = row.try_get::<String>("content")?;
            if stored != content {
                let detail = format!("with other properties ({}); choose another id", differing(&stored, &content));
                return Err(StoreError::exists(format!("displays/{id}"), detail));
            }
            write.announce_changed(Changed::Display(id));
            display_of(&row)
        })
        .await
    }

    /// A display.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`].
    pub async fn display(&self, id: &str) -> Result<(Display, DisplayRecord)> {
        let row = query("select * from display where id = $1").bind(id).fetch_optional(self.readers()).await?;
        display_of(&row.ok_or_else(|| StoreError::not_found(format!("displays/{id}")))?)
    }

    /// At most `limit` displays, in the order of their ids and behind `after`.
    pub async fn displays(&self, after: Option<&str>, limit: u32) -> Result<Vec<(Display, DisplayRecord)>> {
        let rows = query("select * from display where id > $1 order by id limit $2")
            .bind((after.unwrap_or(""), page(limit)))
            .fetch_all(self.readers())
            .await?;
        rows.iter().map(display_of).collect()
    }

    /// Gives a display other notes, and returns it. The same notes again change nothing. The display must have the
    /// revision `expected`; `None`: any.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`]; [`StoreError::Aborted`] if it has another revision.
    pub async fn set_display_notes(
        &self,
        id: &str,
        notes: String,
        expected: Option<u32>,
    ) -> Result<(Display, DisplayRecord)> {
        let id = id.to_owned();
        self.write(async move |write| {
            let row = query("select * from display where id = $1").bind(&id).fetch_optional(write.sql()).await?;
            let row = row.ok_or_else(|| StoreError::not_found(format!("displays/{id}")))?;
            let (before, record) = display_of(&row)?;
            require_revision(AbortReason::DisplayChanged, &format!("displays/{id}"), record.revision, expected)?;
            if before.notes == notes {
                return Ok((before, record));
            }
            let content = to_json("display.content", &Display { notes, ..before })?;
            let sql = "update display set content = $2, revision = revision + 1 where id = $1 returning *";
            let row = query(sql).bind((&id, content)).fetch_one(write.sql()).await?;
            write.announce_changed(Changed::Display(id));
            display_of(&row)
        })
        .await
    }

    /// Deletes a display that no dataset, kernel or job refers to, with its pause.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`]; [`StoreError::Precondition`] while it has datasets, kernels or jobs.
    pub async fn delete_display(&self, id: &str) -> Result<()> {
        let id = id.to_owned();
        self.write(async move |write| {
            let users: Option<String> = scalar(
                "select 'dataset' from dataset where display = $1 union all \
                 select 'kernel' from kernel where display = $1 union all \
                 select 'job' from job where display = $1 limit 1",
            )
            .bind(&id)
            .fetch_optional(write.sql())
            .await?;
            if let Some(user) = users {
                let message = format!("displays/{id} cannot be deleted while a {user} refers to it");
                return Err(StoreError::precondition(PreconditionReason::DisplayInUse, message));
            }
            let deleted = query("delete from display where id = $1").bind(&id).execute(write.sql()).await?;
            match deleted {
                0 => Err(StoreError::not_found(format!("displays/{id}"))),
                _ => {
                    write.announce_changed(Changed::Display(id));
                    Ok(())
                }
            }
        })
        .await
    }
}

/// Checks that a resource has the revision that the caller has seen; `None`: any.
pub(super) fn require_revision(reason: AbortReason, name: &str, revision: u32, expected: Option<u32>) -> Result<()> {
    match expected {
        Some(expected) if expected != revision => {
            let message = format!("{name} has the revision {revision}, not {expected}: it changed meanwhile");
            Err(StoreError::Aborted { reason, message })
        }
        _ => Ok(()),
    }
}

fn display_of(row: &Row) -> Result<(Display, DisplayRecord)> {
    let record = DisplayRecord { create_time_ms: row.try_get("create_time_ms")?, revision: row.try_get("revision")? };
    Ok((json(row, "display.content")?, record))
}

/// Checks that the display exists.
pub(super) async fn require_display(sql: &mut Connection, id: &str) -> Result<()> {
    let known: bool = scalar("select exists (select 1 from display where id = $1)").bind(id).fetch_one(sql).await?;
    if known { Ok(()) } else { Err(StoreError::not_found(format!("displays/{id}"))) }
}
