//! How good the holograms are, in words.

use super::outputs::Files;
use crate::cli::table::{Facts, Table};
use crate::cli::{job_text, propagation_text, quality_text, show};
use lightpath::v1::{self, Job, job_spec};
use lightpath::{hologram_result, names, units};

/// A target on its way: its name, its job and where its files go.
pub(super) struct Item {
    pub(super) name: String,
    pub(super) job: Job,
    pub(super) files: Files,
}

/// One result in full, or a table of several. The jobs that did not succeed are told as errors.
pub(super) fn results(items: &[Item]) -> String {
    let succeeded = items.iter().filter_map(|item| Some((item, hologram_result(&item.job).ok()?)));
    if let ([item], Some((_, result))) = (items, succeeded.clone().next()) {
        return result_facts(item, result);
    }
    let mut table = Table::new(&[
        "target",
        "kernel",
        ">point",
        ">pixel",
        ">supersampled",
        ">quantized pixel",
        ">SSIM",
        ">ms/iteration",
        "job",
    ]);
    for (item, result) in succeeded {
        let of = |quality: Option<v1::Quality>| quality.unwrap_or_default();
        let (quality, quantized) = (of(result.quality), of(result.quantized_quality));
        table.row([
            item.name.clone(),
            kernel_version(&item.job),
            show::decibel(quality.psnr_point_db),
            show::decibel(quality.psnr_pixel_db),
            show::decibel(quality.psnr_supersampled_db),
            show::decibel(quantized.psnr_pixel_db),
            quality_text::similarity(quantized.ssim_pixel),
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
    facts.add("kernel", kernel_version(&item.job));
    facts.add("speed", format!("{:.1} ms an iteration, {} iterations", result.iteration_ms, result.iterations));
    if let Some(report) = job_text::propagation(&item.job) {
        propagation_text::add(report, &mut facts);
    }
    facts.add_some("saved", item.files.text(result));
    let parts: usize = result.wavelengths.iter().map(|wavelength| wavelength.planes.len()).sum();
    let quality = if parts > 1 { parts_table(result) } else { quality_text::table(result) };
    format!("{}\n{quality}", facts.text())
}

/// A line for each wavelength and plane.
fn parts_table(result: &v1::HologramResult) -> String {
    let mut table = Table::new(&[
        "wavelength",
        "distance",
        ">point",
        ">pixel",
        ">supersampled",
        ">quantized pixel",
        ">SSIM",
        ">efficiency",
    ]);
    for wavelength in &result.wavelengths {
        for plane in &wavelength.planes {
            let (quality, quantized) = (plane.quality.unwrap_or_default(), plane.quantized_quality.unwrap_or_default());
            table.row([
                units::show_m(wavelength.wavelength_m),
                units::show_m(plane.distance_m),
                show::decibel(quality.psnr_point_db),
                show::decibel(quality.psnr_pixel_db),
                show::decibel(quality.psnr_supersampled_db),
                show::decibel(quantized.psnr_pixel_db),
                quality_text::similarity(quantized.ssim_pixel),
                quality_text::percent(quantized.diffraction_efficiency_pixel),
            ]);
        }
    }
    table.text()
}

pub(super) fn kernel_version(job: &Job) -> String {
    match job.spec.as_ref().and_then(|spec| spec.kind.as_ref()) {
        Some(job_spec::Kind::OptimizeHologram(spec)) => show::kernel_version(spec.kernel_version),
        _ => "–".to_owned(),
    }
}
