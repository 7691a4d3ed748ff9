//! Jobs as JSON, for dashboards.

use super::refusal::Refusal;
use crate::api::Api;
use crate::call::Call;
use axum::extract::rejection::QueryRejection;
use axum::extract::{Path, Query, State};
use axum::{Extension, Json};
use lightpath_proto::v1;
use serde::Deserialize;
use tonic::Status;

/// Parameters of a list of jobs: the fields of `ListJobsRequest`, with their own names or their JSON names.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct List {
    #[serde(default, alias = "pageSize")]
    page_size: u32,
    #[serde(default, alias = "pageToken")]
    page_token: String,
    /// State of the jobs: `STATE_RUNNING` or `running`.
    #[serde(default)]
    state: String,
    #[serde(default)]
    display: String,
    #[serde(default)]
    batch: String,
}

/// Handles `GET /v1/jobs`.
pub(super) async fn list_jobs(
    State(api): State<Api>,
    Extension(call): Extension<Call>,
    query: Result<Query<List>, QueryRejection>,
) -> Result<Json<v1::ListJobsResponse>, Refusal> {
    let Query(list) = query.map_err(|rejection| Status::invalid_argument(rejection.body_text()))?;
    let request = v1::ListJobsRequest {
        page_size: list.page_size,
        page_token: list.page_token,
        state: state(&list.state)?.into(),
        display: list.display,
        batch: list.batch,
    };
    Ok(Json(api.list_jobs(&call, request).await?))
}

/// Handles `GET /v1/jobs/{id}`.
pub(super) async fn get_job(
    State(api): State<Api>,
    Extension(call): Extension<Call>,
    Path(id): Path<String>,
) -> Result<Json<v1::Job>, Refusal> {
    let request = v1::GetJobRequest { name: format!("jobs/{id}") };
    Ok(Json(api.get_job(&call, request).await?))
}

/// Parses the name of a state; an empty name stands for all states.
fn state(name: &str) -> Result<v1::job::State, Status> {
    if name.is_empty() {
        return Ok(v1::job::State::Unspecified);
    }
    let full = name.to_ascii_uppercase();
    let full = if full.starts_with("STATE_") { full } else { format!("STATE_{full}") };
    let known = "queued, running, succeeded, failed or cancelled";
    v1::job::State::from_str_name(&full)
        .ok_or_else(|| Status::invalid_argument(format!("state is {name:?}, but must be {known}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::api::tests::api_in;
    use axum::Router;
    use axum::body::Body;
    use axum::http::{Request, StatusCode};
    use axum::routing::get;
    use tonic::codegen::Service as _;

    #[tokio::test]
    async fn no_route_answers_a_call_without_a_caller() {
        let folder = tempfile::tempdir().unwrap();
        let routes = Router::new().route("/v1/jobs", get(list_jobs)).route("/v1/jobs/{id}", get(get_job));
        let mut routes = routes.with_state(api_in(folder.path()).await);
        for path in ["/v1/jobs", "/v1/jobs/0193"] {
            let answer = routes.call(Request::get(path).body(Body::empty()).unwrap()).await.unwrap();
            assert_eq!(answer.status(), StatusCode::INTERNAL_SERVER_ERROR, "{path}");
        }
    }
}
