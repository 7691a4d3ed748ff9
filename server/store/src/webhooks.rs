//! Webhooks.

use super::changes::Change;
use super::deliveries::delivery_of;
use super::displays::{require_display, require_revision};
use super::rows::{json, to_json};
use super::sql::{Row, from_row, query, scalar};
use super::{AbortReason, Result, Store, StoreError};
use lightpath_domain::reason::PreconditionReason;
use lightpath_domain::webhook::{Delivery, Webhook, WebhookEvent, WebhookSecret, WebhookUrl};
use std::collections::BTreeMap;

/// Limit on the webhooks of a server. Every event writes a row for each of them.
pub const WEBHOOKS_MAX: u32 = 32;

/// New properties of a webhook; `None`: as before.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WebhookChange {
    /// The address.
    pub url: Option<WebhookUrl>,
    /// The events that it learns of; empty: all.
    pub events: Option<Vec<WebhookEvent>>,
    /// Id of the display whose events it learns of; `None` within: all displays.
    pub display: Option<Option<String>>,
}

impl Store {
    /// Stores a new webhook with the key that signs what it gets.
    ///
    /// # Errors
    ///
    /// [`StoreError::AlreadyExists`] if the id is taken; [`StoreError::NotFound`] if its display does not exist;
    /// [`StoreError::Precondition`] if there are [`WEBHOOKS_MAX`] webhooks.
    pub async fn create_webhook(&self, webhook: &Webhook, secret: &WebhookSecret) -> Result<()> {
        let (webhook, secret) = (webhook.clone(), secret.clone());
        self.write(async move |write| {
            let count: u32 = scalar("select count(*) from webhook").fetch_one(write.sql()).await?;
            if count >= WEBHOOKS_MAX {
                let message = format!("the server has {count} webhooks, its limit; delete one first");
                return Err(StoreError::precondition(PreconditionReason::WebhooksFull, message));
            }
            if let Some(display) = &webhook.display {
                require_display(write.sql(), display).await?;
            }
            let inserted = query(
                "insert into webhook (id, url, events, display, secret, caller, create_time_ms) \
                 values ($1, $2, $3, $4, $5, $6, $7) on conflict do nothing",
            )
            .bind((&webhook.id, webhook.url.as_str(), to_json("webhook.events", &webhook.events)?, webhook.display))
            .bind((secret.reveal(), webhook.caller, webhook.create_time_ms))
            .execute(write.sql())
            .await?;
            match inserted {
                1 => Ok(()),
                _ => Err(StoreError::exists(name(&webhook.id), "on the server; choose another id")),
            }
        })
        .await
    }

    /// A webhook.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`].
    pub async fn webhook(&self, id: &str) -> Result<Webhook> {
        let row = query("select * from webhook where id = $1").bind(id).fetch_optional(self.readers()).await?;
        webhook_of(&row.ok_or_else(|| StoreError::not_found(name(id)))?)
    }

    /// The key that signs what a webhook gets.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`].
    pub async fn webhook_secret(&self, id: &str) -> Result<WebhookSecret> {
        let secret: Option<String> =
            scalar("select secret from webhook where id = $1").bind(id).fetch_optional(self.readers()).await?;
        let secret = secret.ok_or_else(|| StoreError::not_found(name(id)))?;
        WebhookSecret::parse(&secret).ok_or_else(|| StoreError::corrupt("webhook.secret", "is no key"))
    }

    /// All webhooks, in the order of their ids.
    pub async fn webhooks(&self) -> Result<Vec<Webhook>> {
        let rows = query("select * from webhook order by id").fetch_all(self.readers()).await?;
        rows.iter().map(webhook_of).collect()
    }

