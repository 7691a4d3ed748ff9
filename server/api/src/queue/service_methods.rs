//! Methods of the job service for the queue as a whole.

use super::to_wire;
use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use crate::permissions::require_all_displays;
use lightpath_proto::v1;
use lightpath_store::Pause;

/// Limit on the length of the reason of a pause \[bytes\]: a few sentences.
const REASON_BYTES_MAX: usize = 1000;

impl Api {
    pub(crate) async fn get_queue(&self, call: &Call, _: v1::GetQueueRequest) -> Result<v1::Queue, ApiError> {
        require_all_displays(call, "display in ListJobs")?;
        self.store.read_living().await?;
        self.queue(call).await
    }

    pub(crate) async fn pause_queue(&self, call: &Call, request: v1::PauseQueueRequest) -> Result<v1::Queue, ApiError> {
        let display = names::display_filter(call, &Field::new("display"), &request.display)?;
        let reason = Field::new("reason").text(request.reason, REASON_BYTES_MAX)?;
        note(call, display.as_deref());
        self.store.pause(display.as_deref(), &reason, self.store.now_ms()).await?;
        self.queue(call).await
    }

    pub(crate) async fn resume_queue(
        &self,
        call: &Call,
        request: v1::ResumeQueueRequest,
    ) -> Result<v1::Queue, ApiError> {
        let display = names::display_filter(call, &Field::new("display"), &request.display)?;
        note(call, display.as_deref());
        self.store.resume(display.as_deref()).await?;
        self.queue(call).await
    }

    /// The queue and its processes as the caller may see it. A caller whose token is for some displays sees the pauses of
    /// these displays, but not the turns of owners, whose jobs may be about any display.
    async fn queue(&self, call: &Call) -> Result<v1::Queue, ApiError> {
        let pauses = self.store.pauses().await?;
        if call.caller.displays.is_empty() {
            return Ok(to_wire::queue(self.store.owner_queues().await?, pauses, &self.store.living()));
        }
        let is_own = |pause: &Pause| pause.display.as_ref().is_none_or(|display| call.caller.may_use(display));
        Ok(to_wire::queue(Vec::new(), pauses.into_iter().filter(is_own).collect(), &self.store.living()))
    }
}

/// Notes what a pause concerns, for the audit log.
fn note(call: &Call, display: Option<&str>) {
    call.concerns(display.map_or_else(|| "queue".to_owned(), |display| format!("displays/{display}")));
}
