//! Figures of the demo.

use super::args::DemoArgs;
use super::files::Files;
use super::held_out::Evaluated;
use super::learned::Learned;
use super::single_kernel;
use super::targets::{self, Targets};
use lightpath::Words as _;
use lightpath::units::show_m;
use lightpath::v1::KernelModel;
use lightpath_bench::SimulatedDisplay;
use lightpath_media::figures::{
    Axis, Canvas, CaptionedPicture, ColourMap, ContactRow, ContactSheet, Curve, Curves, Heatmap,
};
use lightpath_media::kernel_file;
use lightpath_optics::{OpticalSetup, Plane};
use num_complex::Complex64;
use std::f64::consts::PI;

/// Draws every held-out target with its captures through the ideal kernel and through the learned one. With `--paper`,
/// the captures through the paper's kernel are between them.
pub(super) fn contact_sheet(
    args: &DemoArgs,
    files: &Files,
    targets: &Targets,
    evaluated: &[Evaluated],
) -> anyhow::Result<()> {
    let (ideal, learned) = (&evaluated[0], &evaluated[1]);
    let paper = evaluated.iter().find(|evaluated| args.paper && evaluated.candidate.name == KernelModel::Paper.word());
    let mut shown = vec![("through the ideal kernel", ideal), ("through the learned kernel", learned)];
    if let Some(paper) = paper {
        shown.insert(1, ("through the paper's recipe", paper));
    }
    let (width_px, height_px) = args.resolution();
    let subtitle = format!(
        "simulated display, {width_px}×{height_px} px of {}, {}, image at {} · photographs at the target's brightness; darkened: light that the pictures do not need",
        show_m(args.pixel_pitch),
        show_m(args.wavelength),
        show_m(args.distance_m()),
    );
    let rows = targets.held_out.iter().enumerate().map(|(t, target)| {
        let captures = shown.iter().map(|(_, evaluated)| {
            let capture = &evaluated.shown[t];
            let gain_db = capture.captured_psnr_db - ideal.shown[t].captured_psnr_db;
            let gain = if evaluated.candidate.version.is_none() {
                String::new()
            } else {
                format!(" · {}", signed_db(gain_db))
            };
            let caption = format!("captured {:.1} dB{gain}", capture.captured_psnr_db);
            CaptionedPicture { intensity: &capture.capture, caption }
        });
        let target = CaptionedPicture { intensity: &target.intensity, caption: target.name.clone() };
        ContactRow { pictures: [target].into_iter().chain(captures).collect() }
    });
    let columns: Vec<&str> = ["target"].into_iter().chain(shown.iter().map(|(column, _)| *column)).collect();
    let sheet = ContactSheet {
        title: "Photographs of held-out targets",
        subtitle: &subtitle,
        columns: &columns,
        region: Some(targets::region(args)?.into()),
        rows: rows.collect(),
    };
    files.write("contact_sheet.png", sheet.draw().png()?)
}

/// Formats a gain \[dB\] with its sign.
pub(super) fn signed_db(gain_db: f64) -> String {
    format!("{}{:.1} dB", if gain_db < 0.0 { "−" } else { "+" }, gain_db.abs())
}

