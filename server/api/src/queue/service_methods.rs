//! Methods of the job service for the queue as a whole.

use super::to_wire;
use crate::api::Api;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use crate::permissions::require_all_displays;
use crate::time::now_ms;
use lightpath_domain::access::Caller;
use lightpath_proto::v1;

/// Limit on the length of the reason of a pause \[bytes\]: a few sentences.
const REASON_BYTES_MAX: usize = 1000;

impl Api {
    pub(crate) async fn get_queue(&self, caller: &Caller, _: v1::GetQueueRequest) -> Result<v1::Queue, ApiError> {
        require_all_displays(caller, "display in ListJobs")?;
        self.queue().await
    }

    pub(crate) async fn pause_queue(
        &self,
        caller: &Caller,
        request: v1::PauseQueueRequest,
    ) -> Result<v1::Queue, ApiError> {
        let display = names::display_filter(caller, &Field::new("display"), &request.display)?;
        let reason = Field::new("reason").text(request.reason, REASON_BYTES_MAX)?;
        self.store.pause(display.as_deref(), &reason, now_ms()).await?;
        self.queue().await
    }

    pub(crate) async fn resume_queue(
        &self,
        caller: &Caller,
        request: v1::ResumeQueueRequest,
    ) -> Result<v1::Queue, ApiError> {
        let display = names::display_filter(caller, &Field::new("display"), &request.display)?;
        self.store.resume(display.as_deref()).await?;
        self.queue().await
    }

    async fn queue(&self) -> Result<v1::Queue, ApiError> {
        Ok(to_wire::queue(self.store.owner_queues().await?, self.store.pauses().await?))
    }
}
