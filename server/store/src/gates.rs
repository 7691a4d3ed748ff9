//! Promotion gates of displays.

use super::changes::Changed;
use super::rows::{cause_of, json, to_json};
use super::sql::{Row, query};
use super::{Result, Store, StoreError, page};
use lightpath_domain::kernel::Cause;
use lightpath_domain::promotion::{GateChange, PromotionGate};

impl Store {
    /// Sets the promotion gate of a display.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the display does not exist.
    pub async fn set_gate(&self, display: &str, gate: &PromotionGate, cause: &Cause, now_ms: i64) -> Result<()> {
        let (display, gate, cause) = (display.to_owned(), to_json("promotion_gate.gate", gate)?, cause.clone());
        self.write(async move |write| {
            let inserted = query(
                "insert into promotion_gate (display, time_ms, caller, reason, gate) \
                 select id, $1, $2, $3, $4 from display where id = $5",
            )
            .bind((now_ms, cause.caller, cause.reason, gate, &display))
            .execute(write.sql())
            .await?;
            match inserted {
                0 => Err(StoreError::not_found(format!("displays/{display}"))),
                _ => {
                    write.announce_changed(Changed::Display(display));
                    Ok(())
                }
            }
        })
        .await
    }

    /// At most `limit` gates that were set for a display, the newest first. The first one counts.
    pub async fn gates(&self, display: &str, limit: u32) -> Result<Vec<GateChange>> {
        let rows = query("select * from promotion_gate where display = $1 order by sequence desc limit $2")
            .bind((display, page(limit)))
            .fetch_all(self.readers())
            .await?;
        let change = |row: &Row| {
            let (time_ms, cause) = (row.try_get("time_ms")?, cause_of(row)?);
            Ok(GateChange { time_ms, cause, gate: json(row, "promotion_gate.gate")? })
        };
        rows.iter().map(change).collect()
    }
}
