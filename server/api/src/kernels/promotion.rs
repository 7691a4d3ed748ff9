//! The active version of a kernel: promotion through the display's gate, and rollback.

use super::to_wire;
use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use crate::pages::Page;
use lightpath_domain::kernel::{Cause, KernelKey, KernelVersion};
use lightpath_domain::kernel_format::KernelFormat;
use lightpath_domain::promotion::{GateCheck, PromotionGate};
use lightpath_domain::reason::PreconditionReason;
use lightpath_proto::v1;
use lightpath_store::Promotion;

/// Limit on the length of a reason \[bytes\]: a paragraph.
pub(crate) const REASON_BYTES_MAX: usize = 1024;

/// How a version did at the gate of its display.
pub(crate) struct Verdict {
    pub(crate) checks: Vec<GateCheck>,
    /// Version with which it was compared; `None`: no version is active.
    pub(crate) active: Option<u32>,
}

/// How a caller wants a version to pass the gate.
pub(crate) struct Passage<'a> {
    pub(crate) version: u32,
    /// Version that must be active (0: none); `None`: whichever is.
    pub(crate) expected_active: Option<u32>,
    pub(crate) force: bool,
    pub(crate) reason: &'a str,
}

/// A version that may become active.
pub(crate) struct Passed {
    /// The version that must still be active then; `None`: none.
    pub(crate) expected_active: Option<u32>,
    /// What failed and was overridden.
    pub(crate) overridden: Vec<String>,
}

impl Api {
    pub(crate) async fn promote_kernel(
        &self,
        call: &Call,
        request: v1::PromoteKernelRequest,
    ) -> Result<v1::Kernel, ApiError> {
        let key = names::kernel_key(call, &Field::new("kernel"), &request.kernel)?;
        let version = Field::new("version").integer(request.version, 1..=u32::MAX)?;
        call.concerns(format!("{key}/versions/{version}"));
        let reason = Field::new("reason").line(request.reason, REASON_BYTES_MAX)?;
        let (expected_active, force) = (request.expected_active_version, request.force);
        let passage = Passage { version, expected_active, force, reason: &reason };
        let Passed { expected_active, overridden } = self.pass_gate(call, &key, passage).await?;
        let promotion = Promotion { version, expected_active, cause: cause(call, reason), overridden };
        Ok(to_wire::kernel(&self.store.promote(&key, promotion, self.store.now_ms()).await?))
    }

    pub(crate) async fn check_promotion(
        &self,
        call: &Call,
        request: v1::CheckPromotionRequest,
    ) -> Result<v1::PromotionVerdict, ApiError> {
        let (key, version) = names::kernel_version(call, &Field::new("name"), &request.name)?;
        let verdict = self.verdict(call, &self.store.kernel_version(&key, version).await?).await?;
        Ok(v1::PromotionVerdict {
            passed: verdict.checks.iter().all(|check| check.passed),
            checks: verdict.checks.into_iter().map(to_wire::gate_check).collect(),
            active_version: verdict.active.unwrap_or(0),
        })
    }

    pub(crate) async fn rollback_kernel(
        &self,
        call: &Call,
        request: v1::RollbackKernelRequest,
    ) -> Result<v1::Kernel, ApiError> {
        let key = names::kernel_key(call, &Field::new("kernel"), &request.kernel)?;
        call.concerns(key.to_string());
        let reason = Field::new("reason").line(request.reason, REASON_BYTES_MAX)?;
        let expected = Field::new("expected_active_version").required(request.expected_active_version)?;
        let expected = (expected > 0).then_some(expected);
        Ok(to_wire::kernel(&self.store.rollback(&key, expected, &cause(call, reason), self.store.now_ms()).await?))
    }

    pub(crate) async fn list_kernel_moves(
        &self,
        call: &Call,
        request: v1::ListKernelMovesRequest,
    ) -> Result<v1::ListKernelMovesResponse, ApiError> {
        let key = names::kernel_key(call, &Field::new("kernel"), &request.kernel)?;
        let page = Page::new(&["moves", &request.kernel], request.page_size, &request.page_token)?;
        let moves = self.store.kernel_moves(&key, page.after_number()?, page.limit()).await?;
        let (moves, next_page_token) = page.fill(moves, |moved| moved.sequence.to_string(), to_wire::kernel_move);
        Ok(v1::ListKernelMovesResponse { moves, next_page_token })
    }

    /// Checks a version with the gate. Refuses one that fails, unless the caller forces it and gives a reason.
    pub(crate) async fn pass_gate(
        &self,
        call: &Call,
        key: &KernelKey,
        passage: Passage<'_>,
    ) -> Result<Passed, ApiError> {
        let Passage { version, expected_active, force, reason } = passage;
        // Versions never change. If another one becomes active meanwhile, the store refuses the move.
        let candidate = self.store.kernel_version(key, version).await?;
        let verdict = self.verdict(call, &candidate).await?;
        let expected_active = match expected_active {
            Some(number) => (number > 0).then_some(number),
            None => verdict.active,
        };
        let failures = verdict.checks.into_iter().filter(|check| !check.passed);
        let overridden: Vec<String> = failures.map(|check| check.finding).collect();
        // Nothing changes for a version that is active already.
        if !overridden.is_empty() && !candidate.active && (!force || reason.trim().is_empty()) {
            let message = format!(
                "{key}/versions/{version} does not pass the promotion gate of displays/{}: {}; to promote it anyway, set \
                 force and give a reason",
                key.display,
                overridden.join("; ")
            );
            return Err(ApiError::Precondition { reason: PreconditionReason::PromotionGateFailed, message });
        }
        Ok(Passed { expected_active, overridden })
    }

    /// How a version does at the gate of its display.
    pub(crate) async fn verdict(&self, call: &Call, candidate: &KernelVersion) -> Result<Verdict, ApiError> {
        let key = &candidate.key;
        let gate = self.gate_of(&key.display).await?;
        let active = self.store.kernel(key).await?.active_version;
        let rival = match active.filter(|active| *active != candidate.version) {
            Some(active) => Some(self.store.kernel_version(key, active).await?),
            None => None,
        };
        let mut checks = gate.check(candidate, rival.as_ref());
        let mut forms = self.store.forms_in_use(key).await?;
        forms.extend(gate.forms);
        for form in KernelFormat::ALL.into_iter().filter(|form| forms.contains(form)) {
            checks.push(self.check_form(call, candidate, form).await?);
        }
        Ok(Verdict { checks, active })
    }

    /// The gate of a display.
    pub(super) async fn gate_of(&self, display: &str) -> Result<PromotionGate, ApiError> {
        Ok(self.store.gates(display, 1).await?.pop().map(|change| change.gate).unwrap_or_default())
    }

    async fn check_form(
        &self,
        call: &Call,
        candidate: &KernelVersion,
        form: KernelFormat,
    ) -> Result<GateCheck, ApiError> {
        let name = form.as_str();
        if form == KernelFormat::Safetensors {
            return Ok(GateCheck::new(true, format!("it is available as {name}")));
        }
        match self.converted(call, candidate, form).await {
            Ok(converted) => {
                Ok(GateCheck::new(true, format!("it is available as {name}, {} bytes", converted.size_bytes)))
            }
            Err(ApiError::Precondition { reason: PreconditionReason::NoSuchForm, message }) => {
                Ok(GateCheck::new(false, format!("it is not available as {name}: {message}")))
            }
            Err(error) => Err(error),
        }
    }
}

/// The caller with a reason.
pub(crate) fn cause(call: &Call, reason: String) -> Cause {
    Cause { caller: call.caller.name.clone(), reason }
}
