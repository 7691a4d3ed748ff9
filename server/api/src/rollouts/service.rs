//! The rollout service.

use super::to_wire;
use crate::api::Api;
use crate::call::answers;
use crate::kernels::REASON_BYTES_MAX;
use crate::names;
use crate::once::mark;
use crate::pages::Page;
use lightpath_domain::rollout::{Rollout, RolloutEvent, RolloutPlan};
use lightpath_proto::v1;
use lightpath_proto::v1::rollout_service_server::RolloutService;
use lightpath_service::{Call, Field, Passage, Result};

/// Default of the limit on the share of failed devices.
const FAILED_SHARE_MAX: f64 = 0.1;
/// Default of the least number of devices of which the share of failures is computed.
const DEVICES_MIN: u32 = 10;

answers! {
    RolloutService {
        start_rollout(v1::StartRolloutRequest) -> v1::Rollout;
        widen_rollout(v1::WidenRolloutRequest) -> v1::Rollout;
        complete_rollout(v1::CompleteRolloutRequest) -> v1::Rollout;
        halt_rollout(v1::HaltRolloutRequest) -> v1::Rollout;
        get_rollout(v1::GetRolloutRequest) -> v1::Rollout;
        list_rollouts(v1::ListRolloutsRequest) -> v1::ListRolloutsResponse;
    }
}

impl Api {
    async fn start_rollout(&self, call: &Call, request: v1::StartRolloutRequest) -> Result<v1::Rollout> {
        let key = names::kernel_key(call, &Field::new("kernel"), &request.kernel)?;
        let version = Field::new("version").integer(request.version, 1..=u32::MAX)?;
        call.concerns(format!("{key}/versions/{version}"));
        let reason = Field::new("reason").line(request.reason.clone(), REASON_BYTES_MAX)?;
        let plan = plan(&request, version)?;
        let mark = mark(call, "StartRollout", &request, &request.request_id)?;
        let (expected_active, force) = (request.expected_active_version, request.force);
        let passage = Passage { version, expected_active, force, reason };
        let rollout = self.service.rollouts.start(call, &key, plan, passage, mark).await?;
        self.rollout_message(rollout, Vec::new()).await
    }

    async fn widen_rollout(&self, call: &Call, request: v1::WidenRolloutRequest) -> Result<v1::Rollout> {
        let (key, number) = names::rollout(call, &Field::new("name"), &request.name)?;
        call.concerns(&request.name);
        let share = Field::new("share").number(request.share, 0.0..=1.0)?;
        let widened = (share, request.expected_revision);
        let rollout = self.service.rollouts.widen(call, &key, number, widened).await?;
        self.rollout_message(rollout, Vec::new()).await
    }

    async fn complete_rollout(&self, call: &Call, request: v1::CompleteRolloutRequest) -> Result<v1::Rollout> {
        let (key, number) = names::rollout(call, &Field::new("name"), &request.name)?;
        call.concerns(&request.name);
        let rollout = self.service.rollouts.complete(call, &key, number, request.expected_revision).await?;
        self.rollout_message(rollout, Vec::new()).await
    }

    async fn halt_rollout(&self, call: &Call, request: v1::HaltRolloutRequest) -> Result<v1::Rollout> {
        let (key, number) = names::rollout(call, &Field::new("name"), &request.name)?;
        call.concerns(&request.name);
        let reason = Field::new("reason").line(request.reason, REASON_BYTES_MAX)?;
        let rollout = self.service.rollouts.halt(call, &key, number, reason).await?;
        self.rollout_message(rollout, Vec::new()).await
    }

    async fn get_rollout(&self, call: &Call, request: v1::GetRolloutRequest) -> Result<v1::Rollout> {
        let (key, number) = names::rollout(call, &Field::new("name"), &request.name)?;
        let (rollout, events) = self.store.rollout(&key, number).await?;
        self.rollout_message(rollout, events).await
    }

    async fn rollout_message(&self, rollout: Rollout, events: Vec<RolloutEvent>) -> Result<v1::Rollout> {
        let halting = self.service.rollouts.halting(&rollout).await?;
        Ok(to_wire::rollout(rollout, halting, events))
    }

    async fn list_rollouts(&self, call: &Call, request: v1::ListRolloutsRequest) -> Result<v1::ListRolloutsResponse> {
        let key = names::kernel_key(call, &Field::new("kernel"), &request.kernel)?;
        let page = Page::new(&["rollouts", &request.kernel], request.page_size, &request.page_token)?;
        let rollouts = self.store.rollouts(&key, page.after_number()?, page.limit()).await?;
        let to_wire = |rollout| to_wire::rollout(rollout, None, Vec::new());
        let (rollouts, next_page_token) = page.fill(rollouts, |rollout| rollout.number.to_string(), to_wire);
        Ok(v1::ListRolloutsResponse { rollouts, next_page_token })
    }
}

/// The checked plan of a request, without its cause.
fn plan(request: &v1::StartRolloutRequest, version: u32) -> Result<RolloutPlan> {
    let part = |name: &'static str, value| Field::new(name).number(value, 0.0..=1.0);
    let share = part("share", request.share)?;
    if request.group.is_empty() && share == 0.0 {
        let problem = "is 0 and no group is given, so no device would get the version";
        return Err(Field::new("share").invalid(problem, "give one of them"));
    }
    let group = match request.group.as_str() {
        "" => "",
        group => names::label(&Field::new("group"), group)?,
    };
    let loss = request.self_test_loss_max;
    Ok(RolloutPlan {
        version,
        share,
        group: group.to_owned(),
        failed_share_max: part("failed_share_max", request.failed_share_max.unwrap_or(FAILED_SHARE_MAX))?,
        devices_min: Field::new("devices_min").integer_or(request.devices_min, DEVICES_MIN, 1..=u32::MAX)?,
        self_test_loss_max: loss
            .map(|loss| Field::new("self_test_loss_max").number(loss, 0.0..=f64::MAX))
            .transpose()?,
        cause: Default::default(),
        overridden: Vec::new(),
    })
}
