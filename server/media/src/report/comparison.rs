//! Comparison of two versions: numbers and pictures of what differs.

use super::chapter::ReportError;
use super::input::KernelDifference;
use super::optics::{SAMPLES, band, heat, ratio};
use crate::figures::{Axis, Canvas, ColourMap, Heatmap};
use crate::pictures::PictureError;
use lightpath_optics::learning::{ModelPart, PartStrength};
use lightpath_optics::{DisplayModel, Plane};
use num_complex::Complex64;
use std::f64::consts::PI;

/// What differs between two models of one display.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// Difference of the transfer functions, each relative to the ideal one of its distance.
    pub transfer: KernelDifference,
    /// Difference of the light on the modulator.
    pub source: KernelDifference,
    /// The parts that either model has, and how strong they are in both; `None`: the model is without this part.
    pub parts: Vec<(ModelPart, [Option<PartStrength>; 2])>,
    /// The gain of the camera in both.
    pub gains: [f64; 2],
    /// The ratio of the transfer functions and the sources, as PNG.
    pub picture_png: Vec<u8>,
}

/// Compares two models of one display. The picture calls them by these names.
///
/// # Errors
///
/// [`ReportError`] if the picture cannot be written.
pub fn comparison(models: [&DisplayModel; 2], names: [&str; 2]) -> Result<Comparison, ReportError> {
    let [first, second] = models;
    let nyquist = 0.5 / first.setup.grid().pixel_pitch_m();
    let (h, g) = (ratio(first), ratio(second));
    let of_band = |(x, y): (f64, f64)| (h(nyquist * x, nyquist * y), g(nyquist * x, nyquist * y));
    let of_source = |(x, y): (f64, f64)| (light(first, x, y), light(second, x, y));
    let (transfer, turn) = KernelDifference::of(samples().map(of_band));
    let (source, _) = KernelDifference::of(samples().map(of_source));
    let between = quotient(h, g, turn);
    let picture_png = sheet(models, names, between).png().map_err(|error| PictureError::Encode(error.to_string()))?;
    let gains = models.map(|model| model.gain);
    Ok(Comparison { transfer, source, parts: parts(models), gains, picture_png })
}

/// Points of a grid from −1 to 1 along each axis.
fn samples() -> impl Iterator<Item = (f64, f64)> {
    let along = |i: usize| (2 * i + 1) as f64 / SAMPLES as f64 - 1.0;
    (0..SAMPLES * SAMPLES).map(move |i| (along(i % SAMPLES), along(i / SAMPLES)))
}

/// The quotient g / h of two transfer functions, with the phase of the best factor `turn` on g: a constant phase shows
/// nothing. Its amplitude stays, so that an equal amplitude is 1 everywhere. NaN where h passes no light.
fn quotient(
    h: impl Fn(f64, f64) -> Complex64,
    g: impl Fn(f64, f64) -> Complex64,
    turn: Complex64,
) -> impl Fn(f64, f64) -> Complex64 {
    let turn = Complex64::cis(turn.arg());
    move |fx, fy| {
        let (h, g) = (h(fx, fy), turn * g(fx, fy));
        if h.norm() > 1e-6 { g / h } else { Complex64::new(f64::NAN, f64::NAN) }
    }
}

/// The light on the modulator at −1 to 1 along each axis, with its dust.
fn light(model: &DisplayModel, x: f64, y: f64) -> Complex64 {
    let grid = model.setup.grid();
    let pixel = |position: f64, side: usize| (((position + 1.0) / 2.0 * side as f64) as usize).min(side - 1);
    model.source.value(x, y) * model.dust.factor(pixel(y, grid.height_px()), pixel(x, grid.width_px()))
}

fn sheet(models: [&DisplayModel; 2], names: [&str; 2], between: impl Fn(f64, f64) -> Complex64) -> Canvas {
    let [first, second] = names;
    let nyquist = 0.5 / models[0].setup.grid().pixel_pitch_m();
    let per_mm = nyquist / 1000.0;
    let amplitude = band(nyquist, |fx, fy| between(fx, fy).norm());
    let phase = band(nyquist, |fx, fy| between(fx, fy).arg());
    let title = |of: &str| format!("{of}: {second} / {first}");
    let gain = deviation(&amplitude);
    let ratios = vec![
        heat(&title("H, amplitude"), &amplitude, ColourMap::Diverging, (1.0 - gain, 1.0 + gain), per_mm, ""),
        heat(&title("H, phase"), &phase, ColourMap::Cyclic, (-PI as f32, PI as f32), per_mm, "rad"),
    ];
    let sources: Vec<Plane<f32>> = models.iter().map(|model| source_amplitude(model)).collect();
    if models.iter().all(|model| model.source.is_flat() && model.dust.is_none()) {
        return Canvas::grid(&[ratios]);
    }
    let top = sources.iter().flat_map(|plane| plane.values()).copied().fold(f32::MIN_POSITIVE, f32::max);
    let light = |(name, values): (&str, &Plane<f32>)| {
        light_picture(models[0], &format!("light on the modulator: {name}"), values, top)
    };
    Canvas::grid(&[ratios, names.into_iter().zip(&sources).map(light).collect()])
}

