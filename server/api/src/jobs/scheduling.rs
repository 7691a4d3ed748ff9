//! Checks of the scheduling of a job: owner, batch, unique key, times, dependencies, label and needs.

use crate::time::{ms, now_ms};
use lightpath_domain::ability::{Labels, NEEDS_MAX};
use lightpath_domain::job::Scheduling;
use lightpath_proto::v1;
use lightpath_service::permissions::owner_of_job;
use lightpath_service::{Call, Field, Result, check_all, collect_all};

/// Limit on the length of an owner, batch or unique key \[bytes\]: the same as for request ids.
const LABEL_BYTES_MAX: usize = 128;
/// Limit on the time until the start of a job \[ms\]: longer times are mistakes in the unit.
const DELAY_MS_MAX: i64 = 366 * 24 * 3600 * 1000;
const TIMEOUT_S_MAX: f64 = 30.0 * 24.0 * 3600.0;
/// Shortest time limit of an attempt \[s\]: shorter ones end before the attempt begins.
const TIMEOUT_S_MIN: f64 = 0.001;
/// Limit on the jobs for which one job waits: the holograms of a long sequence. Each costs a read and a write.
const AFTER_MAX: usize = 256;

/// Checks the scheduling in a submission and converts it.
pub(crate) fn scheduling(call: &Call, request: &v1::SubmitJobRequest) -> Result<Scheduling> {
    let owner = label(&Field::new("owner"), request.owner.clone());
    check_all! {
        owner = owner.and_then(|owner| owner_of_job(call, owner.unwrap_or_default()));
        batch = label(&Field::new("batch"), request.batch.clone());
        unique_key = label(&Field::new("unique_key"), request.unique_key.clone());
        not_before_ms = request.not_before.as_ref().map(not_before_ms).transpose();
        timeout_ms = timeout_ms(request.timeout_s);
        after = after(&request.after);
        label = label(&Field::new("label"), request.label.clone());
        needs = needs(&request.needs);
    }
    Ok(Scheduling { owner, batch, unique_key, not_before_ms, timeout_ms, after, label, needs })
}

fn not_before_ms(time: &lightpath_proto::Timestamp) -> Result<i64> {
    ms(time).filter(|ms| *ms <= now_ms() + DELAY_MS_MAX).ok_or_else(|| {
        Field::new("not_before").but("is not a valid time, or more than a year ahead", "must be within a year")
    })
}

fn timeout_ms(seconds: Option<f64>) -> Result<Option<i64>> {
    let field = Field::new("timeout_s");
    let check = |seconds| field.number(seconds, TIMEOUT_S_MIN..=TIMEOUT_S_MAX);
    let seconds = field.if_set(seconds, "the server's limit", check)?;
    Ok(seconds.map(|seconds| (seconds * 1e3).round() as i64))
}

/// The ids of the jobs to wait for, ascending, each once.
fn after(names: &[String]) -> Result<Vec<String>> {
    let field = Field::new("after");
    if names.len() > AFTER_MAX {
        return Err(field.but(format!("has {} entries", names.len()), format!("at most {AFTER_MAX} are accepted")));
    }
    let mut ids = collect_all(names.iter().enumerate().map(|(i, name)| crate::names::job_id(&field.index(i), name)))?;
    ids.sort();
    ids.dedup();
    Ok(ids)
}

fn needs(given: &[String]) -> Result<Labels> {
    Labels::new(given, NEEDS_MAX)
        .map_err(|error| Field::new("needs").invalid(error, "write labels such as `gpu` or `room-3`"))
}

/// Checks a short text that the client chose; `None` if it is empty.
pub(crate) fn label(field: &Field, given: String) -> Result<Option<String>> {
    let text = field.line(given, LABEL_BYTES_MAX)?;
    Ok((!text.is_empty()).then_some(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scheduling_is_converted_and_invalid_fields_are_refused() {
        let after = vec!["jobs/b".to_owned(), "jobs/a".to_owned(), "jobs/b".to_owned()];
        let needs = ["gpu", "bench-2", "gpu"].map(str::to_owned).to_vec();
        let request =
            v1::SubmitJobRequest { timeout_s: Some(1.5), owner: "ada".into(), after, needs, ..Default::default() };
        let converted = scheduling(&Call::without_token(), &request).unwrap();
        assert_eq!((converted.timeout_ms, converted.owner.as_str(), converted.batch), (Some(1500), "ada", None));
        assert_eq!(converted.after, ["a", "b"]);
        assert_eq!(converted.needs.to_string(), "bench-2, gpu");
        for (request, start) in [
            (v1::SubmitJobRequest { timeout_s: Some(f64::NAN), ..Default::default() }, "timeout_s is NaN"),
            (v1::SubmitJobRequest { timeout_s: Some(-1.0), ..Default::default() }, "timeout_s is -1"),
            (
                v1::SubmitJobRequest { timeout_s: Some(0.0), ..Default::default() },
                "timeout_s is 0, but must be 0.001 to 2592000; leave it out for the server's limit",
            ),
            (v1::SubmitJobRequest { owner: "a\nb".into(), ..Default::default() }, "owner has the control character"),
            (v1::SubmitJobRequest { batch: "x".repeat(129), ..Default::default() }, "batch has 129 bytes"),
            (
                v1::SubmitJobRequest { needs: vec!["GPU".into()], ..Default::default() },
                "needs has \"GPU\", which is no label",
            ),
            (v1::SubmitJobRequest { after: vec!["b".into()], ..Default::default() }, "after[0] is \"b\""),
            (
                v1::SubmitJobRequest {
                    not_before: Some(lightpath_proto::Timestamp { seconds: i64::MAX, nanos: 0 }),
                    ..Default::default()
                },
                "not_before is not a valid time",
            ),
        ] {
            let refusal = scheduling(&Call::without_token(), &request).unwrap_err().to_string();
            assert!(refusal.starts_with(start), "{refusal}");
        }
    }
}
