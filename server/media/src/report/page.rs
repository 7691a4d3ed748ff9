//! The HTML page of a report.

use super::base64;
use super::chapter::{Chapter, Figure};
use super::input::ReportInput;
use crate::figures::escaped;
use lightpath_domain::kernel::KernelMetrics;
use lightpath_domain::lineage::LearningParameters;
use lightpath_optics::Detector;
use lightpath_optics::learning::PartCost;
use std::fmt::Write as _;

const STYLE: &str = "\
body{font:15px/1.5 system-ui,'DejaVu Sans',sans-serif;color:#1a1a1a;max-width:66rem;margin:2rem auto;padding:0 1.5rem}\
h1{font-size:1.6rem;margin-bottom:.2rem}h2{font-size:1.2rem;margin-top:2.4rem;border-bottom:1px solid #ddd;padding-bottom:.2rem}\
table{border-collapse:collapse;margin:1rem 0}td,th{padding:.2rem .8rem .2rem 0;text-align:left;vertical-align:top}\
th{color:#6b6b6b;font-weight:normal;border-bottom:1px solid #ddd}.n{text-align:right;font-variant-numeric:tabular-nums}\
figure{margin:1.2rem 0}figure img,figure svg{max-width:100%;height:auto}figcaption{color:#6b6b6b;font-size:.9rem}\
.bar{display:inline-block;height:.7em}code{font-size:.85rem;overflow-wrap:anywhere}.sub{color:#6b6b6b;margin-top:0}\
nav a{margin-right:1.1rem}";

/// The summary: origin and quality of the kernel.
pub(super) fn summary(input: &ReportInput) -> Chapter {
    let mut body = String::from("<table>");
    for (name, value) in origin(input) {
        // Writing to a string cannot fail.
        let _ = write!(body, "<tr><td>{name}</td><td><code>{}</code></td></tr>", escaped(&value));
    }
    body.push_str("</table>");
    body.push_str(&mean_losses(&input.version.content.metrics));
    body.push_str(&parts(&input.version.content.metrics));
    Chapter { title: "Summary", body, ..Chapter::default() }
}

/// Rows of the table about the kernel's setup and origin.
fn origin(input: &ReportInput) -> Vec<(&'static str, String)> {
    let (version, content) = (&input.version, &input.version.content);
    let (metrics, lineage) = (&content.metrics, &content.lineage);
    let grid = input.model.setup.grid();
    let mut rows = vec![
        ("model", content.model.name().to_owned()),
        (
            "display",
            format!(
                "{}, {}×{} px of {:.2} µm",
                version.key.display,
                grid.width_px(),
                grid.height_px(),
                grid.pixel_pitch_m() * 1e6
            ),
        ),
        ("optics", format!("{} at {}", version.key.wavelength, version.key.distance)),
    ];
    if let Some(distances) = lineage.joint_distances() {
        let distances: Vec<String> = distances.iter().map(ToString::to_string).collect();
        let label = if lineage.is_interpolated() { "interpolated from photographs at" } else { "learned together for" };
        rows.push((label, distances.join(", ")));
    }
    if let Some(dataset) = lineage.own_dataset() {
        let pairs = format!(
            "{} training, {} validation, {} test",
            metrics.train_pairs, metrics.validation_pairs, metrics.test_pairs
        );
        rows.push(("dataset", format!("{} ({pairs})", dataset.id)));
        rows.push(("digest of the dataset", dataset.digest.clone()));
    }
    if !lineage.job().is_empty() {
        rows.push(("job", lineage.job().to_owned()));
    }
    if let Some(parameters) = lineage.parameters() {
        rows.push(("asked for", asked(parameters)));
    }
    rows.push(("file", format!("{}, {} bytes", content.artifact, content.size_bytes)));
    rows.push(("Lightpath", lineage.code_version.clone()));
    rows
}

/// What was asked of the learning, without what was left to it.
fn asked(parameters: &LearningParameters) -> String {
    let LearningParameters { model, degree, epochs, learning_rate, refinement_evaluations, seed, .. } = parameters;
    let region = parameters.region_of_interest;
    let given = [
        degree.map(|degree| format!("degree {degree}")),
        epochs.map(|epochs| format!("{epochs} epochs")),
        learning_rate.map(|rate| format!("learning rate {rate}")),
        refinement_evaluations.map(|evaluations| format!("{evaluations} refining evaluations")),
        (parameters.detector == Detector::Point).then(|| "light at points".to_owned()),
    ];
    let mut words = vec![model.name().to_owned()];
    words.extend(given.into_iter().flatten());
    words.push(format!("seed {seed}"));
    let (width_px, height_px) = (region.width_px(), region.height_px());
    words.push(format!("region {width_px}×{height_px} px at ({}, {})", region.x_px(), region.y_px()));
    words.join(", ")
}

