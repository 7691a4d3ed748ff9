//! What of a display an update may change: its notes. Kernels were learned for everything else.

use super::from_wire::notes;
use crate::mask::Changes;
use lightpath_proto::v1::Display;
use lightpath_service::{Field, Result, collect_all};

/// The new notes; `None`: they stay. Refuses everything else that would change.
pub(super) fn changed_notes(
    given: Display,
    stored: Display,
    mask: Option<Vec<String>>,
    field: &Field,
) -> Result<Option<String>> {
    let fixed = [
        ("modulator", given.modulator.is_some(), given.modulator != stored.modulator),
        ("wavelengths_m", !given.wavelengths_m.is_empty(), given.wavelengths_m != stored.wavelengths_m),
        ("carrier", given.carrier != 0, given.carrier != stored.carrier),
        ("orders", given.orders.is_some(), given.orders != stored.orders),
        (
            "camera_fill_factor",
            given.camera_fill_factor.is_some(),
            given.camera_fill_factor != stored.camera_fill_factor,
        ),
        ("bench", given.bench.is_some(), given.bench != stored.bench),
    ];
    let mut fields: Vec<(&str, bool)> = fixed.iter().map(|(name, is_set, _)| (*name, *is_set)).collect();
    fields.push(("notes", !given.notes.is_empty()));
    let mask = mask.map(|paths| paths.into_iter().map(choice_of).collect());
    let changes = Changes::of(mask, &fields, &["name", "create_time", "revision"], "notes or *")?;
    collect_all(fixed.iter().map(|(name, _, differs)| {
        if changes.has(name) && *differs {
            let problem = "is not that of the display, and kernels were learned for its optics";
            return Err(field.at(name).invalid(problem, "create a new display"));
        }
        Ok(())
    }))?;
    if !changes.has("notes") {
        return Ok(None);
    }
    notes(&field.at("notes"), given.notes).map(Some)
}

/// The name of the choice to which a field belongs; other names stay.
fn choice_of(path: String) -> String {
    match path.split('.').next().unwrap_or_default() {
        "first_order" | "all_orders" | "order_filter" => "orders".to_owned(),
        "simulated_bench" => "bench".to_owned(),
        _ => path,
    }
}
