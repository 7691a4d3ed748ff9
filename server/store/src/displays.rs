//! Stored displays.

use super::changes::Changed;
use super::rows::{json, to_json};
use super::sql::{Connection, Row, query, scalar};
use super::{Result, Store, StoreError, page};
use lightpath_domain::display::Display;
use lightpath_domain::reason::PreconditionReason;

impl Store {
    /// Stores a display and returns it with its creation time \[ms since 1970\]. Storing the same display again changes
    /// nothing.
    ///
    /// # Errors
    ///
    /// [`StoreError::AlreadyExists`] if a display with other properties has this id.
    pub async fn create_display(&self, display: &Display, now_ms: i64) -> Result<(Display, i64)> {
        let (id, content) = (display.id.clone(), to_json("display.content", display)?);
        self.write(async move |write| {
            query("insert into display (id, content, create_time_ms) values ($1, $2, $3) on conflict do nothing")
                .bind((&id, &content, now_ms))
                .execute(write.sql())
                .await?;
            let row = query("select * from display where id = $1").bind(&id).fetch_one(write.sql()).await?;
            if row.try_get::<String>("content")? != content {
                return Err(StoreError::exists(format!("displays/{id}"), "with other properties; choose another id"));
            }
            write.announce_changed(Changed::Display(id));
            display_of(&row)
        })
        .await
    }

    /// A display and its creation time \[ms since 1970\].
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`].
    pub async fn display(&self, id: &str) -> Result<(Display, i64)> {
        let row = query("select * from display where id = $1").bind(id).fetch_optional(self.readers()).await?;
        display_of(&row.ok_or_else(|| StoreError::not_found(format!("displays/{id}")))?)
    }

    /// At most `limit` displays with their creation times \[ms since 1970\], in the order of their ids and behind
    /// `after`.
    pub async fn displays(&self, after: Option<&str>, limit: u32) -> Result<Vec<(Display, i64)>> {
        let rows = query("select * from display where id > $1 order by id limit $2")
            .bind((after.unwrap_or(""), page(limit)))
            .fetch_all(self.readers())
            .await?;
        rows.iter().map(display_of).collect()
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

fn display_of(row: &Row) -> Result<(Display, i64)> {
    Ok((json(row, "display.content")?, row.try_get("create_time_ms")?))
}

/// Checks that the display exists.
pub(super) async fn require_display(sql: &mut Connection, id: &str) -> Result<()> {
    let known: bool = scalar("select exists (select 1 from display where id = $1)").bind(id).fetch_one(sql).await?;
    if known { Ok(()) } else { Err(StoreError::not_found(format!("displays/{id}"))) }
}