/// Table of the kernel's losses, as HTML. Empty: no pair was held out.
fn mean_losses(metrics: &KernelMetrics) -> String {
    if metrics.test_pairs == 0 {
        return String::new();
    }
    let row = |name: &str, loss: f64| format!("<tr><td>{name}</td><td class=n>{loss:.3e}</td><td></td><td></td></tr>");
    let validation = match metrics.validation_pairs {
        0 => String::new(),
        _ => row("validation pairs", metrics.validation_loss),
    };
    format!(
        "<table><tr><th>mean squared error</th><th class=n>learned</th><th class=n>ideal kernel</th><th class=n>ratio</th></tr>\
         {}{}{}{validation}</table>",
        losses("held-out pairs, region of interest", metrics.test_loss, metrics.ideal_test_loss),
        losses("held-out pairs, full frame", metrics.test_loss_full_frame, metrics.ideal_test_loss_full_frame),
        row("training pairs", metrics.train_loss),
    )
}

/// Table of what each part of the model explains, as HTML. Empty: it was not measured.
fn parts(metrics: &KernelMetrics) -> String {
    if metrics.parts.is_empty() {
        return String::new();
    }
    let row = |cost: &PartCost| {
        let certain = if cost.least_db > 0.0 { "" } else { "not in every photograph" };
        let db = |value: f64| format!("{value:.1}").replace('-', "−");
        format!(
            "<tr><td>{}</td><td class=n>{} dB</td><td class=n>{} to {} dB</td><td>{certain}</td></tr>",
            cost.part.title(),
            db(cost.cost_db),
            db(cost.least_db),
            db(cost.most_db)
        )
    };
    format!(
        "<p>What limits this display: how much worse photographs are predicted without each part of the model, all else being \
         equal.</p><table><tr><th>part of the display</th><th class=n>median</th><th class=n>over the photographs</th><th></th></tr>{}</table>",
        metrics.parts.iter().map(row).collect::<String>()
    )
}

fn losses(name: &str, learned: f64, ideal: f64) -> String {
    let ratio = if learned > 0.0 {
        format!("{:.1} dB", 10.0 * (ideal / learned).log10()).replace('-', "−")
    } else {
        "–".to_owned()
    };
    format!(
        "<tr><td>{name}</td><td class=n>{learned:.3e}</td><td class=n>{ideal:.3e}</td><td class=n>{ratio}</td></tr>"
    )
}

/// The whole page.
pub(super) fn html(input: &ReportInput, chapters: &[Chapter]) -> String {
    let name = escaped(&format!("{}/versions/{}", input.version.key, input.version.version));
    let method = if input.version.content.lineage.is_interpolated() { "interpolated" } else { "learned" };
    let orders = input.model.setup.orders();
    let mut page = format!(
        "<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content=\"width=device-width,initial-scale=1\">\
         <title>{name}</title><style>{STYLE}</style><h1>Light transport, as {method}</h1><p class=sub>{name}, of a display that shows {orders}</p><nav>"
    );
    for (i, chapter) in chapters.iter().enumerate() {
        // Writing to a string cannot fail.
        let _ = write!(page, "<a href=\"#c{i}\">{}</a>", chapter.title);
    }
    page.push_str("</nav>");
    for (i, chapter) in chapters.iter().enumerate() {
        let _ = write!(page, "<h2 id=c{i}>{}</h2>{}", chapter.title, chapter.body);
        for figure in &chapter.figures {
            let _ =
                write!(page, "<figure>{}<figcaption>{}</figcaption></figure>", picture(figure), escaped(&figure.title));
        }
    }
    page.push_str("</html>\n");
    page
}

fn picture(figure: &Figure) -> String {
    if figure.name.ends_with(".svg") {
        return String::from_utf8_lossy(&figure.bytes).into_owned();
    }
    format!("<img alt=\"{}\" src=\"data:image/png;base64,{}\">", escaped(&figure.title), base64::encode(&figure.bytes))
}
