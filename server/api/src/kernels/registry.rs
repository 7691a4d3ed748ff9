//! What people say about versions: promotion gates, aliases, deprecations; and the search for the nearest distance.

use super::{REASON_BYTES_MAX, to_wire};
use crate::api::Api;
use crate::names;
use crate::optics::from_wire::distance;
use lightpath_domain::kernel::{ACTIVE, KernelKey};
use lightpath_domain::promotion::{GateChange, PromotionGate};
use lightpath_proto::v1;
use lightpath_service::{Call, Field, Result};

/// Limit on the test pairs that a gate requires: no dataset has more.
const TEST_PAIRS_MAX: u32 = 100_000;
/// Names that cannot be aliases, because they have another meaning where a version is named.
const RESERVED: [&str; 3] = [ACTIVE, "ideal", "latest"];

impl Api {
    pub(crate) async fn set_promotion_gate(
        &self,
        call: &Call,
        request: v1::SetPromotionGateRequest,
    ) -> Result<v1::DisplayGate> {
        let display = self.display_named(call, &Field::new("display"), &request.display).await?;
        call.concerns(&request.display);
        let reason = Field::new("reason").line(request.reason, REASON_BYTES_MAX)?;
        let gate = gate_from_wire(&Field::new("gate"), request.gate.unwrap_or_default())?;
        Ok(display_gate(&display.id, self.service.promotions.set_gate(call, &display.id, &gate, reason).await?))
    }

    pub(crate) async fn get_promotion_gate(
        &self,
        call: &Call,
        request: v1::GetPromotionGateRequest,
    ) -> Result<v1::DisplayGate> {
        let display = self.display_named(call, &Field::new("display"), &request.display).await?;
        Ok(display_gate(&display.id, self.service.promotions.gates(&display.id).await?))
    }

    pub(crate) async fn set_kernel_alias(&self, call: &Call, request: v1::SetKernelAliasRequest) -> Result<v1::Kernel> {
        let key = names::kernel_key(call, &Field::new("kernel"), &request.kernel)?;
        call.concerns(key.to_string());
        let alias = alias(&Field::new("alias"), &request.alias)?.to_owned();
        let reason = Field::new("reason").line(request.reason, REASON_BYTES_MAX)?;
        let version = Field::new("version").version_if_set(request.version, "no version, which removes the alias")?;
        let expected = request.expected_version.map(|version| (version > 0).then_some(version));
        let kernel = self.service.promotions.set_alias(call, &key, alias, (version, expected), reason).await?;
        Ok(to_wire::kernel(&kernel))
    }

    pub(crate) async fn deprecate_kernel_version(
        &self,
        call: &Call,
        request: v1::DeprecateKernelVersionRequest,
    ) -> Result<v1::KernelVersion> {
        let (key, version) = names::kernel_version(call, &Field::new("name"), &request.name)?;
        call.concerns(&request.name);
        let field = Field::new("reason");
        let reason = field.line(request.reason, REASON_BYTES_MAX)?;
        if reason.trim().is_empty() {
            return Err(field.but("is empty", "must say why"));
        }
        let deprecated = !request.undo;
        let version = self.service.promotions.deprecate(call, &key, version, deprecated, reason).await?;
        Ok(to_wire::version(version))
    }

    pub(crate) async fn find_nearest_kernels(
        &self,
        call: &Call,
        request: v1::FindNearestKernelsRequest,
    ) -> Result<v1::FindNearestKernelsResponse> {
        let display = self.display_named(call, &Field::new("display"), &request.display).await?;
        let wavelength = Field::new("wavelength_m").wavelength_of(request.wavelength_m, &display)?;
        let distance = distance(&Field::new("place"), request.place.as_ref())?;
        let key = KernelKey { display: display.id, wavelength, distance };
        let (kernels, can_be_interpolated) = self.service.kernels.nearest(&key).await?;
        Ok(v1::FindNearestKernelsResponse {
            kernels: kernels.iter().map(to_wire::kernel).collect(),
            can_be_interpolated,
        })
    }
}

fn display_gate(display: &str, (gate, history): (PromotionGate, Vec<GateChange>)) -> v1::DisplayGate {
    v1::DisplayGate {
        display: format!("displays/{display}"),
        gate: Some(to_wire::gate(gate)),
        history: history.into_iter().map(to_wire::gate_change).collect(),
    }
}

fn gate_from_wire(field: &Field, gate: v1::PromotionGate) -> Result<PromotionGate> {
    let least = gate.loss_reduction_min;
    let least = least.map(|least| field.at("loss_reduction_min").number(least, 0.0..=1.0));
    let forms = gate.formats.iter().map(|name| field.at("formats").kernel_format(name));
    Ok(PromotionGate {
        loss_reduction_min: least.transpose()?,
        worse_than_ideal_allowed: gate.worse_than_ideal_allowed,
        test_pairs_min: field.at("test_pairs_min").integer(gate.test_pairs_min, 0..=TEST_PAIRS_MAX)?,
        forms: forms.collect::<Result<_, _>>()?,
    })
}

/// Checks an alias other than `active`.
fn alias<'a>(field: &Field, text: &'a str) -> Result<&'a str> {
    let alias = names::label(field, text)?;
    if RESERVED.contains(&alias) {
        return Err(field.invalid(format!("is {alias:?}, which has another meaning"), "choose another name"));
    }
    Ok(alias)
}
