//! Methods of the job service for the queue as a whole.

use super::to_wire;
use crate::api::Api;
use crate::names;
use lightpath_proto::v1;
use lightpath_service::permissions::require_all_displays;
use lightpath_service::{Call, Field, Result};

/// Limit on the length of the reason of a pause \[bytes\]: a few sentences.
const REASON_BYTES_MAX: usize = 1000;

impl Api {
    pub(crate) async fn get_queue(&self, call: &Call, _: v1::GetQueueRequest) -> Result<v1::Queue> {
        require_all_displays(call, "display in ListJobs")?;
        self.store.read_living().await?;
        Ok(to_wire::queue(self.service.jobs.queue(call).await?))
    }

    pub(crate) async fn pause_queue(&self, call: &Call, request: v1::PauseQueueRequest) -> Result<v1::Queue> {
        let display = names::display_filter(call, &Field::new("display"), &request.display)?;
        let reason = Field::new("reason").line(request.reason, REASON_BYTES_MAX)?;
        note(call, display.as_deref());
        Ok(to_wire::queue(self.service.jobs.pause(call, display.as_deref(), &reason).await?))
    }

    pub(crate) async fn resume_queue(&self, call: &Call, request: v1::ResumeQueueRequest) -> Result<v1::Queue> {
        let display = names::display_filter(call, &Field::new("display"), &request.display)?;
        note(call, display.as_deref());
        Ok(to_wire::queue(self.service.jobs.resume(call, display.as_deref()).await?))
    }
}

/// Notes what a pause concerns, for the audit log.
fn note(call: &Call, display: Option<&str>) {
    call.concerns(display.map_or_else(|| "queue".to_owned(), |display| format!("displays/{display}")));
}
