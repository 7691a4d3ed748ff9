//! Results of holograms as text.

use super::outputs::Files;
use super::quality;
use crate::table::{Facts, Table};
use crate::{propagation_text, show};
use lightpath::v1::{self, Job, optimize_hologram::Judging, optimize_hologram_result::PlaneResult};
use lightpath::{hologram_result, names, units};
use std::collections::BTreeSet;

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
    let mut table = Table::new(
        "target~|kernel~????|>in a photograph|>point?????|>pixel?|>supersampled?????|>SSIM??|>ms/iteration?????|\
         job???",
    );
    for (item, result) in succeeded {
        let first = result.wavelengths.first().and_then(|wavelength| wavelength.planes.first().cloned());
        let [photographed, point, pixel, supersampled, similarity, _] =
            quality::summary(&first.unwrap_or_default(), result.judged());
        table.row([
            item.name.clone(),
            show::used_kernels(&item.job.kernels),
            photographed,
            point,
            pixel,
            supersampled,
            similarity,
            format!("{:.1}", 1e3 * result.iteration_time_s),
            names::id(&item.job.name).to_owned(),
        ]);
    }
    let results = items.iter().filter_map(|item| Some((item, hologram_result(&item.job).ok()?)));
    let notes = results
        .clone()
        .flat_map(|(item, result)| self::notes(result).map(|note| format!("\nnote: {}: {note}", item.name)));
    let mut planes =
        results.clone().flat_map(|(_, result)| &result.wavelengths).flat_map(|wavelength| &wavelength.planes);
    let own = planes.find_map(quality::own_kernel_note).map(|note| format!("\nnote: {note}"));
    // The table has the first plane of each.
    let first = |(item, result): (&Item, &v1::OptimizeHologramResult)| {
        let plane = result.wavelengths.first()?.planes.first()?.clone();
        quality::in_photograph_note(&plane, item.job.kernels.first())
    };
    let figures: BTreeSet<&str> = results.filter_map(first).collect();
    let figures = figures.into_iter().map(|note| format!("\nnote: {note}")).collect::<String>();
    table.text_or("") + &figures + &own.unwrap_or_default() + &notes.collect::<String>()
}

/// The notes about a result, each once.
fn notes(result: &v1::OptimizeHologramResult) -> impl Iterator<Item = &str> {
    let mut seen = BTreeSet::new();
    let all = result.wavelengths.iter().flat_map(|wavelength| &wavelength.notes);
    all.map(String::as_str).filter(move |note| seen.insert(*note))
}

/// The time of an iteration, and what computed it if that was not a processor without a card.
pub(super) fn speed(result: &v1::OptimizeHologramResult) -> String {
    let by = if result.computed_by.is_empty() { String::new() } else { format!(", on {}", result.computed_by) };
    format!("{:.1} ms per iteration, {} iterations{by}", 1e3 * result.iteration_time_s, result.iterations)
}

/// Files and quality of each hologram, plane by plane.
pub(super) fn in_full(result: &v1::OptimizeHologramResult, kernels: &[v1::UsedKernel]) -> String {
    let mut text = String::new();
    // One for each plane of each wavelength, in their order.
    let mut kernels = kernels.iter();
    for wavelength in &result.wavelengths {
        let mut facts = Facts::default();
        facts.add("wavelength", units::show_m(wavelength.wavelength_m));
        for subframe in &wavelength.subframes {
            facts.add("pattern", &subframe.pattern);
            facts.add("phase", &subframe.phase);
        }
        wavelength.notes.iter().for_each(|note| facts.add("note", note));
        text += &format!("\n{}", facts.text());
        for plane in &wavelength.planes {
            let mut facts = Facts::default();
            facts.add("distance", show::place(plane.place.as_ref()));
            propagation_text::add(plane.propagation.as_ref(), &mut facts);
            facts.add("reconstruction", &plane.reconstruction);
            add_judgements(plane, kernels.next(), result.judged(), &mut facts);
            text += &format!("\n{}\n{}", facts.text(), quality::table(plane));
        }
    }
    text
}

fn result_facts(item: &Item, result: &v1::OptimizeHologramResult) -> String {
    let mut facts = Facts::default();
    facts.add("target", &item.name);
    facts.add("job", names::id(&item.job.name));
    facts.add("kernel", show::used_kernels(&item.job.kernels));
    facts.add("speed", speed(result));
    let mut planes = result.wavelengths.iter().flat_map(|wavelength| &wavelength.planes);
    let (first, others) = (planes.next(), planes.next());
    propagation_text::add(first.and_then(|plane| plane.propagation.as_ref()), &mut facts);
    if let Some(plane) = first {
        add_judgements(plane, item.job.kernels.first(), result.judged(), &mut facts);
    }
    notes(result).for_each(|note| facts.add("note", note));
    facts.add_some("saved", item.files.text(result));
    let quality = match (first, others) {
        (Some(plane), None) => quality::table(plane),
        _ => parts_table(result),
    };
    format!("{}\n{quality}", facts.text())
}

/// Adds what was judged of a plane, and what the job left out.
fn add_judgements(plane: &PlaneResult, kernel: Option<&v1::UsedKernel>, judged: Judging, facts: &mut Facts) {
    let headline = quality::in_photograph(plane, kernel).or_else(|| quality::without_headline(judged));
    facts.add_some("in a photograph", headline);
    facts.add_some("the table", quality::own_kernel_note(plane));
    facts.add_some("other optics", quality::other_orders(plane).or_else(|| quality::without_others(judged)));
    facts.add_some("second opinion", quality::second_opinion(plane).or_else(|| quality::without_others(judged)));
}

/// A table with a line for each wavelength and plane.
fn parts_table(result: &v1::OptimizeHologramResult) -> String {
    let mut table =
        Table::new("wavelength|distance|>in a photograph|>point???|>pixel?|>supersampled???|>SSIM?|>efficiency??");
    for wavelength in &result.wavelengths {
        for plane in &wavelength.planes {
            let [photographed, point, pixel, supersampled, similarity, efficiency] =
                quality::summary(plane, result.judged());
            let (wavelength, distance) = (units::show_m(wavelength.wavelength_m), show::place(plane.place.as_ref()));
            table.row([wavelength, distance, photographed, point, pixel, supersampled, similarity, efficiency]);
        }
    }
    table.text()
}
