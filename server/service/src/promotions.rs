//! Which version of a kernel is active: promotion through the display's gate, rollback, other aliases, deprecation.

use crate::call::Call;
use crate::error::{Result, ServiceError};
use crate::kernels::Kernels;
use lightpath_domain::kernel::{Cause, Kernel, KernelKey, KernelVersion};
use lightpath_domain::kernel_format::KernelFormat;
use lightpath_domain::promotion::{GateChange, GateCheck, PromotionGate};
use lightpath_domain::reason::PreconditionReason;
use lightpath_store::{AliasMove, Promotion, Store};

/// Gates of a display's history that one answer shows.
const GATES_SHOWN: u32 = 100;

/// How a version did at the gate of its display.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// The checks of the gate.
    pub checks: Vec<GateCheck>,
    /// Version with which it was compared; `None`: no version is active.
    pub active: Option<u32>,
}

/// How a caller wants a version to pass the gate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Passage {
    /// Number of the version.
    pub version: u32,
    /// Version that must be active (0: none); `None`: whichever is.
    pub expected_active: Option<u32>,
    /// Whether the version passes even if it fails the gate. This needs a reason.
    pub force: bool,
    /// Why, for people.
    pub reason: String,
}

/// A version that may become active.
pub(crate) struct Passed {
    /// The version that must still be active then; `None`: none.
    pub(crate) expected_active: Option<u32>,
    /// What failed and was overridden.
    pub(crate) overridden: Vec<String>,
}

/// Promotions and what belongs to them.
#[derive(Clone, Debug)]
pub struct Promotions {
    store: Store,
    kernels: Kernels,
}

impl Promotions {
    pub(crate) fn new(store: Store, kernels: Kernels) -> Self {
        Self { store, kernels }
    }

    /// Makes a version active if it passes the gate of its display.
    pub async fn promote(&self, call: &Call, key: &KernelKey, passage: Passage) -> Result<Kernel> {
        let version = passage.version;
        let Passed { expected_active, overridden } = self.pass_gate(call, key, &passage).await?;
        let promotion = Promotion { version, expected_active, cause: cause(call, passage.reason), overridden };
        Ok(self.store.promote(key, promotion, self.store.now_ms()).await?)
    }

    /// How a version would do at the gate of its display now.
    pub async fn check(&self, call: &Call, key: &KernelKey, version: u32) -> Result<Verdict> {
        Ok(self.verdict(call, key, version).await?.1)
    }

    /// Makes the version active that was active before `expected`.
    pub async fn rollback(
        &self,
        call: &Call,
        key: &KernelKey,
        expected: Option<u32>,
        reason: String,
    ) -> Result<Kernel> {
        let kernel = self.store.rollback(key, expected, &cause(call, reason), self.store.now_ms()).await?;
        self.make_active_ready(call, key);
        Ok(kernel)
    }

    /// Begins to make the files of the active version that devices use. Nobody waits for them: to go back must be quick,
    /// and most devices still have the version.
    pub(crate) fn make_active_ready(&self, call: &Call, key: &KernelKey) {
        let (promotions, call, key) = (self.clone(), call.clone(), key.clone());
        // A device that needs a file which cannot be made asks for it and gets the error.
        tokio::spawn(async move {
            if let Err(error) = promotions.active_files(&call, &key).await {
                tracing::warn!(%error, kernel = %key, "the files of the active version were not made");
            }
        });
    }

    async fn active_files(&self, call: &Call, key: &KernelKey) -> Result<()> {
        let version = self.kernels.version_or_active(key, None).await?;
        for form in self.store.forms_in_use(key).await? {
            if let Err(error) = self.kernels.file(call, version.clone(), form).await {
                tracing::warn!(%error, form = form.as_str(), "a file of the active version was not made");
            }
        }
        Ok(())
    }

    /// Sets the gate of a display. Returns it as [`Self::gates`].
    pub async fn set_gate(
        &self,
        call: &Call,
        display: &str,
        gate: &PromotionGate,
        reason: String,
    ) -> Result<(PromotionGate, Vec<GateChange>)> {
        self.store.set_gate(display, gate, &cause(call, reason), self.store.now_ms()).await?;
        self.gates(display).await
    }

    /// The gate of a display, and all that were set before, the newest first.
    pub async fn gates(&self, display: &str) -> Result<(PromotionGate, Vec<GateChange>)> {
        let history = self.store.gates(display, GATES_SHOWN).await?;
        Ok((history.first().map(|change| change.gate.clone()).unwrap_or_default(), history))
    }

