//! Ids of jobs as users give them: whole, or only their beginning.

use super::failure::Failure;
use super::session::Session;
use super::show;
use lightpath::v1::list_jobs_request::View;
use lightpath::v1::{self, JobSummary};
use lightpath::{Code, Words as _, names};

/// Length of a whole id.
const ID_LENGTH: usize = 36;
/// Jobs that are listed if several ids begin with the given text.
const CANDIDATES_MAX: u32 = 8;

/// The name of the job whose id is `given` or begins with it.
pub(crate) async fn job_name(session: &Session, given: &str) -> Result<String, Failure> {
    let begin = names::id(given).to_ascii_lowercase();
    let is_begin = begin.len() < ID_LENGTH && begin.chars().all(|c| c.is_ascii_hexdigit() || c == '-');
    if begin.is_empty() || !is_begin {
        return Ok(names::job(given));
    }
    let request = v1::ListJobsRequest {
        id_prefix: begin.clone(),
        page_size: CANDIDATES_MAX,
        view: View::Basic.into(),
        ..Default::default()
    };
    let found = match session.client.list_jobs(request).await {
        Ok(found) => found,
        // A token for named displays may list only their jobs.
        Err(error) if error.code() == Some(Code::PermissionDenied) => {
            return among_displays(session, given).await;
        }
        Err(error) => return Err(error.into()),
    };
    choose(&begin, &found.summaries, !found.next_page_token.is_empty())
}

/// The names of several jobs.
pub(crate) async fn job_names(session: &Session, given: &[String]) -> Result<Vec<String>, Failure> {
    let mut found = Vec::with_capacity(given.len());
    for id in given {
        found.push(job_name(session, id).await?);
    }
    Ok(found)
}

/// The same for a token that is valid only for some displays.
async fn among_displays(session: &Session, given: &str) -> Result<String, Failure> {
    let begin = names::id(given).to_ascii_lowercase();
    let (mut candidates, mut more) = (Vec::new(), false);
    for display in session.client.get_server(v1::GetServerRequest {}).await?.displays {
        let request = v1::ListJobsRequest {
            id_prefix: begin.clone(),
            display,
            page_size: CANDIDATES_MAX,
            view: View::Basic.into(),
            ..Default::default()
        };
        let found = session.client.list_jobs(request).await?;
        more |= !found.next_page_token.is_empty();
        candidates.extend(found.summaries);
    }
    choose(&begin, &candidates, more)
}

/// The name of the only candidate. Without candidates the name of a job that does not exist, which the server refuses.
fn choose(begin: &str, candidates: &[JobSummary], more: bool) -> Result<String, Failure> {
    // A server that does not know the filter returns other jobs.
    let candidates: Vec<&JobSummary> =
        candidates.iter().filter(|job| names::id(&job.name).starts_with(begin)).collect();
    match candidates.as_slice() {
        [] => Ok(names::job(begin)),
        [job] => Ok(job.name.clone()),
        several => {
            let line = |job: &&JobSummary| {
                let age = job.create_time.as_ref().map(show::age).unwrap_or_default();
                let label = if job.label.is_empty() { String::new() } else { format!(" {}", show::plain(&job.label)) };
                let (id, kind, state) = (names::id(&job.name), job.kind().word().replace('-', " "), job.state().word());
                format!("\n  {id}  {kind}{label}, {state}, {age}")
            };
            let lines: String = several.iter().map(line).collect();
            let more = if more { "\n  and more" } else { "" };
            Err(Failure::Usage(format!(
                "the ids of several jobs begin with {begin}; give more of the id:{lines}{more}"
            )))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_only_candidate_is_chosen_and_several_are_listed() {
        let job = |id: &str, label: &str| JobSummary {
            name: format!("jobs/{id}"),
            label: label.to_owned(),
            state: v1::job::State::Queued.into(),
            kind: v1::job::Kind::OptimizeHologram.into(),
            ..Default::default()
        };
        let jobs = [job("01939a5e-7c1b", "eye.png"), job("01939a5e-7c2c", "sky\u{1b}.png"), job("02", "")];
        assert_eq!(choose("01939a5e-7c1", &jobs, false).unwrap(), "jobs/01939a5e-7c1b");
        assert_eq!(choose("03", &jobs, false).unwrap(), "jobs/03");
        let Err(Failure::Usage(text)) = choose("0193", &jobs, true) else { panic!("chosen") };
        assert!(text.contains("begin with 0193; give more of the id"), "{text}");
        assert!(text.contains("\n  01939a5e-7c1b  optimize hologram eye.png, queued"), "{text}");
        assert!(text.contains("sky\u{fffd}.png") && text.ends_with("and more") && !text.contains("\n  02"), "{text}");
    }
}
