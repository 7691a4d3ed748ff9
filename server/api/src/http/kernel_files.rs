//! Kernels over HTTP, for firmware: signed manifests, and files in pieces.
//!
//! A device asks for the manifest with the ETag that it has (`If-None-Match`), and gets 304 until something changes.
//! Then it fetches the file, whose path has everything that the manifest says about it. The bytes of such a path never
//! change, so a cut download continues with `Range`, on any server that holds the kernel.

use super::etags::{ASKED_AGAIN, IMMUTABLE, etag, has, unless_known};
use super::file_answer::ServedFile;
use super::refusal::{Refusal, checked};
use crate::accounts::StreamKind;
use crate::api::Api;
use crate::names;
use axum::Extension;
use axum::extract::rejection::QueryRejection;
use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use lightpath_domain::kernel::{KernelKey, KernelVersion};
use lightpath_media::kernel_formats::KernelFormat;
use lightpath_service::{Call, Field, Issued, Result, ServiceError, VersionFile, for_device, permissions};
use serde::Deserialize;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::broadcast::error::RecvError;
use tokio::time::timeout;
use tonic::Code;

/// Longest time for which a request for a manifest waits for a change \[s\]. Gateways commonly end requests after a
/// minute.
const WAIT_S_MAX: u64 = 50;
/// Header with the time after which a device should ask again \[s\].
const POLL_AFTER: &str = "lightpath-poll-after-s";
const OCTETS: &str = "application/octet-stream";
const TEXT: &str = "text/plain; charset=us-ascii";

/// Parameters of a manifest.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ManifestQuery {
    /// Format of the file, such as `compact`.
    #[serde(default)]
    format: String,
    /// Time to wait for a change \[s\].
    #[serde(default)]
    wait_s: u64,
    /// Device that asks. Tokens of the role firmware ask for the device of their own name.
    #[serde(default)]
    device: String,
}

/// Parameters of a version's file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FileQuery {
    /// Format of the file, such as `compact`.
    #[serde(default)]
    format: String,
}

/// The file of a version, as its manifest names it.
#[derive(Debug, Deserialize)]
pub(super) struct FilePath {
    display: String,
    kernel: String,
    version: u32,
    format: String,
    digest: String,
}

/// Handles `GET /v1/keyring`.
pub(super) async fn get_keyring(
    State(api): State<Api>,
    Extension(_): Extension<Call>,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    let keyring = api.service.manifests.keyring().await?;
    Ok(document(&api, &headers, keyring.document))
}

/// Handles `GET /v1/displays/{display}/kernels/{kernel}/manifest`.
pub(super) async fn get_manifest(
    State(api): State<Api>,
    Extension(call): Extension<Call>,
    Path((display, kernel)): Path<(String, String)>,
    query: Result<Query<ManifestQuery>, QueryRejection>,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    let Query(ManifestQuery { format, wait_s, device }) = checked(query)?;
    let key = names::kernel_key(&call, &Field::new("kernel"), &format!("displays/{display}/kernels/{kernel}"))?;
    let format = format_or_whole(&Field::new("format"), &format)?;
    let wait_s = Field::new("wait_s").integer(wait_s, 0..=WAIT_S_MAX)?;
    let device = permissions::device_of(&call, &device)?;
    let asked = Asked { key, format, device };
    let issued = if wait_s > 0 {
        changed_manifest(&api, &call, &asked, &headers, Duration::from_secs(wait_s)).await?
    } else {
        asked.manifest(&api, &call).await?
    };
    Ok(document(&api, &headers, issued.document.clone()))
}

/// What manifest a device asks for.
struct Asked {
    key: KernelKey,
    format: KernelFormat,
    device: Option<String>,
}

impl Asked {
    async fn manifest(&self, api: &Api, call: &Call) -> Result<Arc<Issued>> {
        api.service.manifests.manifest(call, &self.key, self.format, self.device.as_deref()).await
    }
}

