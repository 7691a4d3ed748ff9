//! Jobs for dashboards.

use super::refusal::Refusal;
use crate::api::Api;
use axum::Json;
use axum::extract::rejection::QueryRejection;
use axum::extract::{Path, Query, State};
use lightpath_proto::v1;
use serde::Deserialize;
use tonic::Status;

/// The fields of `ListJobsRequest`, in protobuf's JSON names or its own.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct List {
    #[serde(default, alias = "pageSize")]
    page_size: u32,
    #[serde(default, alias = "pageToken")]
    page_token: String,
    /// `STATE_RUNNING` or `running`.
    #[serde(default)]
    state: String,
    #[serde(default)]
    display: String,
    #[serde(default)]
    batch: String,
}

/// `GET /v1/jobs`
pub(super) async fn list(
    State(api): State<Api>,
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
    Ok(Json(api.jobs(request).await?))
}

/// `GET /v1/jobs/{id}`
pub(super) async fn one(State(api): State<Api>, Path(id): Path<String>) -> Result<Json<v1::Job>, Refusal> {
    Ok(Json(api.job(&format!("jobs/{id}")).await?))
}

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
