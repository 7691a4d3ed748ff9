//! What webhooks are to learn, and what became of it. Triggers of the database insert the rows.

use super::rows::word;
use super::sql::{Row, from_row, query, scalar};
use super::{Result, Store, page};
use lightpath_domain::webhook::Delivery;

/// Ended deliveries of a webhook that are kept for people.
const ENDED_KEPT: u32 = 100;

/// Outcome of an attempt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Attempt {
    /// The receiver accepted the delivery.
    Accepted,
    /// There is another attempt at this time \[ms since 1970\].
    RetryAt(i64),
    /// There are no more attempts.
    GivenUp,
}

impl Store {
    /// Ids of the webhooks that have something to learn at the time `now_ms`.
    pub async fn webhooks_due(&self, now_ms: i64) -> Result<Vec<String>> {
        let sql = "select id from webhook where exists \
                   (select 1 from webhook_delivery where webhook = webhook.id and next_time_ms <= $1)";
        Ok(scalar(sql).bind(now_ms).fetch_all(self.readers()).await?)
    }

    /// Time of the next attempt of any webhook \[ms since 1970\]; `None`: nothing waits.
    pub async fn next_attempt_ms(&self) -> Result<Option<i64>> {
        let sql = "select min((select min(next_time_ms) from webhook_delivery \
                   where webhook = webhook.id and next_time_ms is not null)) from webhook";
        Ok(scalar(sql).fetch_one(self.readers()).await?)
    }

    /// What a webhook is to learn next at the time `now_ms`.
    pub async fn due_delivery(&self, webhook: &str, now_ms: i64) -> Result<Option<Delivery>> {
        let sql = "select * from webhook_delivery where webhook = $1 and next_time_ms <= $2 \
                   order by next_time_ms, sequence limit 1";
        let row = query(sql).bind((webhook, now_ms)).fetch_optional(self.readers()).await?;
        row.as_ref().map(delivery_of).transpose()
    }

    /// Notes an attempt and its answer, unless another process has noted one meanwhile. Only the latest hundred ended deliveries of a webhook stay.
    ///
    /// # Errors
    ///
    /// [`crate::StoreError::Database`], [`crate::StoreError::DiskFull`]. Without the note, the next attempt repeats this one.
    pub async fn note_attempt(&self, delivery: &Delivery, attempt: Attempt, answer: &str) -> Result<()> {
        let (webhook, sequence, answer) = (delivery.webhook.clone(), delivery.sequence, answer.to_owned());
        let delivery_attempts = delivery.attempts;
        let next_ms = match attempt {
            Attempt::RetryAt(time_ms) => Some(time_ms),
            Attempt::Accepted | Attempt::GivenUp => None,
        };
        self.write(async move |write| {
            let sql = "update webhook_delivery set attempts = attempts + 1, next_time_ms = $2, delivered = $3, \
                       answer = $4 where sequence = $1 and attempts = $5 and next_time_ms is not null";
            query(sql)
                .bind((sequence, next_ms, attempt == Attempt::Accepted, answer, delivery_attempts))
                .execute(write.sql())
                .await?;
            let forget_old = "delete from webhook_delivery where webhook = $1 and next_time_ms is null \
                     and sequence <= (select sequence from webhook_delivery where webhook = $1 \
                     and next_time_ms is null order by sequence desc limit 1 offset $2)";
            query(forget_old).bind((webhook, ENDED_KEPT)).execute(write.sql()).await?;
            Ok(())
        })
        .await
    }

    /// At most `limit` deliveries of a webhook, the newest first and older than `before`: all that wait, and those that
    /// ended lately.
    ///
    /// # Errors
    ///
    /// [`crate::StoreError::NotFound`] if the webhook does not exist.
    pub async fn deliveries(&self, webhook: &str, before: Option<i64>, limit: u32) -> Result<Vec<Delivery>> {
        self.webhook(webhook).await?;
        let sql = "select * from webhook_delivery where webhook = $1 and sequence < $2 order by sequence desc limit $3";
        let query = query(sql).bind((webhook, before.unwrap_or(i64::MAX), page(limit)));
        query.fetch_all(self.readers()).await?.iter().map(delivery_of).collect()
    }

    /// Number of deliveries that wait for their next attempt.
    pub async fn deliveries_waiting(&self) -> Result<u64> {
        let sql = "select count(*) from webhook_delivery where next_time_ms is not null";
        Ok(scalar(sql).fetch_one(self.readers()).await?)
    }
}

pub(super) fn delivery_of(row: &Row) -> Result<Delivery> {
    Ok(from_row!(row, Delivery {
        sequence, id, webhook, subject, time_ms, attempts, next_time_ms, delivered, answer;
        event: word(row, "webhook_delivery.event")?,
    }))
}
