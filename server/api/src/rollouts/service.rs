//! The rollout service.

use super::to_wire;
use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use crate::kernels::promotion::{Passage, Passed, REASON_BYTES_MAX, cause};
use crate::names;
use crate::pages::Page;
use lightpath_domain::kernel::KernelKey;
use lightpath_domain::reason::PreconditionReason;
use lightpath_domain::rollout::{RolloutPlan, RolloutState};
use lightpath_proto::v1;
use lightpath_proto::v1::rollout_service_server::RolloutService;
use lightpath_store::Widening;
use tonic::{Request, Response, Status};

/// Default of the limit on failed devices \[%\].
const FAILED_PERCENT_MAX: f64 = 10.0;
/// Default of the least number of devices of which the share of failures is computed.
const DEVICES_MIN: u32 = 10;

#[tonic::async_trait]
impl RolloutService for Api {
    async fn start_rollout(&self, request: Request<v1::StartRolloutRequest>) -> Result<Response<v1::Rollout>, Status> {
        self.answer(request, Self::start_rollout).await
    }

    async fn widen_rollout(&self, request: Request<v1::WidenRolloutRequest>) -> Result<Response<v1::Rollout>, Status> {
        self.answer(request, Self::widen_rollout).await
    }

    async fn complete_rollout(
        &self,
        request: Request<v1::CompleteRolloutRequest>,
    ) -> Result<Response<v1::Rollout>, Status> {
        self.answer(request, Self::complete_rollout).await
    }

    async fn halt_rollout(&self, request: Request<v1::HaltRolloutRequest>) -> Result<Response<v1::Rollout>, Status> {
        self.answer(request, Self::halt_rollout).await
    }

    async fn get_rollout(&self, request: Request<v1::GetRolloutRequest>) -> Result<Response<v1::Rollout>, Status> {
        self.answer(request, Self::get_rollout).await
    }

    async fn list_rollouts(
        &self,
        request: Request<v1::ListRolloutsRequest>,
    ) -> Result<Response<v1::ListRolloutsResponse>, Status> {
        self.answer(request, Self::list_rollouts).await
    }
}

impl Api {
    async fn start_rollout(&self, call: &Call, request: v1::StartRolloutRequest) -> Result<v1::Rollout, ApiError> {
        let key = names::kernel_key(call, &Field::new("kernel"), &request.kernel)?;
        let version = Field::new("version").integer(request.version, 1..=u32::MAX)?;
        call.concerns(format!("{key}/versions/{version}"));
        let reason = Field::new("reason").line(request.reason.clone(), REASON_BYTES_MAX)?;
        let mut plan = plan(&request, version)?;
        let (expected_active, force) = (request.expected_active_version, request.force);
        let passage = Passage { version, expected_active, force, reason: &reason };
        let Passed { expected_active, overridden } = self.pass_gate(call, &key, passage).await?;
        plan.overridden = overridden;
        plan.cause = cause(call, reason);
        let rollout = self.store.start_rollout(&key, plan, expected_active, self.store.now_ms()).await?;
        Ok(to_wire::rollout(rollout, Vec::new()))
    }

    async fn widen_rollout(&self, call: &Call, request: v1::WidenRolloutRequest) -> Result<v1::Rollout, ApiError> {
        let (key, number) = names::rollout(call, &Field::new("name"), &request.name)?;
        call.concerns(&request.name);
        let share_percent = Field::new("share_percent").number(request.share_percent, 0.0..=100.0)?;
        self.require_still_passes(call, &key, number).await?;
        let (expected_revision, caller) = (request.expected_revision, call.caller.name.clone());
        let widening = Widening { share_percent, expected_revision, caller };
        let rollout = self.store.widen_rollout(&key, number, widening, self.store.now_ms()).await?;
        Ok(to_wire::rollout(rollout, Vec::new()))
    }

    async fn complete_rollout(
        &self,
        call: &Call,
        request: v1::CompleteRolloutRequest,
    ) -> Result<v1::Rollout, ApiError> {
        let (key, number) = names::rollout(call, &Field::new("name"), &request.name)?;
        call.concerns(&request.name);
        self.require_still_passes(call, &key, number).await?;
        let (revision, caller) = (request.expected_revision, &call.caller.name);
        let rollout = self.store.complete_rollout(&key, number, revision, caller, self.store.now_ms()).await?;
        Ok(to_wire::rollout(rollout, Vec::new()))
    }

