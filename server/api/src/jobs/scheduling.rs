//! When and for whom a submitted job runs.

use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use crate::permissions::owner_of_job;
use crate::time::{ms, now_ms};
use lightpath_domain::access::Caller;
use lightpath_domain::job::Scheduling;
use lightpath_proto::v1;

/// Longest owner, batch or unique key \[bytes\]: as request ids.
const LABEL_BYTES_MAX: usize = 128;
/// Longest wait for the start of a job \[ms\]: longer ones are mistakes in the unit.
const DELAY_MS_MAX: i64 = 366 * 24 * 3600 * 1000;
const TIMEOUT_S_MAX: f64 = 30.0 * 24.0 * 3600.0;
/// Shortest time limit: shorter ones end before any attempt begins.
const TIMEOUT_S_MIN: f64 = 0.001;
/// Most jobs that one job may wait for.
const AFTER_MAX: usize = 1000;

/// What a request says about it, checked.
pub(crate) fn scheduling(caller: &Caller, request: &v1::SubmitJobRequest) -> Result<Scheduling, ApiError> {
    let not_before = Field::new("not_before");
    let not_before_ms =
        match &request.not_before {
            None => None,
            Some(time) => Some(ms(time).filter(|ms| *ms <= now_ms() + DELAY_MS_MAX).ok_or_else(|| {
                not_before.invalid("is no time, or more than a year ahead, but must be within a year")
            })?),
        };
    let timeout_ms = match request.timeout_s {
        0.0 => None,
        seconds => Some((Field::new("timeout_s").number(seconds, TIMEOUT_S_MIN..=TIMEOUT_S_MAX)? * 1e3).round() as i64),
    };
    let field = Field::new("after");
    if request.after.len() > AFTER_MAX {
        return Err(field.invalid(format!("names {} jobs, but at most {AFTER_MAX} are accepted", request.after.len())));
    }
    let after = request.after.iter().enumerate().map(|(i, name)| names::job_id(&field.index(i), name));
    let mut after = after.collect::<Result<Vec<_>, _>>()?;
    after.sort();
    after.dedup();
    Ok(Scheduling {
        owner: owner_of_job(caller, label(&Field::new("owner"), request.owner.clone())?.unwrap_or_default())?,
        batch: label(&Field::new("batch"), request.batch.clone())?,
        unique_key: label(&Field::new("unique_key"), request.unique_key.clone())?,
        not_before_ms,
        timeout_ms,
        after,
    })
}

/// A short text of the client's own; `None` where it is empty.
pub(crate) fn label(field: &Field, given: String) -> Result<Option<String>, ApiError> {
    if given.chars().any(char::is_control) {
        return Err(field.invalid("holds control characters, but must be plain text"));
    }
    let text = field.text(given, LABEL_BYTES_MAX)?;
    Ok((!text.is_empty()).then_some(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn schedules_are_read_and_nonsense_is_named() {
        let after = vec!["jobs/b".to_owned(), "jobs/a".to_owned(), "jobs/b".to_owned()];
        let request = v1::SubmitJobRequest { timeout_s: 1.5, owner: "ada".into(), after, ..Default::default() };
        let read = scheduling(&Caller::anybody(), &request).unwrap();
        assert_eq!((read.timeout_ms, read.owner.as_str(), read.batch), (Some(1500), "ada", None));
        assert_eq!(read.after, ["a", "b"]);
        for (request, sign) in [
            (v1::SubmitJobRequest { timeout_s: f64::NAN, ..Default::default() }, "timeout_s is NaN"),
            (v1::SubmitJobRequest { timeout_s: -1.0, ..Default::default() }, "timeout_s is -1"),
            (v1::SubmitJobRequest { owner: "a\nb".into(), ..Default::default() }, "owner holds control"),
            (v1::SubmitJobRequest { batch: "x".repeat(129), ..Default::default() }, "batch has 129 bytes"),
            (v1::SubmitJobRequest { after: vec!["b".into()], ..Default::default() }, "after[0] is \"b\""),
            (
                v1::SubmitJobRequest {
                    not_before: Some(pbjson_types::Timestamp { seconds: i64::MAX, nanos: 0 }),
                    ..Default::default()
                },
                "not_before is no time",
            ),
        ] {
            let refusal = scheduling(&Caller::anybody(), &request).unwrap_err().to_string();
            assert!(refusal.starts_with(sign), "{refusal}");
        }
    }
}
