//! Small pictures of what running jobs have reached.

use super::etags::{ASKED_AGAIN, etag, unless_known};
use super::refusal::Refusal;
use crate::api::Api;
use crate::names;
use axum::Extension;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use lightpath_service::{Call, Field};

/// Handles `GET /v1/jobs/{job}/picture`: the latest picture, or 204 while the job shows none.
pub(super) async fn get_live_picture(
    State(api): State<Api>,
    Extension(call): Extension<Call>,
    Path(job): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    let id = names::job_id(&Field::new("name"), &format!("jobs/{job}"))?;
    api.service.jobs.visible(&call, &id).await?;
    let Some(png) = api.live_pictures.latest(&id) else {
        return Ok((StatusCode::NO_CONTENT, [(header::CACHE_CONTROL, ASKED_AGAIN)]).into_response());
    };
    let content = ([(header::CONTENT_TYPE, "image/png")], png.to_vec());
    Ok(unless_known(&headers, &etag(&png), ASKED_AGAIN, content))
}
