//! Files of datasets and results over HTTP: downloads, and uploads that continue after a cut.

use super::checked_body::status_of;
use super::etags::IMMUTABLE;
use super::file_answer::ServedFile;
use super::refusal::{Refusal, wrong_content_type};
use crate::accounts::StreamKind;
use crate::api::Api;
use crate::artifacts::to_wire;
use axum::body::{Body, Bytes};
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::Response;
use axum::{Extension, Json};
use futures::{Stream, StreamExt as _};
use lightpath_proto::v1;
use lightpath_service::{Call, Field, Result, ServiceError, shortened};
use std::pin::pin;
use tonic::Status;

/// Content type of bytes of which nothing is known.
const OCTETS: &str = "application/octet-stream";

/// Handles `GET /v1/artifacts/{digest}/content`.
pub(super) async fn get_content(
    State(api): State<Api>,
    Extension(call): Extension<Call>,
    Path(digest): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    let field = Field::new("digest");
    let digest = field.digest(&digest)?;
    let record = api.service.files.existing(&call, &field, &digest).await?;
    let open = api.streams.open(StreamKind::Download, &call.client)?;
    // The server does not know the type of an artifact, and must not let a browser run one.
    let etag = format!("\"{digest}\"");
    let file = ServedFile { etag, size_bytes: record.size_bytes, content_type: OCTETS, cache: IMMUTABLE };
    file.answer(&headers, open, async |range| api.service.files.reader(&call, &digest, range).await).await
}

/// Handles `PUT /v1/artifacts/{digest}/upload`.
pub(super) async fn upload(
    State(api): State<Api>,
    Extension(call): Extension<Call>,
    Path(digest): Path<String>,
    headers: HeaderMap,
    body: Body,
) -> Result<Json<v1::Artifact>, Refusal> {
    let (offset_bytes, size_bytes) = extent(&headers)?;
    let _open = api.streams.open(StreamKind::Upload, &call.client)?;
    let record = api.service.files.receive(&call, &digest, (size_bytes, offset_bytes), pin!(chunks(body))).await?;
    Ok(Json(to_wire::artifact(record)))
}

/// Handles `POST /v1/artifacts`: an upload whose digest the answer tells.
pub(super) async fn upload_unnamed(
    State(api): State<Api>,
    Extension(call): Extension<Call>,
    headers: HeaderMap,
    body: Body,
) -> Result<Json<v1::Artifact>, Refusal> {
    let content_type = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or("");
    // A web page of another site can send some types without asking, but not this one.
    if !content_type.eq_ignore_ascii_case(OCTETS) {
        return Err(wrong_content_type(content_type, &format!("must be {OCTETS}")));
    }
    let range = Field::new("the header content-range");
    if headers.contains_key(header::CONTENT_RANGE) {
        let problem = "is given, but a part of an artifact needs its digest";
        return Err(range.invalid(problem, "use PUT /v1/artifacts/{digest}/upload").into());
    }
    let (_, size_bytes) = extent(&headers)?;
    let _open = api.streams.open(StreamKind::Upload, &call.client)?;
    let record = api.service.files.receive_unnamed(&call, size_bytes, pin!(chunks(body))).await?;
    Ok(Json(to_wire::artifact(record)))
}

/// The chunks of the body of an upload.
fn chunks(body: Body) -> impl Stream<Item = Result<Bytes>> {
    body.into_data_stream().map(|chunk| {
        chunk.map_err(|error| {
            let cut = || Status::cancelled(format!("the body of the upload broke off: {error}"));
            ServiceError::Stream(Box::new(status_of(&error).unwrap_or_else(cut)))
        })
    })
}

/// Where the body of an upload begins in the artifact, and the size of the artifact \[bytes\]: from `content-range`
/// (`bytes 1000-1999/2000`), or from `content-length` if the body is the whole artifact.
fn extent(headers: &HeaderMap) -> Result<(u64, u64), Refusal> {
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    let Some(range) = text(header::CONTENT_RANGE) else {
        let length = text(header::CONTENT_LENGTH).and_then(|length| length.parse().ok());
        return length.map(|size_bytes| (0, size_bytes)).ok_or_else(|| {
            let error = Field::new("the header content-length").but("is missing", "must be the size of the artifact");
            Refusal::from(error).with_status(StatusCode::LENGTH_REQUIRED)
        });
    };
    let parsed = || {
        let (range, size) = range.strip_prefix("bytes ")?.split_once('/')?;
        let (first, last) = range.split_once('-')?;
        let (first, last, size): (u64, u64, u64) = (first.parse().ok()?, last.parse().ok()?, size.parse().ok()?);
        (first <= last && last.checked_add(1) == Some(size)).then_some((first, size))
    };
    parsed().ok_or_else(|| {
        let rule = "must reach to the end of the artifact, such as \"bytes 1000-1999/2000\"";
        Field::new("the header content-range").but(format!("is {:?}", shortened(range)), rule).into()
    })
}
