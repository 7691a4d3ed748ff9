//! Small pictures of what running jobs have reached.

use super::etags::{etag, has, text_value};
use super::refusal::Refusal;
use crate::api::Api;
use crate::names;
use axum::Extension;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
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
    let cache = (header::CACHE_CONTROL, HeaderValue::from_static("private, no-cache"));
    let Some(png) = api.live_pictures.latest(&id) else {
        return Ok((StatusCode::NO_CONTENT, [cache]).into_response());
    };
    let etag = etag(&png);
    let fields = [cache, (header::ETAG, text_value(&etag))];
    if has(&headers, &etag) {
        return Ok((StatusCode::NOT_MODIFIED, fields).into_response());
    }
    Ok((fields, [(header::CONTENT_TYPE, "image/png")], png.to_vec()).into_response())
}
