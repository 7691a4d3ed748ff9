//! Which kernel of the server is for the optics of the settings.
//!
//! The answer has no signature, and needs none: it is only a part of an address. What the device accepts is decided by the
//! optics in the signed manifest.

use crate::http::Http;
use crate::optics::in_words;
use crate::problem::Problem;
use crate::settings::{Settings, is_word};
use lightpath_manifest::Optics;
use serde_json::Value;

/// Kernels of the display that an error names.
const NAMED_MAX: usize = 10;

/// Asks for the id of the kernel.
pub(crate) fn find(http: &Http, settings: &Settings) -> Result<String, Problem> {
    let Settings { display, optics, .. } = settings;
    let Some(distance_nm) = optics.distance_nm() else {
        return Err(Problem::Setting(format!("no server can be asked for {}: give --kernel", in_words(optics))));
    };
    let query = format!("wavelengthM={}e-12&place.distanceM={distance_nm}e-9", optics.wavelength_pm);
    let found = http.kernels(&query)?;
    match found.first().map(|kernel| id(kernel, display)) {
        Some(Some(id)) => Ok(id),
        Some(None) => Err(Problem::NoList { server: settings.server.clone() }),
        None => Err(Problem::NoKernel {
            display: display.clone(),
            wanted: in_words(optics),
            there: there(&http.kernels(&format!("pageSize={NAMED_MAX}"))?),
        }),
    }
}

/// The id at the end of a kernel's name, if it can be a part of an address.
fn id(kernel: &Value, display: &str) -> Option<String> {
    let name = kernel["name"].as_str()?.strip_prefix("displays/")?;
    let id = name.strip_prefix(display)?.strip_prefix("/kernels/")?;
    is_word(id).then(|| id.to_owned())
}

/// The optics of kernels, for an error.
fn there(kernels: &[Value]) -> String {
    let optics = kernels.iter().take(NAMED_MAX).filter_map(|kernel| {
        let (wavelength_m, distance_m) = (kernel["wavelengthM"].as_f64()?, kernel["place"]["distanceM"].as_f64()?);
        Some(in_words(&Optics::at_distance((wavelength_m * 1e12).round() as i64, (distance_m * 1e9).round() as i64)))
    });
    let optics: Vec<String> = optics.collect();
    if optics.is_empty() { "it has none".to_owned() } else { format!("it has some at {}", optics.join("; at ")) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn only_ids_that_can_be_a_part_of_an_address_are_taken() {
        for (name, expected) in [
            ("displays/pluto/kernels/515nm-150mm", Some("515nm-150mm")),
            ("displays/pluto/kernels/k_7.2", Some("k_7.2")),
            ("displays/venus/kernels/k", None),
            ("displays/pluto/kernels/../../x", None),
            ("displays/pluto/kernels/", None),
            ("k", None),
        ] {
            assert_eq!(id(&json!({ "name": name }), "pluto").as_deref(), expected, "{name}");
        }
    }
}
