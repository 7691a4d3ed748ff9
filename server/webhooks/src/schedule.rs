//! When there is another attempt.

use crate::sender::Answer;
use lightpath_domain::webhook::Delivery;
use lightpath_store::Attempt;

/// Pause after the first failed attempt \[ms\]; each further one doubles it.
const FIRST_PAUSE_MS: i64 = 5_000;
/// Longest pause between two attempts \[ms\].
const PAUSE_MS_MAX: i64 = 3_600_000;
/// Time after the event in which there are attempts \[ms\]: three days, so that a receiver may be away over a weekend.
const TRIED_MS_MAX: i64 = 3 * 86_400_000;

/// What follows an answer at the time `now_ms`.
pub(crate) fn after(delivery: &Delivery, answer: &Answer, now_ms: i64) -> Attempt {
    if answer.is_accepted() {
        return Attempt::Accepted;
    }
    let doubled = FIRST_PAUSE_MS << delivery.attempts.min(20);
    let next_ms = now_ms.saturating_add(doubled.min(PAUSE_MS_MAX));
    if next_ms - delivery.time_ms > TRIED_MS_MAX { Attempt::GivenUp } else { Attempt::RetryAt(next_ms) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_domain::webhook::WebhookEvent;

    #[test]
    fn pauses_double_up_to_an_hour_and_end_after_three_days() {
        let failed = Answer::refused("HTTP 503".to_owned());
        let mut delivery = Delivery {
            sequence: 1,
            id: String::new(),
            webhook: String::new(),
            event: WebhookEvent::Test,
            subject: String::new(),
            time_ms: 0,
            attempts: 0,
            next_time_ms: Some(0),
            delivered: false,
            answer: String::new(),
        };
        let (mut now_ms, mut pauses) = (0, Vec::new());
        while let Attempt::RetryAt(next_ms) = after(&delivery, &failed, now_ms) {
            pauses.push((next_ms - now_ms) / 1000);
            (now_ms, delivery.attempts) = (next_ms, delivery.attempts + 1);
        }
        assert_eq!(pauses[..11], [5, 10, 20, 40, 80, 160, 320, 640, 1280, 2560, 3600]);
        assert!((70 * 3600..=72 * 3600).contains(&pauses.iter().sum::<i64>()), "{pauses:?}");
        assert_eq!(after(&delivery, &failed, now_ms), Attempt::GivenUp);
        assert_eq!(after(&delivery, &Answer::accepted(204), now_ms), Attempt::Accepted);
    }
}
