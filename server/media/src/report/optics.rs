//! Chapters about the kernel and its optics.

use super::chapter::{Chapter, ReportError};
use super::evidence::Evidence;
use super::modulator;
use crate::figures::{Axis, Canvas, Chart, ColourMap, Heatmap, Line};
use lightpath_optics::diagnostics::point_spread::{OVERSAMPLING, WINDOW_PX};
use lightpath_optics::diagnostics::{PointSpread, ZernikeFit, point_spread};
use lightpath_optics::{DisplayModel, KernelShape, Plane};
use num_complex::Complex64;
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;

/// Number of samples of the band along an axis, in pictures and arrays.
pub(super) const SAMPLES: usize = 256;

/// The chapters about kernel, aberrations, spot, source and response.
pub(super) fn chapters(model: &DisplayModel, evidence: Option<&Evidence>) -> Result<Vec<Chapter>, ReportError> {
    let ratio = ratio(model);
    let mut chapters = vec![transfer(model, &ratio)?, aberrations(model), spot(model, &ratio)?];
    if !model.variation.is_none() {
        for chapter in &mut chapters {
            chapter.body.insert_str(0, "<p>This chapter describes the kernel on the axis of the modulator.</p>");
        }
    }
    if !model.source.is_flat() || !model.dust.is_none() {
        chapters.push(source(model)?);
    }
    chapters.push(modulator::chapter(model, evidence));
    Ok(chapters)
}

/// H / H_ideal at fx, fy \[1/m\]. It is 0 where free space passes no light. For kernels of free bins the constant phase
/// is removed.
pub(super) fn ratio(model: &DisplayModel) -> impl Fn(f64, f64) -> Complex64 + Sync + '_ {
    let ideal = model.setup.sampled();
    let learned = model.sampled();
    let raw = move |fx: f64, fy: f64| {
        let free = ideal.at(fx, fy);
        if free.norm() > 1e-9 { learned(fx, fy) / free } else { Complex64::ZERO }
    };
    // The phase of the sum over samples of the band. The phase of a single free bin would be noise.
    let nyquist = 0.5 / model.setup.grid().pixel_pitch_m();
    let along = |i: usize| nyquist * ((2 * i + 1) as f64 / 16.0 - 1.0);
    let sum: Complex64 = (0..256).map(|i| raw(along(i % 16), along(i / 16))).sum();
    let turn = if matches!(model.kernel, KernelShape::Bins(_)) && sum.norm() > 0.0 {
        sum.conj() / sum.norm()
    } else {
        Complex64::ONE
    };
    move |fx, fy| raw(fx, fy) * turn
}

pub(super) fn band(nyquist: f64, of: impl Fn(f64, f64) -> f64) -> Plane<f32> {
    let along = |i: usize| nyquist * ((2 * i + 1) as f64 / SAMPLES as f64 - 1.0);
    Plane::from_fn(SAMPLES, SAMPLES, |y, x| of(along(x), along(y)) as f32)
}

pub(super) fn heat(
    title: &str,
    values: &Plane<f32>,
    colours: ColourMap,
    range: (f32, f32),
    half: f64,
    unit: &str,
) -> Canvas {
    let axis = |label| Axis { label, start: -half, end: half };
    let (x, y) = (axis("fx [1/mm]"), axis("fy [1/mm]"));
    Heatmap { title, values, colours, range, unit, x, y }.draw()
}

fn highest(plane: &Plane<f32>) -> f32 {
    plane.values().iter().copied().filter(|value| value.is_finite()).fold(f32::MIN_POSITIVE, f32::max)
}

fn transfer(model: &DisplayModel, ratio: &(impl Fn(f64, f64) -> Complex64 + Sync)) -> Result<Chapter, ReportError> {
    let nyquist = 0.5 / model.setup.grid().pixel_pitch_m();
    let per_mm = nyquist / 1000.0;
    let learned = model.sampled();
    let amplitude = band(nyquist, |fx, fy| learned(fx, fy).norm());
    let phase = band(nyquist, |fx, fy| learned(fx, fy).arg());
    let ratio_amplitude = band(nyquist, |fx, fy| ratio(fx, fy).norm());
    let ratio_phase = band(nyquist, |fx, fy| ratio(fx, fy).arg());
    let top = highest(&amplitude).max(highest(&ratio_amplitude));
    let cyclic = (-PI as f32, PI as f32);
    let sheet = Canvas::grid(&[
        vec![
            heat("learned / ideal: amplitude", &ratio_amplitude, ColourMap::Sequential, (0.0, top), per_mm, ""),
            heat("learned / ideal: phase", &ratio_phase, ColourMap::Cyclic, cyclic, per_mm, "rad"),
        ],
        vec![
            heat("learned: amplitude", &amplitude, ColourMap::Sequential, (0.0, top), per_mm, ""),
            heat("learned: phase", &phase, ColourMap::Cyclic, cyclic, per_mm, "rad"),
        ],
    ]);
    let mut chapter = Chapter {
        title: "Kernel",
        body: "<p>The transfer function H over the modulator's band, and its ratio to that of free space over the same \
               distance. The ratio is the effect of the optics. Far from the middle the phase of H changes too fast for \
               the pixels of this picture; the phase of the ratio does not.</p>"
            .to_owned(),
        ..Chapter::default()
    };
    chapter.png("kernel", "Amplitude and phase of the kernel, and of its ratio to the ideal one", &sheet)?;
    for (name, plane) in [
        ("kernel_amplitude", &amplitude),
        ("kernel_phase_rad", &phase),
        ("ratio_amplitude", &ratio_amplitude),
        ("ratio_phase_rad", &ratio_phase),
    ] {
        chapter.array(name, &[SAMPLES, SAMPLES], plane.values().iter().map(|&value| value.into()));
    }
    Ok(chapter)
}

