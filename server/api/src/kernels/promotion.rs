//! The active version of a kernel: promotion through the display's gate, and rollback.

use super::{REASON_BYTES_MAX, to_wire};
use crate::api::Api;
use crate::names;
use crate::pages::Page;
use lightpath_proto::v1;
use lightpath_service::{Call, Field, Passage, Result};

impl Api {
    pub(crate) async fn promote_kernel(&self, call: &Call, request: v1::PromoteKernelRequest) -> Result<v1::Kernel> {
        let key = names::kernel_key(call, &Field::new("kernel"), &request.kernel)?;
        let version = Field::new("version").integer(request.version, 1..=u32::MAX)?;
        call.concerns(format!("{key}/versions/{version}"));
        let reason = Field::new("reason").line(request.reason, REASON_BYTES_MAX)?;
        let (expected_active, force) = (request.expected_active_version, request.force);
        let passage = Passage { version, expected_active, force, reason };
        Ok(to_wire::kernel(&self.service.promotions.promote(call, &key, passage).await?))
    }

    pub(crate) async fn check_promotion(
        &self,
        call: &Call,
        request: v1::CheckPromotionRequest,
    ) -> Result<v1::PromotionVerdict> {
        let (key, version) = names::kernel_version(call, &Field::new("name"), &request.name)?;
        let verdict = self.service.promotions.check(call, &key, version).await?;
        Ok(v1::PromotionVerdict {
            passed: verdict.checks.iter().all(|check| check.passed),
            checks: verdict.checks.into_iter().map(to_wire::gate_check).collect(),
            active_version: verdict.active,
        })
    }

    pub(crate) async fn rollback_kernel(&self, call: &Call, request: v1::RollbackKernelRequest) -> Result<v1::Kernel> {
        let key = names::kernel_key(call, &Field::new("kernel"), &request.kernel)?;
        call.concerns(key.to_string());
        let reason = Field::new("reason").line(request.reason, REASON_BYTES_MAX)?;
        let expected = Field::new("expected_active_version").required(request.expected_active_version)?;
        let expected = (expected > 0).then_some(expected);
        Ok(to_wire::kernel(&self.service.promotions.rollback(call, &key, expected, reason).await?))
    }

    pub(crate) async fn list_kernel_moves(
        &self,
        call: &Call,
        request: v1::ListKernelMovesRequest,
    ) -> Result<v1::ListKernelMovesResponse> {
        let key = names::kernel_key(call, &Field::new("kernel"), &request.kernel)?;
        let page = Page::new(&["moves", &request.kernel], request.page_size, &request.page_token)?;
        let moves = self.store.kernel_moves(&key, page.after_number()?, page.limit()).await?;
        let (moves, next_page_token) = page.fill(moves, |moved| moved.sequence.to_string(), to_wire::kernel_move);
        Ok(v1::ListKernelMovesResponse { moves, next_page_token })
    }
}
