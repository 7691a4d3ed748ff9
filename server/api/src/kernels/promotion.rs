//! The active version of a kernel: promotion, rollback, and their history.

use super::to_wire;
use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use crate::pages::Page;
use crate::time::now_ms;
use lightpath_domain::kernel::{KernelVersion, MoveCause};
use lightpath_domain::reason::PreconditionReason;
use lightpath_proto::v1;

/// Limit on the length of the reason of a move \[bytes\]: a paragraph.
const REASON_BYTES_MAX: usize = 1024;

impl Api {
    pub(crate) async fn promote_kernel(
        &self,
        call: &Call,
        request: v1::PromoteKernelRequest,
    ) -> Result<v1::Kernel, ApiError> {
        let key = names::kernel_key(call, &Field::new("kernel"), &request.kernel)?;
        let version = Field::new("version").integer(request.version, 1..=u32::MAX)?;
        call.concerns(format!("{key}/versions/{version}"));
        let reason = Field::new("reason").text(request.reason, REASON_BYTES_MAX)?;
        let expected = request.expected_active_version.map(|version| (version > 0).then_some(version));
        // Versions never change, so this result is still correct when the alias moves.
        let candidate = self.store.kernel_version(&key, version).await?;
        if candidate.content.metrics.no_better_than_ideal() {
            check_forced(&candidate, request.force, &reason)?;
        }
        let kernel = self.store.promote(&key, version, expected, &cause(call, reason), now_ms()).await?;
        Ok(to_wire::kernel(&kernel))
    }

    pub(crate) async fn rollback_kernel(
        &self,
        call: &Call,
        request: v1::RollbackKernelRequest,
    ) -> Result<v1::Kernel, ApiError> {
        let key = names::kernel_key(call, &Field::new("kernel"), &request.kernel)?;
        call.concerns(key.to_string());
        let reason = Field::new("reason").text(request.reason, REASON_BYTES_MAX)?;
        let expected = Field::new("expected_active_version").required(request.expected_active_version)?;
        let expected = (expected > 0).then_some(expected);
        Ok(to_wire::kernel(&self.store.rollback(&key, expected, &cause(call, reason), now_ms()).await?))
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
}

fn cause(call: &Call, reason: String) -> MoveCause {
    MoveCause { caller: call.caller.name.clone(), reason }
}

/// Refuses a version that is no better than the ideal kernel, unless the caller forces the promotion and gives a
/// reason.
fn check_forced(candidate: &KernelVersion, force: bool, reason: &str) -> Result<(), ApiError> {
    if force && !reason.trim().is_empty() {
        return Ok(());
    }
    let KernelVersion { key, version, content, .. } = candidate;
    let losses = format!("{:.6} against {:.6}", content.metrics.test_loss, content.metrics.ideal_test_loss);
    let message = format!(
        "{key}/versions/{version} was measured to be no better than the ideal kernel (held-out loss {losses}); \
         to promote it anyway, set force and give a reason"
    );
    Err(ApiError::Precondition { reason: PreconditionReason::NoBetterThanIdeal, message })
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_domain::kernel::{KernelKey, KernelLineage, KernelMetrics, KernelModel, NewKernelVersion};
    use lightpath_domain::units::{Distance, Wavelength};

    #[test]
    fn promoting_a_kernel_no_better_than_ideal_needs_force_and_a_reason() {
        let wavelength = Wavelength::from_m(515e-9).unwrap();
        let key = KernelKey { display: "lab".to_owned(), wavelength, distance: Distance::from_m(0.15).unwrap() };
        let metrics =
            KernelMetrics { test_pairs: 2, test_loss: 0.02, ideal_test_loss: 0.01, ..KernelMetrics::default() };
        let (model, lineage) = (KernelModel::Dense, KernelLineage::default());
        let content = NewKernelVersion { model, artifact: String::new(), size_bytes: 1, metrics, lineage };
        let version = KernelVersion { key, version: 3, content, create_time_ms: 0, active: false };
        for (force, reason) in [(false, ""), (false, "because"), (true, ""), (true, " ")] {
            let refused = check_forced(&version, force, reason).unwrap_err().to_string();
            assert!(refused.contains("versions/3") && refused.contains("0.020000 against 0.010000"), "{refused}");
        }
        assert!(check_forced(&version, true, "to compare on the bench").is_ok());
    }
}