fn aberrations(model: &DisplayModel) -> Chapter {
    let mut chapter = Chapter { title: "Aberrations", ..Chapter::default() };
    let phase = match &model.kernel {
        KernelShape::Smooth(errors) => {
            let basis = errors.basis();
            let phase = errors.phase.clone();
            move |x: f64, y: f64| basis.value(&phase, x, y)
        }
        KernelShape::Ideal => {
            chapter.body = "<p>The ideal kernel has no aberrations.</p>".to_owned();
            return chapter;
        }
        KernelShape::Bins(_) => {
            chapter.body = "<p>Unknown: the phase of a kernel with a value for each frequency is known only up to \
                            whole turns, and its noise makes the turns hard to count. Learn a smooth or display model \
                            to see the aberrations.</p>"
                .to_owned();
            return chapter;
        }
    };
    let Some(fit) = ZernikeFit::of(phase, 96) else { return chapter };
    let mut body = format!(
        "<p>The phase of H / H<sub>ideal</sub> as Zernike polynomials (Noll) over the disc that touches the band's \
         edges. Without piston and tilts, which only move the image, its root mean square is <b>{:.3} rad ({:.3} \
         waves)</b>. The terms of the table leave a residual of {:.3} rad.</p><table><tr><th>Z</th><th>name</th>\
         <th class=n>rad</th><th class=n>waves</th><th></th></tr>",
        fit.rms_rad,
        fit.rms_rad / TAU,
        fit.residual_rad
    );
    let largest = fit.terms.iter().skip(1).map(|term| term.coefficient_rad.abs()).fold(1e-12, f64::max);
    for term in fit.terms.iter().skip(1) {
        let part = 100.0 * term.coefficient_rad.abs() / largest;
        let colour = if term.coefficient_rad < 0.0 { "#1f5fa8" } else { "#d46a0c" };
        // Writing to a string cannot fail.
        let _ = write!(
            body,
            "<tr><td class=n>{}</td><td>{}</td><td class=n>{}</td><td class=n>{}</td><td><span class=bar \
             style=\"width:{part:.0}px;background:{colour}\"></span></td></tr>",
            term.index,
            term.name,
            signed(term.coefficient_rad),
            signed(term.coefficient_rad / TAU)
        );
    }
    body.push_str("</table>");
    chapter.array("zernike_noll_rad", &[fit.terms.len()], fit.terms.iter().map(|term| term.coefficient_rad));
    chapter.body = body;
    chapter
}

/// The value with three decimals and a typographic minus sign (−).
pub(super) fn signed(value: f64) -> String {
    format!("{value:+.3}").replace('-', "−")
}

fn spot(model: &DisplayModel, ratio: &(impl Fn(f64, f64) -> Complex64 + Sync)) -> Result<Chapter, ReportError> {
    let pitch_m = model.setup.grid().pixel_pitch_m();
    let (nyquist, pitch_um) = (0.5 / pitch_m, pitch_m * 1e6);
    let found = point_spread(|x, y| ratio(nyquist * x, nyquist * y));
    let canvas = spot_picture("Point spread function", &found, pitch_um);
    let mut chapter = Chapter { title: "Resolution", body: spot_table(&found, pitch_um), ..Chapter::default() };
    chapter.png("point_spread", "Point spread function, in decibels below its peak", &canvas)?;
    let per_mm = 1.0 / (pitch_m * 1000.0);
    let line = |label: &str, values: &[f64], dashed| Line {
        label: label.to_owned(),
        points: values.iter().enumerate().map(|(i, &v)| (per_mm * i as f64 / (values.len() - 1) as f64, v)).collect(),
        dashed,
    };
    let chart = Chart {
        title: "Modulation transfer function",
        x_label: "spatial frequency [1/mm]",
        y_label: "contrast",
        logarithmic: false,
        lines: vec![
            line("along x", &found.mtf[0], false),
            line("along y", &found.mtf[1], false),
            line("without aberrations", &[1.0, 0.0], true),
        ],
        band: Vec::new(),
    };
    chapter.svg("mtf", "Contrast of stripes, over their spatial frequency", chart.svg());
    let side = found.spot.width_px();
    chapter.array("point_spread", &[side, side], found.spot.values().iter().map(|&value| value.into()));
    chapter.array("mtf_x_y", &[2, found.mtf[0].len()], found.mtf.concat());
    Ok(chapter)
}

