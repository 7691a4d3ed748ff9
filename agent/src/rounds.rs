//! The rounds of an agent, or of a set of agents: check, report, pause, for ever.

use crate::problem::Problem;
use crate::schedule::Backoff;
use crate::{Pace, log};
use std::thread;
use std::time::{Duration, Instant};

/// What goes through the rounds.
pub(crate) trait Rounds {
    fn pace(&self) -> Pace;

    /// Asks the server, which may wait so long for a change. Returns the time after which to ask again.
    fn round(&mut self, wait: Duration) -> Result<Duration, Problem>;

    /// Sends the reports that are due.
    fn report_due(&mut self);

    /// Time until a report is due.
    fn report_due_in(&self) -> Duration;

    /// Time until a manifest expires.
    fn until_expiry(&self) -> Duration;

    /// Checks and reports for ever. A problem is logged, and the next try comes after a pause.
    fn go_on(&mut self) -> ! {
        let pace = self.pace();
        let mut backoff = Backoff::new(pace.error_pause_min, pace.error_pause_max);
        self.report_due();
        loop {
            let pause = match self.round(pace.wait) {
                Ok(poll_after) => {
                    backoff.reset();
                    poll_after
                }
                Err(problem) => {
                    if let Problem::Cut { has_progress: true, .. } = problem {
                        backoff.reset();
                    }
                    let pause = backoff.next().max(problem.retry_after().unwrap_or_default());
                    log::line(format_args!("{problem}; the agent tries again in {:.0} s", pause.as_secs_f64()));
                    pause
                }
            };
            self.sleep(pause.min(self.until_expiry()));
        }
    }

    /// Sleeps, and sends the reports that become due.
    fn sleep(&mut self, pause: Duration) {
        let end = Instant::now() + pause;
        loop {
            self.report_due();
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return;
            }
            thread::sleep(left.min(self.report_due_in()));
        }
    }
}
