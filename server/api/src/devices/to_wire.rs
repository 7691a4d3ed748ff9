//! Conversion of devices into messages.

use crate::time::timestamp;
use lightpath_domain::device::{Device, InstalledKernel};
use lightpath_proto::v1;

/// Converts a device into its message.
pub(super) fn device(device: Device) -> v1::Device {
    v1::Device {
        name: format!("displays/{}/devices/{}", device.display, device.id),
        group: device.group,
        agent: device.agent,
        report_time: device.report_time_ms.map(timestamp),
        kernels: device.kernels.into_iter().map(installed).collect(),
    }
}

fn installed(installed: InstalledKernel) -> v1::InstalledKernel {
    let (version, form, digest) = installed
        .file
        .map_or_else(Default::default, |file| (Some(file.version), file.form.as_str().to_owned(), file.digest));
    v1::InstalledKernel {
        kernel: installed.kernel.to_string(),
        version,
        format: form,
        digest,
        generation: installed.generation,
        tried_version: installed.tried_version,
        message: installed.message,
        self_test_loss: installed.self_test_loss,
        report_time: Some(timestamp(installed.report_time_ms)),
    }
}