/// The manifest, as soon as it is another one than the client has, or after the wait.
async fn changed_manifest(
    api: &Api,
    call: &Call,
    asked: &Asked,
    headers: &HeaderMap,
    wait: Duration,
) -> Result<Arc<Issued>> {
    let _open = api.streams.open(StreamKind::Watch, &call.client)?;
    // This subscribes before the first read, so that it misses no change.
    let mut changes = api.store().subscribe_kernel_changes();
    let first = asked.manifest(api, call).await?;
    if !has(headers, &etag(&first.document)) {
        return Ok(first);
    }
    let change = async {
        loop {
            match changes.recv().await {
                // Every move on a kernel of the display raises the generation.
                Ok(change) if change.display != asked.key.display => {}
                Ok(_) | Err(RecvError::Lagged(_)) => {
                    let issued = asked.manifest(api, call).await?;
                    if issued.document != first.document {
                        return Ok(issued);
                    }
                }
                Err(RecvError::Closed) => return Err(ServiceError::Stopping),
            }
        }
    };
    tokio::select! {
        changed = timeout(wait, change) => changed.unwrap_or(Ok(first.clone())),
        () = api.stopping.cancelled() => Err(ServiceError::Stopping),
    }
}

/// Handles `GET /v1/displays/{display}/kernels/{kernel}/versions/{version}/{format}/{digest}`.
pub(super) async fn get_file(
    State(api): State<Api>,
    Extension(call): Extension<Call>,
    Path(path): Path<FilePath>,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    let name = format!("displays/{}/kernels/{}", path.display, path.kernel);
    let key = names::kernel_key(&call, &Field::new("kernel"), &name)?;
    let format = Field::new("format").kernel_format(&path.format)?;
    let version = api.store().kernel_version(&key, path.version).await.map_err(ServiceError::from)?;
    let etag = format!("\"{}\"", path.digest);
    let open = api.streams.open(StreamKind::Download, &call.client)?;
    let whole = file_of(&api, &call, version, format, &path.digest).await?;
    let file = ServedFile { etag, size_bytes: whole.size_bytes, content_type: OCTETS, cache: IMMUTABLE };
    let kernels = &api.service.kernels;
    file.answer(&headers, open, async |range| for_device(kernels.reader(&call, &whole, range)).await).await
}

/// Handles `GET /v1/displays/{display}/kernels/{kernel}/versions/{version}/file`: the same without knowing the digest.
/// What the path names may change: another release of the server may convert a version otherwise.
pub(super) async fn get_version_file(
    State(api): State<Api>,
    Extension(call): Extension<Call>,
    Path((display, kernel, version)): Path<(String, String, String)>,
    query: Result<Query<FileQuery>, QueryRejection>,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    let Query(FileQuery { format }) = checked(query)?;
    let name = format!("displays/{display}/kernels/{kernel}/versions/{version}");
    let (key, number) = names::kernel_version(&call, &Field::new("version"), &name)?;
    let format = format_or_whole(&Field::new("format"), &format)?;
    let version = api.store().kernel_version(&key, number).await.map_err(ServiceError::from)?;
    let open = api.streams.open(StreamKind::Download, &call.client)?;
    let whole = for_device(api.service.kernels.file(&call, version, format)).await?;
    let etag = format!("\"{}\"", whole.digest);
    let file = ServedFile { etag, size_bytes: whole.size_bytes, content_type: OCTETS, cache: ASKED_AGAIN };
    let kernels = &api.service.kernels;
    file.answer(&headers, open, async |range| for_device(kernels.reader(&call, &whole, range)).await).await
}

/// The file of a version in a format. Refuses a digest of anything else.
async fn file_of(
    api: &Api,
    call: &Call,
    version: KernelVersion,
    format: KernelFormat,
    digest: &str,
) -> Result<VersionFile, Refusal> {
    let name = format!("{}/versions/{}", version.key, version.version);
    let file = for_device(api.service.kernels.file(call, version, format)).await?;
    if file.digest != digest {
        let format = format.as_str();
        let message = format!("{name} in the format {format} has the digest {}; read the manifest again", file.digest);
        let (http, fix) = (StatusCode::NOT_FOUND, "read the manifest again");
        return Err(Refusal::new(http, Code::NotFound, "OTHER_DIGEST", message, fix));
    }
    Ok(file)
}

/// A signed document, or 304 if the client has it.
fn document(api: &Api, headers: &HeaderMap, text: String) -> Response {
    let poll_after = [(POLL_AFTER, HeaderValue::from(api.service.manifests.poll_after_s()))];
    let etag = etag(&text);
    let answer = unless_known(headers, &etag, ASKED_AGAIN, ([(header::CONTENT_TYPE, TEXT)], text));
    (poll_after, answer).into_response()
}

/// The format with this name; of an empty name that with the whole model.
fn format_or_whole(field: &Field, name: &str) -> Result<KernelFormat> {
    if name.is_empty() { Ok(KernelFormat::Safetensors) } else { field.kernel_format(name) }
}