/// Draws the ideal kernel, the learned kernel, the learned errors and the true errors.
pub(super) fn kernel(files: &Files, kernel: &[u8], bench: &SimulatedDisplay) -> anyhow::Result<()> {
    let (model, _) = kernel_file::decode(kernel)?;
    let setup = bench.setup();
    let sampled_ideal = setup.sampled();
    let ideal = |fx: f64, fy: f64| sampled_ideal.at(fx, fy);
    let learned_error = centred_error(&setup, model.sampled());
    let true_error = centred_error(&setup, |fx, fy| bench.true_transfer(fx, fy));
    let learned = |fx: f64, fy: f64| ideal(fx, fy) * learned_error(fx, fy);

    let nyquist = 0.5 / setup.grid().pixel_pitch_m();
    let inner = nyquist.min(smooth_band(&setup));
    let amplitudes = [
        ("ideal: amplitude", sampled(nyquist, |fx, fy| ideal(fx, fy).norm())),
        ("learned: amplitude", sampled(nyquist, |fx, fy| learned(fx, fy).norm())),
        ("learned / ideal: amplitude", sampled(nyquist, |fx, fy| learned_error(fx, fy).norm())),
        ("truth / ideal: amplitude", sampled(nyquist, |fx, fy| true_error(fx, fy).norm())),
    ];
    // All plots have the same scale, so that they can be compared.
    let highest = amplitudes.iter().flat_map(|(_, plane)| plane.values()).copied().fold(1.0, f32::max);
    let amplitude =
        |(title, plane): &(&str, Plane<f32>)| draw(title, plane, ColourMap::Sequential, (0.0, highest), nyquist);
    let phase = |title: &str, half: f64, of: &dyn Fn(f64, f64) -> Complex64| {
        let plane = sampled(half, |fx, fy| of(fx, fy).arg());
        draw(title, &plane, ColourMap::Cyclic, (-PI as f32, PI as f32), half)
    };
    let sheet = Canvas::grid(&[
        amplitudes.iter().map(amplitude).collect(),
        vec![
            phase("ideal: phase, inner band", inner, &ideal),
            phase("learned: phase, inner band", inner, &learned),
            phase("learned / ideal: phase", nyquist, &learned_error),
            phase("truth / ideal: phase", nyquist, &true_error),
        ],
    ]);
    files.write("kernel.png", sheet.png()?)
}

/// Samples along each axis of a plot of a kernel.
const SAMPLES: usize = 320;

/// Largest frequency \[1/m\] at which a plot of the ideal phase shows its rings without aliasing: the phase 2πz·λf²/2
/// grows by at most 1 rad from one sample to the next.
fn smooth_band(setup: &OpticalSetup) -> f64 {
    (SAMPLES as f64 / (4.0 * PI * setup.wavelength_m() * setup.distance_m().abs())).sqrt()
}

/// H / H_ideal, relative to its value at zero frequency. Brightness and constant phase are not errors.
fn centred_error(setup: &OpticalSetup, transfer: impl Fn(f64, f64) -> Complex64) -> impl Fn(f64, f64) -> Complex64 {
    let ideal = setup.sampled();
    let centre = transfer(0.0, 0.0) / ideal.at(0.0, 0.0);
    move |fx, fy| {
        let ideal = ideal.at(fx, fy);
        if ideal.norm() == 0.0 { Complex64::ZERO } else { transfer(fx, fy) / ideal / centre }
    }
}

fn sampled(half: f64, value: impl Fn(f64, f64) -> f64) -> Plane<f32> {
    let frequency = |i: usize| half * ((2 * i + 1) as f64 / SAMPLES as f64 - 1.0);
    Plane::from_fn(SAMPLES, SAMPLES, |y, x| value(frequency(x), frequency(y)) as f32)
}

fn draw(title: &str, values: &Plane<f32>, colours: ColourMap, range: (f32, f32), half: f64) -> Canvas {
    let axis = |label| Axis { label, start: -half / 1e3, end: half / 1e3 };
    let unit = if colours == ColourMap::Cyclic { "rad" } else { "" };
    Heatmap { title, values, colours, range, unit, x: axis("fx [cycles/mm]"), y: axis("fy [cycles/mm]") }.draw()
}

/// Draws the training losses of the learned models, and the limit for models that consist of a kernel alone.
pub(super) fn loss(files: &Files, learned: &[Learned], evaluated: &[Evaluated]) -> anyhow::Result<()> {
    let curve = |learned: &Learned| Curve { label: learned.name.to_owned(), values: learned.loss_history.clone() };
    let mut curves: Vec<Curve> = learned.iter().map(curve).collect();
    if let Some(floor) = evaluated.iter().find(|evaluated| evaluated.candidate.name == single_kernel::NAME) {
        curves.push(Curve { label: "true single kernel, held-out".to_owned(), values: vec![floor.losses.test.region] });
    }
    let curves = Curves {
        title: "Learning the display",
        x_label: "epochs of Adam, then steps of Levenberg–Marquardt",
        y_label: "mean squared error of the photographs",
        curves,
    };
    files.write("loss.png", curves.draw().png()?)
}
