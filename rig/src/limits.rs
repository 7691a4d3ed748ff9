//! Limits of the bench, from the rig's own file. No request can exceed them.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// The time over which the duty counts.
const MINUTE: Duration = Duration::from_secs(60);

/// What the bench allows.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    /// Longest exposure \[s\].
    pub exposure_max_s: f64,
    /// Most frames of a photograph.
    pub frames_max: u32,
    /// Largest part of any minute in which light may be on, where there is a shutter; `None`: no limit.
    pub duty_max: Option<f64>,
}

impl Limits {
    /// Checks what a photograph asks for; the error names the limit.
    ///
    /// # Errors
    ///
    /// A text for people, if the limits forbid the photograph.
    pub fn check(&self, exposure_s: f64, frames: u32, dark: bool) -> Result<(), String> {
        if exposure_s > self.exposure_max_s {
            let (asked, most) = (exposure_s * 1e3, self.exposure_max_s * 1e3);
            return Err(format!(
                "the exposure of {asked} ms is longer than limits.exposure_max_ms of this rig, {most} ms"
            ));
        }
        if frames > self.frames_max {
            let most = self.frames_max;
            return Err(format!("{frames} frames are more than limits.frames_max of this rig, {most}"));
        }
        if let Some(duty) = self.duty_max
            && !dark
        {
            let (light_s, most_s) = (exposure_s * f64::from(frames), duty * MINUTE.as_secs_f64());
            if light_s > most_s {
                return Err(format!(
                    "the photograph needs light for {light_s:.3} s, but limits.duty_percent of this rig allows {most_s:.3} s \
                     in any minute"
                ));
            }
        }
        Ok(())
    }
}

/// When light was on in the last minute.
#[derive(Debug, Default)]
pub struct Duty {
    lit: VecDeque<(Instant, Instant)>,
}

impl Duty {
    /// Remembers that light was on.
    pub fn add(&mut self, from: Instant, to: Instant) {
        self.lit.push_back((from, to));
        while self.lit.front().is_some_and(|(_, end)| to.saturating_duration_since(*end) > MINUTE) {
            self.lit.pop_front();
        }
    }

    /// Time for which light was on in the minute that ends at `now`.
    #[must_use]
    pub fn lit(&self, now: Instant) -> Duration {
        let begin = now.checked_sub(MINUTE);
        let within = |&(from, to): &(Instant, Instant)| {
            to.saturating_duration_since(begin.map_or(from, |begin| begin.max(from)))
        };
        self.lit.iter().map(within).sum()
    }

    /// The earliest time from which light may be on for `wanted`, if in any minute it may be on for `allowed`. `wanted` is
    /// at most `allowed`.
    #[must_use]
    pub fn earliest(&self, wanted: Duration, allowed: Duration, now: Instant) -> Instant {
        // Light leaves the minute that ends with the wanted light as that minute moves on. Each end of a lit time is when
        // some more has left.
        let fits = |begin: Instant| self.lit(begin + wanted) + wanted <= allowed;
        let mut time = now;
        while !fits(time) && time < now + MINUTE {
            time += Duration::from_millis(50);
        }
        time
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_named() {
        let limits = Limits { exposure_max_s: 0.1, frames_max: 64, duty_max: Some(0.1) };
        assert_eq!(limits.check(0.1, 60, false), Ok(()));
        for (exposure_s, frames, name) in
            [(0.11, 1, "limits.exposure_max_ms"), (0.001, 65, "limits.frames_max"), (0.1, 61, "limits.duty_percent")]
        {
            assert!(limits.check(exposure_s, frames, false).unwrap_err().contains(name), "{name}");
        }
        assert_eq!(limits.check(0.1, 61, true), Ok(()), "no light is on in a dark photograph");
    }

    #[test]
    fn light_waits_until_the_minute_has_room_for_it() {
        let begin = Instant::now();
        let at = |s| begin + Duration::from_secs(s);
        let mut duty = Duty::default();
        let (second, allowed) = (Duration::from_secs(1), Duration::from_secs(6));
        assert_eq!(duty.earliest(6 * second, allowed, begin), begin);
        duty.add(at(0), at(5));
        assert_eq!(duty.lit(at(10)), 5 * second);
        assert_eq!(duty.earliest(second, allowed, at(10)), at(10));
        // A second more fits when a second of the old light is more than a minute past: 61 s after it began.
        let waited = duty.earliest(2 * second, allowed, at(10)).duration_since(begin).as_secs_f64();
        assert!((58.9..59.2).contains(&waited), "{waited}");
        duty.add(at(70), at(71));
        assert_eq!(duty.lit(at(71)), second, "what was before is forgotten");
    }
}