    /// Sets an alias to `version` (`None`: removes it), if it is `expected` now (outer `None`: whatever it is).
    pub async fn set_alias(
        &self,
        call: &Call,
        key: &KernelKey,
        alias: String,
        (version, expected): (Option<u32>, Option<Option<u32>>),
        reason: String,
    ) -> Result<Kernel> {
        let step = AliasMove { alias, version, expected, cause: cause(call, reason) };
        Ok(self.store.set_alias(key, step, self.store.now_ms()).await?)
    }

    /// Advises against a version, or no longer.
    pub async fn deprecate(
        &self,
        call: &Call,
        key: &KernelKey,
        version: u32,
        deprecated: bool,
        reason: String,
    ) -> Result<KernelVersion> {
        let (cause, now_ms) = (cause(call, reason), self.store.now_ms());
        Ok(self.store.deprecate_kernel_version(key, version, deprecated, &cause, now_ms).await?)
    }

    /// Checks a version with the gate. Refuses one that fails, unless the caller forces it and gives a reason.
    pub(crate) async fn pass_gate(&self, call: &Call, key: &KernelKey, passage: &Passage) -> Result<Passed> {
        let &Passage { version, expected_active, force, ref reason } = passage;
        let (candidate, verdict) = self.verdict(call, key, version).await?;
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
            return Err(ServiceError::Precondition { reason: PreconditionReason::PromotionGateFailed, message });
        }
        Ok(Passed { expected_active, overridden })
    }

    /// A version, and how it does at the gate of its display. Its files in the forms that devices use are made first, which
    /// may take a minute: a version that becomes active is ready to be fetched. What may change meanwhile is read afterwards.
    pub(crate) async fn verdict(&self, call: &Call, key: &KernelKey, version: u32) -> Result<(KernelVersion, Verdict)> {
        let candidate = self.store.kernel_version(key, version).await?;
        for form in self.forms_needed(key, &self.gate_of(&key.display).await?).await? {
            self.check_form(call, &candidate, form).await?;
        }
        let candidate = self.store.kernel_version(key, version).await?;
        let gate = self.gate_of(&key.display).await?;
        // If another one becomes active from now on, the store refuses the move.
        let active = self.store.kernel(key).await?.active_version;
        let rival = match active.filter(|active| *active != version) {
            Some(active) => Some(self.store.kernel_version(key, active).await?),
            None => None,
        };
        let mut checks = gate.check(&candidate, rival.as_ref());
        for form in self.forms_needed(key, &gate).await? {
            checks.push(self.check_form(call, &candidate, form).await?);
        }
        Ok((candidate, Verdict { checks, active }))
    }

    /// The forms in which a version must be available: those that devices use, and those that the gate names.
    async fn forms_needed(&self, key: &KernelKey, gate: &PromotionGate) -> Result<Vec<KernelFormat>> {
        let used = self.store.forms_in_use(key).await?;
        let is_needed = |form: &KernelFormat| used.contains(form) || gate.forms.contains(form);
        Ok(KernelFormat::ALL.into_iter().filter(is_needed).collect())
    }

    /// The gate of a display.
    async fn gate_of(&self, display: &str) -> Result<PromotionGate> {
        Ok(self.store.gates(display, 1).await?.pop().map(|change| change.gate).unwrap_or_default())
    }

    async fn check_form(&self, call: &Call, candidate: &KernelVersion, form: KernelFormat) -> Result<GateCheck> {
        let name = form.as_str();
        if form == KernelFormat::Safetensors {
            return Ok(GateCheck::new(true, format!("it is available as {name}")));
        }
        match self.kernels.converted(call, candidate, form).await {
            Ok(converted) => {
                Ok(GateCheck::new(true, format!("it is available as {name}, {} bytes", converted.size_bytes)))
            }
            Err(error) => match error.itself() {
                ServiceError::Precondition { reason: PreconditionReason::NoSuchForm, message } => {
                    Ok(GateCheck::new(false, format!("it is not available as {name}: {message}")))
                }
                // The limit may have been larger when devices got this form. Who forces a promotion decides.
                too_large @ ServiceError::TooLarge { .. } => {
                    Ok(GateCheck::new(false, format!("it is not available as {name}: {too_large}")))
                }
                _ => Err(error),
            },
        }
    }
}

/// The caller with a reason.
pub(crate) fn cause(call: &Call, reason: String) -> Cause {
    Cause { caller: call.caller.name.clone(), reason }
}