/// A picture of a spot, in decibels below its peak.
pub(super) fn spot_picture(title: &str, found: &PointSpread, pitch_um: f64) -> Canvas {
    let half_um = WINDOW_PX as f64 * pitch_um;
    let axis = |label| Axis { label, start: -half_um, end: half_um };
    let values = &found.spot.map(|value| 10.0 * value.max(1e-5).log10());
    let (x, y) = (axis("x [µm]"), axis("y [µm]"));
    Heatmap { title, values, colours: ColourMap::Sequential, range: (-40.0, 0.0), unit: "dB", x, y }.draw()
}

fn spot_table(found: &PointSpread, pitch_um: f64) -> String {
    let row = |name: &str, [x, y]: [f64; 2], unit: &str| {
        format!("<tr><td>{name}</td><td class=n>{x:.2}</td><td class=n>{y:.2}</td><td>{unit}</td></tr>")
    };
    let um = |px: [f64; 2]| px.map(|px| px * pitch_um);
    let per_mm = |cycles_px: [f64; 2]| cycles_px.map(|f| f * 1000.0 / pitch_um);
    format!(
        "<p>The image of a point through H / H<sub>ideal</sub>, with {OVERSAMPLING} samples per pixel of {pitch_um:.2} \
         µm. The Strehl ratio is <b>{:.3}</b>: the peak of the spot divided by the peak of an ideal spot with the same \
         light. Without aberrations the width would be {:.2} µm, and the contrast would be one half at {:.1} /mm.</p>\
         <table><tr><th></th><th class=n>x</th><th class=n>y</th><th></th></tr>{}{}{}{}\
         <tr><td>radius that contains half of the light</td><td class=n colspan=2>{:.2}</td><td>µm</td></tr>\
         <tr><td>radius that contains 80 % of the light</td><td class=n colspan=2>{:.2}</td><td>µm</td></tr></table>",
        found.strehl,
        0.886 * pitch_um,
        500.0 / pitch_um,
        row("full width at half maximum", um(found.fwhm_px), "µm"),
        row("displacement of the peak", um(found.shift_px), "µm"),
        row("contrast of at least one half up to", per_mm(found.mtf_50), "/mm"),
        row("contrast of at least one tenth up to", per_mm(found.mtf_10), "/mm"),
        found.radius_50_px * pitch_um,
        found.radius_80_px * pitch_um,
    )
}

fn source(model: &DisplayModel) -> Result<Chapter, ReportError> {
    let grid = model.setup.grid();
    let (columns, rows) = (SAMPLES, (SAMPLES * grid.height_px()).div_ceil(grid.width_px()).max(1));
    let at = |i: usize, n: usize| (2 * i + 1) as f64 / n as f64 - 1.0;
    let dust = |y: usize, x: usize| model.dust.factor(y * grid.height_px() / rows, x * grid.width_px() / columns);
    let value = |y: usize, x: usize| model.source.value(at(x, columns), at(y, rows)) * dust(y, x);
    let brightest =
        (0..rows * columns).map(|i| value(i / columns, i % columns).norm_sqr()).fold(f64::MIN_POSITIVE, f64::max);
    let intensity = Plane::from_fn(rows, columns, |y, x| (value(y, x).norm_sqr() / brightest) as f32);
    let phase = Plane::from_fn(rows, columns, |y, x| value(y, x).arg() as f32);
    let size_mm = |px: usize| px as f64 * grid.pixel_pitch_m() * 1000.0;
    let axis = |label, px| Axis { label, start: 0.0, end: size_mm(px) };
    let draw = |title, values, colours, range, unit| {
        let (x, y) = (axis("x [mm]", grid.width_px()), axis("y [mm]", grid.height_px()));
        Heatmap { title, values, colours, range, unit, x, y }.draw()
    };
    let sheet = Canvas::grid(&[vec![
        draw("source: intensity", &intensity, ColourMap::Sequential, (0.0, 1.0), ""),
        draw("source: phase", &phase, ColourMap::Cyclic, (0.0, 0.0), "rad"),
    ]]);
    let darkest = intensity.values().iter().copied().fold(1.0, f32::min);
    let mut chapter = Chapter {
        title: "Source",
        body: format!(
            "<p>The light on the modulator. The darkest position has {:.0} % of the light of the brightest one.</p>",
            100.0 * darkest
        ),
        ..Chapter::default()
    };
    chapter.png("source", "Light on the modulator", &sheet)?;
    chapter.array("source_intensity", &[rows, columns], intensity.values().iter().map(|&value| value.into()));
    chapter.array("source_phase_rad", &[rows, columns], phase.values().iter().map(|&value| value.into()));
    Ok(chapter)
}
