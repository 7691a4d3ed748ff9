//! The model of a kernel version.

use super::{JobContext, TaskError};
use lightpath_domain::kernel::KernelVersion;
use lightpath_media::kernel_file;
use lightpath_optics::DisplayModel;

/// Reads the display model of a kernel version, as the display's camera sees it. The camera is no part of a kernel.
pub(super) fn model_of(context: &JobContext, version: &KernelVersion) -> Result<DisplayModel, TaskError> {
    let (display, _) = context.wait(context.store().display(&version.key.display))?;
    let (mut model, _) = kernel_file::decode(&context.read_artifact(&version.content.artifact)?)?;
    model.setup = model.setup.with_camera_fill_factor(display.camera_fill_factor)?;
    Ok(model)
}