    /// Refuses to go on with a version that fails the gate now, other than by what was overridden at the start.
    async fn require_still_passes(&self, call: &Call, key: &KernelKey, number: u32) -> Result<(), ApiError> {
        let (rollout, _) = self.store.rollout(key, number).await?;
        let candidate = self.store.kernel_version(key, rollout.plan.version).await?;
        let failures = self.verdict(call, &candidate).await?.checks.into_iter().filter(|check| !check.passed);
        let failures = failures.map(|check| check.finding);
        let new: Vec<String> = failures.filter(|finding| !rollout.plan.overridden.contains(finding)).collect();
        if new.is_empty() || rollout.state != RolloutState::Running {
            return Ok(());
        }
        let message = format!(
            "{key}/versions/{} does not pass the promotion gate any more: {}; halt the rollout, and start it again with \
             force if you must",
            rollout.plan.version,
            new.join("; ")
        );
        Err(ApiError::Precondition { reason: PreconditionReason::PromotionGateFailed, message })
    }

    async fn halt_rollout(&self, call: &Call, request: v1::HaltRolloutRequest) -> Result<v1::Rollout, ApiError> {
        let (key, number) = names::rollout(call, &Field::new("name"), &request.name)?;
        call.concerns(&request.name);
        let reason = Field::new("reason").line(request.reason, REASON_BYTES_MAX)?;
        let rollout = self.store.halt_rollout(&key, number, &cause(call, reason), self.store.now_ms()).await?;
        Ok(to_wire::rollout(rollout, Vec::new()))
    }

    async fn get_rollout(&self, call: &Call, request: v1::GetRolloutRequest) -> Result<v1::Rollout, ApiError> {
        let (key, number) = names::rollout(call, &Field::new("name"), &request.name)?;
        let (rollout, events) = self.store.rollout(&key, number).await?;
        Ok(to_wire::rollout(rollout, events))
    }

    async fn list_rollouts(
        &self,
        call: &Call,
        request: v1::ListRolloutsRequest,
    ) -> Result<v1::ListRolloutsResponse, ApiError> {
        let key = names::kernel_key(call, &Field::new("kernel"), &request.kernel)?;
        let page = Page::new(&["rollouts", &request.kernel], request.page_size, &request.page_token)?;
        let rollouts = self.store.rollouts(&key, page.after_number()?, page.limit()).await?;
        let to_wire = |rollout| to_wire::rollout(rollout, Vec::new());
        let (rollouts, next_page_token) = page.fill(rollouts, |rollout| rollout.number.to_string(), to_wire);
        Ok(v1::ListRolloutsResponse { rollouts, next_page_token })
    }
}

/// The checked plan of a request, without its cause.
fn plan(request: &v1::StartRolloutRequest, version: u32) -> Result<RolloutPlan, ApiError> {
    let percent = |name: &'static str, value| Field::new(name).number(value, 0.0..=100.0);
    let share_percent = percent("share_percent", request.share_percent)?;
    if request.group.is_empty() && share_percent == 0.0 {
        let problem = "is 0 and no group is given, so no device would get the version; give one of them";
        return Err(Field::new("share_percent").invalid(problem));
    }
    let group = match request.group.as_str() {
        "" => "",
        group => names::label(&Field::new("group"), group)?,
    };
    let loss = request.self_test_loss_max;
    Ok(RolloutPlan {
        version,
        share_percent,
        group: group.to_owned(),
        failed_percent_max: percent("failed_percent_max", request.failed_percent_max.unwrap_or(FAILED_PERCENT_MAX))?,
        devices_min: Field::new("devices_min").integer_or(request.devices_min, DEVICES_MIN, 1..=u32::MAX)?,
        self_test_loss_max: loss
            .map(|loss| Field::new("self_test_loss_max").number(loss, 0.0..=f64::MAX))
            .transpose()?,
        cause: Default::default(),
        overridden: Vec::new(),
    })
}
