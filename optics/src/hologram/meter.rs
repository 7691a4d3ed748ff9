//! How long the passes of evaluations take, by the clock of whoever wants to know: nothing here looks at one by itself.

use std::time::Duration;

/// A clock that goes evenly: the time since any one moment.
pub type Clock = fn() -> Duration;

/// What is measured of an optimization; nothing without a clock.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Meter {
    pub(super) clock: Option<Clock>,
    pub(super) spent: Duration,
}

impl Meter {
    pub(super) fn start(&self) -> Option<Duration> {
        self.clock.map(|clock| clock())
    }

    pub(super) fn stop(&mut self, begin: Option<Duration>) {
        if let (Some(clock), Some(begin)) = (self.clock, begin) {
            self.spent += clock().saturating_sub(begin);
        }
    }
}
