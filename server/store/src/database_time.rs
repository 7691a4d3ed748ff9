//! The time of day on which all processes that share a database agree.
//!
//! In PostgreSQL it is the time of the database's clock, so that the clocks of other machines need not agree with it. A
//! process asks for it from time to time and counts on evenly in between.

use super::Result;
use super::sql::{Pool, scalar};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Largest difference that does not count as a jump \[ms\].
const JUMP_MS: i64 = 1000;

/// Longest call whose answer counts, unless it is the first or says something new: a slow answer is imprecise.
const CALL_MAX: Duration = Duration::from_millis(500);

/// A reading of the database's clock.
#[derive(Clone, Copy, Debug)]
struct Reading {
    time_ms: i64,
    at: Instant,
}

impl Reading {
    fn now_ms(&self) -> i64 {
        self.time_ms.saturating_add(i64::try_from(self.at.elapsed().as_millis()).unwrap_or(i64::MAX / 2))
    }
}

/// The database's clock as this process knows it.
#[derive(Debug, Default)]
pub(super) struct DatabaseTime {
    // Held only to copy a value, so no thread waits long.
    state: Mutex<State>,
}

#[derive(Clone, Copy, Debug, Default)]
struct State {
    reading: Option<Reading>,
    /// When the last jump was noticed.
    jumped: Option<Instant>,
}

impl DatabaseTime {
    /// Asks PostgreSQL for the time. The answer is at most half the duration of the call old or young.
    pub(super) async fn read(&self, pool: &Pool) -> Result<()> {
        let asked = Instant::now();
        let sql = "select cast(extract(epoch from clock_timestamp()) * 1000 as bigint)";
        let time_ms: i64 = scalar(sql).fetch_one(pool).await?;
        let took = asked.elapsed();
        let reading = Reading { time_ms, at: asked + took / 2 };
        // After a sleep of the machine, whose clock stood still, the first answer is slow and right.
        let is_news = |before: Reading| (reading.now_ms() - before.now_ms()).unsigned_abs() > took.as_millis() as u64;
        if took <= CALL_MAX || self.state().reading.is_none_or(is_news) {
            self.note(reading);
        }
        Ok(())
    }

    /// Present time \[ms since 1970\]: of PostgreSQL's clock, or of the system's clock if it was never read.
    pub(super) fn now_ms(&self) -> i64 {
        self.state().reading.map_or_else(system_ms, |reading| reading.now_ms())
    }

    /// Time since PostgreSQL's clock was seen to be set; `None` if it was not.
    pub(super) fn since_jump(&self) -> Option<Duration> {
        self.state().jumped.map(|jumped| jumped.elapsed())
    }

    fn note(&self, reading: Reading) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let ahead_ms = state.reading.map_or(0, |before| reading.now_ms() - before.now_ms());
        if ahead_ms.abs() > JUMP_MS {
            state.jumped = Some(Instant::now());
        }
        state.reading = Some(reading);
    }

    fn state(&self) -> State {
        *self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Time of the system's clock \[ms since 1970\].
fn system_ms() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_millis()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_goes_on_evenly_and_only_a_jump_counts_as_one() {
        let time = DatabaseTime::default();
        let reading = |time_ms| Reading { time_ms, at: Instant::now() };
        time.note(reading(1_000_000));
        time.note(reading(1_000_900));
        assert!(time.state().jumped.is_none(), "a small difference comes from imprecise readings");
        let now_ms = time.state().reading.unwrap().now_ms();
        assert!((1_000_900..1_010_000).contains(&now_ms), "{now_ms}");
        time.note(reading(900_000));
        assert!(time.state().jumped.is_some());
    }
}
