//! Devices as JSON: their reports, their list, and the kernels that are nearest to a distance.

use super::kernel_files::{List, checked};
use super::refusal::Refusal;
use crate::api::Api;
use crate::call::Call;
use axum::extract::rejection::{JsonRejection, QueryRejection};
use axum::extract::{Path, Query, State};
use axum::{Extension, Json};
use lightpath_proto::v1;
use serde::Deserialize;
use tonic::Status;

/// Limit on the size of a report \[bytes\]: its texts have at most some kilobytes.
pub(super) const BODY_BYTES_MAX: usize = 16 << 10;

/// Where to look for kernels.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Place {
    #[serde(default, alias = "wavelengthM")]
    wavelength_m: f64,
    #[serde(alias = "distanceM")]
    distance_m: f64,
}

/// Handles `POST /v1/displays/{display}/devices/{device}/report`.
pub(super) async fn report_device(
    State(api): State<Api>,
    Extension(call): Extension<Call>,
    Path((display, device)): Path<(String, String)>,
    report: Result<Json<v1::ReportDeviceRequest>, JsonRejection>,
) -> Result<Json<v1::ReportDeviceResponse>, Refusal> {
    let Json(report) = report.map_err(|rejection| Status::invalid_argument(rejection.body_text()))?;
    let request = v1::ReportDeviceRequest { name: format!("displays/{display}/devices/{device}"), ..report };
    Ok(Json(api.report_device(&call, request).await?))
}

/// Handles `GET /v1/displays/{display}/devices`.
pub(super) async fn list_devices(
    State(api): State<Api>,
    Extension(call): Extension<Call>,
    Path(display): Path<String>,
    query: Result<Query<List>, QueryRejection>,
) -> Result<Json<v1::ListDevicesResponse>, Refusal> {
    let Query(List { page_size, page_token }) = checked(query)?;
    let request = v1::ListDevicesRequest { display: format!("displays/{display}"), page_size, page_token };
    Ok(Json(api.list_devices(&call, request).await?))
}

/// Handles `GET /v1/displays/{display}/nearest-kernels`.
pub(super) async fn find_nearest_kernels(
    State(api): State<Api>,
    Extension(call): Extension<Call>,
    Path(display): Path<String>,
    query: Result<Query<Place>, QueryRejection>,
) -> Result<Json<v1::FindNearestKernelsResponse>, Refusal> {
    let Query(Place { wavelength_m, distance_m }) = checked(query)?;
    let request = v1::FindNearestKernelsRequest { display: format!("displays/{display}"), wavelength_m, distance_m };
    Ok(Json(api.find_nearest_kernels(&call, request).await?))
}
