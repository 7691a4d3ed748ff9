//! Chapter about the kernel's aberrations over the distance, for models learned at several distances together.

use super::chapter::Chapter;
use super::input::ReportInput;
use crate::figures::{Chart, Line};
use lightpath_optics::diagnostics::ZernikeFit;
use lightpath_optics::learning::interpolated;
use lightpath_optics::{DisplayModel, KernelShape, OpticalSetup};

/// Number of steps from the nearest distance to the farthest.
const STEPS: usize = 24;
/// Number of aberrations in the chart. The chart shows those that change the most.
const LINES: usize = 5;
/// Number of samples along each side of the band for the fit of the aberrations.
const SAMPLES: usize = 48;
/// Number of omitted first terms: piston and tilts, which only move an image.
const OMITTED_TERMS: usize = 3;

/// The chapter. `None`: the kernel was learned at one distance.
pub(super) fn chapter(input: &ReportInput) -> Option<Chapter> {
    let along: Vec<(f64, ZernikeFit)> =
        (0..=STEPS).map(|step| at(&input.over_distance, step)).collect::<Option<_>>()?;
    let coefficient = |term: usize, fit: &ZernikeFit| fit.terms[term].coefficient_rad;
    let swing = |term: usize| {
        let values = along.iter().map(|(_, fit)| coefficient(term, fit));
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        high - low
    };
    let terms = along[0].1.terms.len();
    let mut changing: Vec<usize> = (OMITTED_TERMS..terms).collect();
    changing.sort_by(|&a, &b| swing(b).total_cmp(&swing(a)));
    let line = |term: usize| Line {
        label: along[0].1.terms[term].name.to_owned(),
        points: along.iter().map(|(distance_m, fit)| (1e3 * distance_m, coefficient(term, fit))).collect(),
        dashed: false,
    };
    let mut chapter = Chapter {
        title: "Over the distance",
        body: "<p>One model describes the display at all distances from the nearest to the farthest photographed one. \
               In this model, the difference between the optics and free space is a polynomial of the distance. The \
               chart shows the aberrations that change the most, as Zernike polynomials (Noll).</p>"
            .to_owned(),
        ..Chapter::default()
    };
    let chart = Chart {
        title: "Aberrations over the distance",
        x_label: "distance [mm]",
        y_label: "root mean square [rad]",
        logarithmic: false,
        lines: changing.iter().take(LINES).map(|&term| line(term)).collect(),
        band: Vec::new(),
    };
    chapter.svg("over-distance", "Aberrations that change the most with the distance", chart.svg());
    chapter.array("over_distance_m", &[STEPS + 1], along.iter().map(|(distance_m, _)| *distance_m));
    let coefficients = along.iter().flat_map(|(_, fit)| fit.terms.iter().map(|term| term.coefficient_rad));
    chapter.array("zernike_noll_over_distance_rad", &[STEPS + 1, terms], coefficients);
    Some(chapter)
}

/// Distance \[m\] and aberrations at step `step` of `STEPS`. `None`: the models are empty or cannot be interpolated.
fn at(models: &[DisplayModel], step: usize) -> Option<(f64, ZernikeFit)> {
    let (first, last) = (models.first()?, models.last()?);
    let (near_m, far_m) = (first.setup.distance_m(), last.setup.distance_m());
    let part = step as f64 / STEPS as f64;
    let distance_m = ((1.0 - part) * near_m + part * far_m).clamp(near_m, far_m);
    let setup = OpticalSetup::try_new(first.setup.grid(), first.setup.wavelength_m(), distance_m).ok()?;
    let KernelShape::Smooth(errors) = interpolated(models, setup).ok()?.kernel else { return None };
    let basis = errors.basis();
    Some((distance_m, ZernikeFit::of(|x, y| basis.value(&errors.phase, x, y), SAMPLES)?))
}
