//! Requests with an id that made something: repeated, they return what they made.

use super::sql::{Connection, query, query_as};
use super::write::Write;
use super::{Result, Store, StoreError};

/// Time for which a request is known \[ms\]: 30 days, longer than any client repeats a call.
const KNOWN_MS: i64 = 30 * 24 * 3600 * 1000;

/// By what a repeated request is known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RequestMark {
    /// Name of the caller's token; empty: no token was required. Each caller has ids of its own.
    pub caller: String,
    /// Id that the caller chose.
    pub request_id: String,
    /// Kind and digest of the request.
    pub content: String,
}

impl Store {
    /// The number of what an earlier request with this mark made, if there was one.
    ///
    /// # Errors
    ///
    /// [`StoreError::AlreadyExists`] if the caller used the id for another request.
    pub async fn made_by(&self, mark: &RequestMark) -> Result<Option<u32>> {
        made_by(&mut self.readers().acquire().await?, mark).await
    }
}

/// [`Store::made_by`] within a transaction.
pub(super) async fn made_by(sql: &mut Connection, mark: &RequestMark) -> Result<Option<u32>> {
    let made: Option<(String, u32)> =
        query_as("select content, number from made_by_request where caller = $1 and request_id = $2")
            .bind((&mark.caller, &mark.request_id))
            .fetch_optional(sql)
            .await?;
    match made {
        Some((content, _)) if content != mark.content => {
            let resource = format!("request_id \"{}\"", mark.request_id);
            Err(StoreError::exists(resource, "for another request of the caller; choose another id"))
        }
        made => Ok(made.map(|(_, number)| number)),
    }
}

/// Notes what a request made, and forgets old requests.
pub(super) async fn note_made(write: &mut Write, mark: &RequestMark, number: u32, now_ms: i64) -> Result<()> {
    query("delete from made_by_request where time_ms < $1").bind(now_ms - KNOWN_MS).execute(write.sql()).await?;
    query("insert into made_by_request (caller, request_id, content, number, time_ms) values ($1, $2, $3, $4, $5)")
        .bind((&mark.caller, &mark.request_id, &mark.content, number, now_ms))
        .execute(write.sql())
        .await?;
    Ok(())
}
