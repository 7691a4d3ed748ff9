//! Time spent in evaluations of loss and gradient, measured with a clock that the caller gives. This crate reads
//! no clock of its own.

use std::time::Duration;

/// Monotonic clock: returns the time since a fixed moment.
pub type Clock = fn() -> Duration;

/// Adds up the time between starts and stops; measures nothing without a clock.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stopwatch {
    pub(super) clock: Option<Clock>,
    pub(super) spent: Duration,
}

impl Stopwatch {
    pub(super) fn start(&self) -> Option<Duration> {
        self.clock.map(|clock| clock())
    }

    pub(super) fn stop(&mut self, begin: Option<Duration>) {
        if let (Some(clock), Some(begin)) = (self.clock, begin) {
            self.spent += clock().saturating_sub(begin);
        }
    }
}