    /// Changes a webhook, which must have the revision `expected`, and returns it. What it has already changes nothing.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the webhook or its display does not exist; [`StoreError::Aborted`] if it has another
    /// revision.
    pub async fn update_webhook(&self, id: &str, change: WebhookChange, expected: u32) -> Result<Webhook> {
        let id = id.to_owned();
        self.write(async move |write| {
            let row = query("select * from webhook where id = $1").bind(&id).fetch_optional(write.sql()).await?;
            let before = webhook_of(&row.ok_or_else(|| StoreError::not_found(name(&id)))?)?;
            require_revision(AbortReason::WebhookChanged, &name(&id), before.revision, Some(expected))?;
            let after = change.of(before.clone());
            if after == before {
                return Ok(before);
            }
            if let Some(display) = &after.display {
                require_display(write.sql(), display).await?;
            }
            let sql = "update webhook set url = $2, events = $3, display = $4, revision = revision + 1 \
                       where id = $1 returning *";
            let row = query(sql)
                .bind((&id, after.url.as_str(), to_json("webhook.events", &after.events)?, &after.display))
                .fetch_one(write.sql())
                .await?;
            webhook_of(&row)
        })
        .await
    }

    /// Deletes a webhook, with what it has not received yet.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`].
    pub async fn delete_webhook(&self, id: &str) -> Result<()> {
        let id = id.to_owned();
        self.write(async move |write| {
            let deleted = query("delete from webhook where id = $1").bind(&id).execute(write.sql()).await?;
            match deleted {
                0 => Err(StoreError::not_found(name(&id))),
                _ => Ok(()),
            }
        })
        .await
    }

    /// Takes this webhook for `hold_ms`, in which no other process sends its events. Returns whether this process has it
    /// now; it always has where no other process shares the database.
    pub async fn hold_webhook(&self, id: &str, now_ms: i64, hold_ms: i64) -> Result<bool> {
        if !self.is_shared() {
            return Ok(true);
        }
        let (id, process) = (id.to_owned(), self.inner.process.clone());
        self.write_row(async move |write| {
            let sql = "update webhook set teller = $2, teller_until_ms = $3 where id = $1 \
                       and (teller is null or teller = $2 or teller_until_ms <= $4 or teller_until_ms > $5)";
            let held = query(sql).bind((id, process, now_ms + hold_ms, now_ms));
            // The clocks of two processes may differ a little. A hold much longer than any is from a clock that was ahead.
            let held = held.bind(now_ms + 2 * hold_ms);
            Ok(held.execute(write.sql()).await? == 1)
        })
        .await
    }

    /// Ends what [`Self::hold_webhook`] began.
    pub async fn release_webhook(&self, id: &str) -> Result<()> {
        if !self.is_shared() {
            return Ok(());
        }
        let (id, process) = (id.to_owned(), self.inner.process.clone());
        self.write_row(async move |write| {
            let sql = "update webhook set teller = null, teller_until_ms = null where id = $1 and teller = $2";
            query(sql).bind((id, process)).execute(write.sql()).await?;
            Ok(())
        })
        .await
    }

    /// Adds an event that only tries a webhook. Returns its delivery.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`].
    pub async fn test_webhook(&self, id: &str, caller: &str, now_ms: i64) -> Result<Delivery> {
        let subject = to_json("webhook_delivery.subject", &BTreeMap::from([("caller", caller)]))?;
        let id = id.to_owned();
        self.write(async move |write| {
            let inserted = query(
                "insert into webhook_delivery (webhook, event, subject, time_ms, next_time_ms) \
                 select id, $2, $3, $4, $4 from webhook where id = $1 returning *",
            )
            .bind((&id, WebhookEvent::Test.as_str(), subject, now_ms))
            .fetch_optional(write.sql())
            .await?;
            write.announce(Change::Deliverable);
            delivery_of(&inserted.ok_or_else(|| StoreError::not_found(name(&id)))?)
        })
        .await
    }
}

impl WebhookChange {
    /// The changed webhook.
    fn of(self, before: Webhook) -> Webhook {
        Webhook {
            url: self.url.unwrap_or(before.url),
            events: self.events.unwrap_or(before.events),
            display: self.display.unwrap_or(before.display),
            ..before
        }
    }
}

fn name(id: &str) -> String {
    format!("webhooks/{id}")
}

fn webhook_of(row: &Row) -> Result<Webhook> {
    let url: String = row.try_get("url")?;
    Ok(from_row!(row, Webhook {
        id, display, caller, create_time_ms, revision;
        url: WebhookUrl::parse(&url).map_err(|error| StoreError::corrupt("webhook.url", error))?,
        events: json(row, "webhook.events")?,
    }))
}