/// Largest deviation from 1 that nearly all of these ratios have, so that a single one does not pale the others; at least
/// 0.01, at most 1.
fn deviation(ratios: &Plane<f32>) -> f32 {
    let finite = ratios.values().iter().filter(|ratio| ratio.is_finite());
    let mut deviations: Vec<f32> = finite.map(|ratio| (ratio - 1.0).abs()).collect();
    deviations.sort_by(f32::total_cmp);
    deviations.get(deviations.len() * 49 / 50).copied().unwrap_or(0.0).clamp(0.01, 1.0)
}

fn source_amplitude(model: &DisplayModel) -> Plane<f32> {
    let grid = model.setup.grid();
    let longest = grid.height_px().max(grid.width_px());
    let side = |px: usize| (px * SAMPLES / longest).max(1);
    let (rows, columns) = (side(grid.height_px()), side(grid.width_px()));
    let position = |i: usize, side: usize| (2 * i + 1) as f64 / side as f64 - 1.0;
    Plane::from_fn(rows, columns, |y, x| light(model, position(x, columns), position(y, rows)).norm() as f32)
}

fn light_picture(model: &DisplayModel, title: &str, values: &Plane<f32>, top: f32) -> Canvas {
    let grid = model.setup.grid();
    let half_mm = |px: usize| px as f64 * grid.pixel_pitch_m() * 500.0;
    let axis = |label, half: f64| Axis { label, start: -half, end: half };
    let (x, y) = (axis("x [mm]", half_mm(grid.width_px())), axis("y [mm]", half_mm(grid.height_px())));
    Heatmap { title, values, colours: ColourMap::Sequential, range: (0.0, top), unit: "", x, y }.draw()
}

/// The parts that either model has, in the order of the engine's table.
fn parts(models: [&DisplayModel; 2]) -> Vec<(ModelPart, [Option<PartStrength>; 2])> {
    let [first, second] = models.map(PartStrength::present_in);
    let of = |strengths: &[PartStrength], part| strengths.iter().find(|strength| strength.part == part).cloned();
    let both = ModelPart::ALL.iter().map(|&part| (part, [of(&first, part), of(&second, part)]));
    both.filter(|(_, strengths)| strengths.iter().any(Option::is_some)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_optics::{Grid, KernelShape, OpticalSetup, SmoothField};

    #[test]
    fn a_tilt_of_the_kernel_and_a_gain_of_the_source_are_told_apart() {
        let setup = OpticalSetup::try_new(Grid::try_new(32, 48, 8e-6).unwrap(), 515e-9, 3e-3).unwrap();
        let first = DisplayModel::ideal(setup);
        let mut errors = SmoothField::flat(1);
        errors.phase[0] = 0.1;
        let mut source = SmoothField::flat(1);
        source.log_amplitude[0] = 0.2;
        let second = DisplayModel { kernel: KernelShape::Smooth(errors), source, ..first.clone() };
        let same = comparison([&first, &first], ["version 1", "version 1"]).unwrap();
        assert!(same.transfer.relative < 1e-9 && same.source.relative < 1e-9);
        let found = comparison([&first, &second], ["version 1", "version 2"]).unwrap();
        // A tilt of ±0.1 rad has an rms of 0.1/√3, and a slope of ±0.2 of the logarithm changes no phase.
        assert!((found.transfer.phase_rad - 0.1 / 3.0_f64.sqrt()).abs() < 1e-3, "{:?}", found.transfer);
        assert!(found.source.phase_rad < 1e-6 && (found.source.relative - 0.2 / 3.0_f64.sqrt()).abs() < 0.01);
        let present: Vec<_> = found.parts.iter().map(|(part, [a, b])| (*part, a.is_some(), b.is_some())).collect();
        assert_eq!(present, [(ModelPart::TransferFunction, false, true), (ModelPart::Source, false, true)]);
        let degree = found.parts[0].1[1].as_ref().unwrap();
        assert_eq!((degree.measures[0].value, degree.text(2).as_str()), (Some(1.0), "errors up to degree 1"));
        assert!(found.picture_png.starts_with(b"\x89PNG"));
        // The best factor for a tilt is smaller than 1, but the picture shows the same amplitude.
        let between = quotient(ratio(&first), ratio(&second), Complex64::from_polar(0.998, 0.3));
        let (amplitude, middle) = (between(2e4, -1e4).norm(), between(0.0, 0.0).arg());
        assert!((amplitude - 1.0).abs() < 1e-9 && (middle - 0.3).abs() < 1e-9, "{amplitude} {middle}");
    }
}
