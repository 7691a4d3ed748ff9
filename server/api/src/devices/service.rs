//! The device service.

use super::to_wire;
use crate::api::Api;
use crate::call::answers;
use crate::names;
use crate::pages::Page;
use lightpath_domain::device::{Device, InstalledFile, InstalledKernel, Report};
use lightpath_proto::v1;
use lightpath_proto::v1::device_service_server::DeviceService;
use lightpath_service::{Call, Field, Result, permissions};

/// Limit on the length of a device's message \[bytes\].
const MESSAGE_BYTES_MAX: usize = 1024;
/// Limit on the length of the name of a device's program \[bytes\].
const AGENT_BYTES_MAX: usize = 128;

answers! {
    DeviceService {
        report_device(v1::ReportDeviceRequest) -> v1::ReportDeviceResponse;
        list_devices(v1::ListDevicesRequest) -> v1::ListDevicesResponse;
        set_device_group(v1::SetDeviceGroupRequest) -> v1::Device;
        delete_device(v1::DeleteDeviceRequest) -> v1::DeleteDeviceResponse;
    }
}

impl Api {
    pub(crate) async fn report_device(
        &self,
        call: &Call,
        request: v1::ReportDeviceRequest,
    ) -> Result<v1::ReportDeviceResponse> {
        let (display, device) = names::device(call, &Field::new("name"), &request.name)?;
        permissions::device_of(call, &device)?;
        call.concerns(&request.name);
        let kernel = format!("displays/{display}/kernels/{}", request.kernel);
        let key = names::kernel_key(call, &Field::new("kernel"), &kernel)?;
        let version = Field::new("version").version_if_set(request.version, "no version in use")?;
        let tried_version = Field::new("tried_version").version_if_set(request.tried_version, "no version")?;
        let devices = &self.service.devices;
        let generation = devices.signed_generation(&Field::new("generation"), &key, request.generation).await?;
        let file = installed_file(version, &request.format, &request.digest)?;
        if let Some(file) = &file {
            devices.require_file(call, &key, file).await?;
        }
        let loss = request.self_test_loss;
        let report = Report {
            device,
            agent: Field::new("agent").line(request.agent, AGENT_BYTES_MAX)?,
            installed: InstalledKernel {
                kernel: key,
                file,
                generation,
                tried_version,
                message: Field::new("message").line(request.message, MESSAGE_BYTES_MAX)?,
                self_test_loss: loss
                    .map(|loss| Field::new("self_test_loss").number(loss, 0.0..=f64::MAX))
                    .transpose()?,
                report_time_ms: self.store.now_ms(),
            },
        };
        devices.report(report).await?;
        Ok(v1::ReportDeviceResponse {})
    }

    pub(crate) async fn list_devices(
        &self,
        call: &Call,
        request: v1::ListDevicesRequest,
    ) -> Result<v1::ListDevicesResponse> {
        let display = self.display_named(call, &Field::new("display"), &request.display).await?;
        let page = Page::new(&["devices", &request.display], request.page_size, &request.page_token)?;
        let devices = self.store.devices(&display.id, page.after.as_deref(), page.limit()).await?;
        let (devices, next_page_token) = page.fill(devices, |device: &Device| device.id.clone(), to_wire::device);
        Ok(v1::ListDevicesResponse { devices, next_page_token })
    }

    async fn set_device_group(&self, call: &Call, request: v1::SetDeviceGroupRequest) -> Result<v1::Device> {
        let (display, device) = names::device(call, &Field::new("name"), &request.name)?;
        call.concerns(&request.name);
        let group = match request.group.as_str() {
            "" => "",
            group => names::label(&Field::new("group"), group)?,
        };
        Ok(to_wire::device(self.service.devices.set_group(&display, &device, group).await?))
    }

    async fn delete_device(&self, call: &Call, request: v1::DeleteDeviceRequest) -> Result<v1::DeleteDeviceResponse> {
        let (display, device) = names::device(call, &Field::new("name"), &request.name)?;
        call.concerns(&request.name);
        self.service.devices.delete(&display, &device).await?;
        Ok(v1::DeleteDeviceResponse {})
    }
}

/// The file that a device uses; `None` without a version.
fn installed_file(version: Option<u32>, form: &str, digest: &str) -> Result<Option<InstalledFile>> {
    let Some(version) = version else { return Ok(None) };
    let form = Field::new("format").kernel_format(form)?;
    Ok(Some(InstalledFile { version, form, digest: Field::new("digest").digest(digest)? }))
}
