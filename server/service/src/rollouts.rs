//! Staged rollouts: starting, widening, completing, halting.

use crate::call::Call;
use crate::error::{Result, ServiceError};
use crate::field::{Field, shortened};
use crate::promotions::{Passage, Passed, Promotions, cause};
use lightpath_domain::kernel::KernelKey;
use lightpath_domain::reason::PreconditionReason;
use lightpath_domain::rollout::{Halting, Rollout, RolloutPlan, RolloutState};
use lightpath_store::{RequestMark, Store, Widening};

/// Rollouts.
#[derive(Clone, Debug)]
pub struct Rollouts {
    store: Store,
    promotions: Promotions,
}

impl Rollouts {
    pub(crate) fn new(store: Store, promotions: Promotions) -> Self {
        Self { store, promotions }
    }

    /// Starts a rollout of a version that passes the gate of its display. A repeated request with a mark returns the
    /// rollout that the first one started.
    pub async fn start(
        &self,
        call: &Call,
        key: &KernelKey,
        mut plan: RolloutPlan,
        passage: Passage,
        mark: Option<RequestMark>,
    ) -> Result<Rollout> {
        if let Some(mark) = &mark
            && let Some(number) = self.store.made_by(mark).await?
        {
            return Ok(self.store.rollout(key, number).await?.0);
        }
        self.require_group(&key.display, &plan.group).await?;
        let Passed { expected_active, overridden } = self.promotions.pass_gate(call, key, &passage).await?;
        plan.overridden = overridden;
        plan.cause = cause(call, passage.reason);
        let now_ms = self.store.now_ms();
        Ok(match mark {
            Some(mark) => self.store.start_rollout_once(key, plan, expected_active, &mark, now_ms).await?,
            None => self.store.start_rollout(key, plan, expected_active, now_ms).await?,
        })
    }

    /// At which numbers of failed devices a rollout halts by itself; `None`: it has ended.
    pub async fn halting(&self, rollout: &Rollout) -> Result<Option<Halting>> {
        if rollout.state != RolloutState::Running {
            return Ok(None);
        }
        Ok(Some(rollout.halting(self.store.rollout_devices(rollout).await?)))
    }

    /// Refuses a group that no device is in: nobody would get the version, and a typing error would go unnoticed.
    async fn require_group(&self, display: &str, group: &str) -> Result<()> {
        let groups = self.store.device_groups(display).await?;
        if group.is_empty() || groups.iter().any(|known| known == group) {
            return Ok(());
        }
        let known = match groups.len() {
            0 => "it has no groups".to_owned(),
            _ => format!("its groups are {}", shortened(&groups.join(", "))),
        };
        let problem = format!("is {group:?}, but no device of displays/{display} is in it: {known}");
        Err(Field::new("group").invalid(problem, "put devices into a group with `lightpath device group`"))
    }

    /// Gives a rollout a larger share of the devices.
    pub async fn widen(
        &self,
        call: &Call,
        key: &KernelKey,
        number: u32,
        (share, expected_revision): (f64, Option<u32>),
    ) -> Result<Rollout> {
        self.require_still_passes(call, key, number).await?;
        let widening = Widening { share, expected_revision, caller: call.caller.name.clone() };
        Ok(self.store.widen_rollout(key, number, widening, self.store.now_ms()).await?)
    }

    /// Makes the version of a rollout active, for all devices.
    pub async fn complete(
        &self,
        call: &Call,
        key: &KernelKey,
        number: u32,
        expected_revision: Option<u32>,
    ) -> Result<Rollout> {
        self.require_still_passes(call, key, number).await?;
        let (caller, now_ms) = (&call.caller.name, self.store.now_ms());
        Ok(self.store.complete_rollout(key, number, expected_revision, caller, now_ms).await?)
    }

    /// Ends a rollout; all devices get the active version again.
    pub async fn halt(&self, call: &Call, key: &KernelKey, number: u32, reason: String) -> Result<Rollout> {
        let rollout = self.store.halt_rollout(key, number, &cause(call, reason), self.store.now_ms()).await?;
        self.promotions.make_active_ready(call, key);
        Ok(rollout)
    }

    /// Refuses to go on with a version that fails the gate now, other than by what was overridden at the start.
    async fn require_still_passes(&self, call: &Call, key: &KernelKey, number: u32) -> Result<()> {
        let (rollout, _) = self.store.rollout(key, number).await?;
        let (_, verdict) = self.promotions.verdict(call, key, rollout.plan.version).await?;
        let failures = verdict.checks.into_iter().filter(|check| !check.passed).map(|check| check.finding);
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
        Err(ServiceError::Precondition { reason: PreconditionReason::PromotionGateFailed, message })
    }
}
