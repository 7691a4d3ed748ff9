//! Quality of holograms as text.

use super::outputs::Files;
use crate::table::{Facts, Table};
use crate::{propagation_text, quality_text, show};
use lightpath::v1::{self, Job};
use lightpath::{hologram_result, names, units};

/// A target with its job and its output files.
pub(super) struct Item {
    pub(super) name: String,
    pub(super) job: Job,
    pub(super) files: Files,
}

/// Formats the results: one in full, several as a table. Jobs without success are left out; the caller reports them as
/// errors.
pub(super) fn results(items: &[Item]) -> String {
    let succeeded = items.iter().filter_map(|item| Some((item, hologram_result(&item.job).ok()?)));
    if let ([item], Some((_, result))) = (items, succeeded.clone().next()) {
        return result_facts(item, result);
    }
    let mut table = Table::new(&[
        "target~",
        "kernel~????",
        ">point?????",
        ">pixel",
        ">supersampled?????",
        ">quantized pixel?",
        ">SSIM??",
        ">ms/iteration?????",
        "job???",
    ]);
    for (item, result) in succeeded {
        let first = result.wavelengths.first().and_then(|wavelength| wavelength.planes.first());
        let [point, pixel, supersampled, quantized, similarity, _] =
            quality_text::summary(first.cloned().unwrap_or_default());
        table.row([
            item.name.clone(),
            show::kernel_versions(&item.job.kernel_versions),
            point,
            pixel,
            supersampled,
            quantized,
            similarity,
            format!("{:.1}", result.iteration_ms),
            names::id(&item.job.name).to_owned(),
        ]);
    }
    table.text_or("")
}

fn result_facts(item: &Item, result: &v1::HologramResult) -> String {
    let mut facts = Facts::default();
    facts.add("target", &item.name);
    facts.add("job", names::id(&item.job.name));
    facts.add("kernel", show::kernel_versions(&item.job.kernel_versions));
    facts.add("speed", format!("{:.1} ms per iteration, {} iterations", result.iteration_ms, result.iterations));
    let mut planes = result.wavelengths.iter().flat_map(|wavelength| &wavelength.planes);
    let (first, others) = (planes.next(), planes.next());
    if let Some(report) = first.and_then(|plane| plane.propagation.as_ref()) {
        propagation_text::add(report, &mut facts);
    }
    facts.add_some("other optics", first.and_then(quality_text::other_orders));
    facts.add_some("second opinion", first.and_then(quality_text::second_opinion));
    facts.add_some("saved", item.files.text(result));
    let quality = match (first, others) {
        (Some(plane), None) => quality_text::table(plane),
        _ => parts_table(result),
    };
    format!("{}\n{quality}", facts.text())
}

/// A table with a line for each wavelength and plane.
fn parts_table(result: &v1::HologramResult) -> String {
    let mut table = Table::new(&[
        "wavelength",
        "distance",
        ">point???",
        ">pixel",
        ">supersampled???",
        ">quantized pixel?",
        ">SSIM?",
        ">efficiency??",
    ]);
    for wavelength in &result.wavelengths {
        for plane in &wavelength.planes {
            let [point, pixel, supersampled, quantized, similarity, efficiency] = quality_text::summary(plane.clone());
            let (wavelength, distance) = (units::show_m(wavelength.wavelength_m), units::show_m(plane.distance_m));
            table.row([wavelength, distance, point, pixel, supersampled, quantized, similarity, efficiency]);
        }
    }
    table.text()
}
