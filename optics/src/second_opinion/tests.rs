use super::*;
use crate::RegionOfInterest;
use crate::display::{
    Crosstalk, Dust, FilterShape, FurtherMode, Ghost, LightBlur, OpticalSetup, OrderFilter, PartialCoherence,
    ResponseVariation, SpatialVariation,
};
use crate::engine::Engine;
use crate::error::Error;
use crate::hologram::{HologramMethod, HologramOptions, HologramProblem, Optimization, initial_phase};
use crate::numerics::{Grid, SmoothField};
use crate::pictures_of_tests::picture;
use crate::propagation::{ImageWindow, WarningCode};
use crate::propagation_method::ConvolutionMethod;
use crate::reference::{first_order_onto, rayleigh_sommerfeld_onto};
use num_complex::{Complex32, Complex64};

fn setup(height_px: usize, width_px: usize, distance_m: f64) -> OpticalSetup {
    OpticalSetup::try_new(Grid::try_new(height_px, width_px, 8e-6).unwrap(), 515e-9, distance_m).unwrap()
}

/// Light of the model on all rows, at the given places in each pixel.
fn light(model: &DisplayModel, phase: &Plane<f32>, places: &Places) -> Vec<Plane<f64>> {
    steered_light((model, None), phase, places)
}

fn steered_light(
    (model, carrier): (&DisplayModel, Option<Carrier>),
    phase: &Plane<f32>,
    places: &Places,
) -> Vec<Plane<f64>> {
    let rows: Vec<usize> = (0..model.setup.grid().height_px()).collect();
    model::light(
        (model, carrier),
        std::slice::from_ref(phase),
        places,
        &rows,
        &Frequencies::of(&model.setup, matches!(model.kernel, KernelShape::Bins(_))),
    )
}

/// Root mean square of the difference of two lights, relative to the mean light.
fn difference(found: &Plane<f64>, expected: &Plane<f64>) -> f64 {
    let squared: f64 = found.values().iter().zip(expected.values()).map(|(a, b)| (a - b).powi(2)).sum();
    let mean = expected.values().iter().sum::<f64>() / expected.values().len() as f64;
    (squared / expected.values().len() as f64).sqrt() / mean
}

/// The window of the display's pixels, moved by a place in each pixel.
fn window_at(setup: &OpticalSetup, x_px: f64, y_px: f64) -> ImageWindow {
    let pitch_m = setup.grid().pixel_pitch_m();
    ImageWindow::of(&setup.grid()).centred_at(x_px * pitch_m, y_px * pitch_m).unwrap()
}

#[test]
fn first_order_matches_direct_integral() {
    let places = Places { along_x: vec![-0.3, 0.1], along_y: vec![0.0, 0.4] };
    // The critical distances are 6 mm along y and 8 mm along x.
    for distance_m in [0.1e-3, 1e-3, 7e-3, 30e-3, -5e-3] {
        let setup = setup(24, 32, distance_m);
        let phase = initial_phase(24, 32, 6.0, 3).unwrap();
        let field = phase.map(|phi| Complex64::cis(f64::from(phi)));
        for (i, light) in light(&DisplayModel::ideal(setup), &phase, &places).iter().enumerate() {
            let window = window_at(&setup, places.along_x[i % 2], places.along_y[i / 2]);
            let expected = first_order_onto(&setup, &field, &window).unwrap().map(|u| u.norm_sqr());
            let difference = difference(light, &expected);
            assert!(difference < 1e-9, "{distance_m} m, place {i}: {difference:e}");
        }
    }
}

#[test]
fn all_orders_match_direct_sum_over_each_pixel() {
    /// Points along each side of a pixel; 3/4 and 1/2 of them are whole numbers.
    const POINTS: usize = 64;
    let places = Places { along_x: vec![-0.3, 0.2], along_y: vec![0.0, 0.4] };
    let [fill_factor_x, fill_factor_y] = [0.75, 0.5];
    let phase = initial_phase(4, 6, 6.0, 3).unwrap();
    let inside = |i: usize, fill: f64| (((i % POINTS) as f64 + 0.5) / POINTS as f64 - 0.5).abs() < fill / 2.0;
    let field = Plane::from_fn(4 * POINTS, 6 * POINTS, |y, x| {
        let is_bright = inside(y, fill_factor_y) && inside(x, fill_factor_x);
        if is_bright { Complex64::cis(f64::from(phase.at(y / POINTS, x / POINTS))) } else { Complex64::ZERO }
    });
    let fine = Grid::try_new(4 * POINTS, 6 * POINTS, 8e-6 / POINTS as f64).unwrap();
    // Nearer, the judge's points are too far apart.
    for distance_m in [0.2e-3, 0.6e-3, 2e-3, 10e-3] {
        let orders = Orders::All { fill_factor_x, fill_factor_y };
        let setup = setup(4, 6, distance_m).with_orders(orders).unwrap();
        let fine = OpticalSetup::try_new(fine, 515e-9, distance_m).unwrap();
        for (i, light) in light(&DisplayModel::ideal(setup), &phase, &places).iter().enumerate() {
            let window = window_at(&setup, places.along_x[i % 2], places.along_y[i / 2]);
            let expected = rayleigh_sommerfeld_onto(&fine, &field, &window).unwrap().map(|u| u.norm_sqr());
            let bright = (fill_factor_x * fill_factor_y).powi(2);
            let difference = difference(&light.map(|light| light * bright), &expected);
            assert!(difference < 2e-3, "{distance_m} m, place {i}: {difference:e}");
        }
    }
}

/// A slit that is not in the middle.
const FILTERED: Orders = Orders::Filtered(OrderFilter {
    shape: FilterShape::Rectangle,
    width: 0.8,
    height: 0.5,
    centre_x: 0.0,
    centre_y: 0.2,
});

/// Dust of a contrast of some tenths.
fn dusty(height_px: usize, width_px: usize) -> Dust {
    Dust::new(Plane::from_fn(height_px, width_px, |y, x| {
        [(y * 7919 + x * 104_729) % 4001, (y * 31 + x * 17) % 3001].map(|n| n as i16 - 2000)
    }))
}

/// A display with every error that has a second opinion.
fn flawed(setup: OpticalSetup) -> DisplayModel {
    let wavy = |order: usize, size: f64| {
        let mut field = SmoothField::flat(order);
        field.log_amplitude.iter_mut().enumerate().for_each(|(i, c)| *c = size * (i as f64).sin());
        field.phase.iter_mut().enumerate().for_each(|(i, c)| *c = 3.0 * size * (i as f64).cos());
        field
    };
    DisplayModel {
        kernel: KernelShape::Smooth(wavy(4, 0.1)),
        beyond: if setup.orders().are_all() { wavy(2, 0.2) } else { SmoothField::flat(0) },
        ghost: Ghost { amplitude: Complex64::new(0.1, -0.07), shift_px: [4.3, -2.2], defocus_rad: 3.0 },
        coherence: PartialCoherence::new(vec![
            FurtherMode { light: 0.7, errors: wavy(2, 0.1) },
            FurtherMode { light: 0.3, errors: wavy(1, -0.2) },
        ]),
        source: wavy(2, 0.2),
        dust: dusty(setup.grid().height_px(), setup.grid().width_px()),
        response: vec![[0.15, -0.05], [0.02, 0.03]],
        zero_order: Complex64::new(0.1, -0.05),
        response_variation: ResponseVariation { order: 1, coefficients: vec![0.05, -0.03, 0.08] },
        crosstalk: Crosstalk::of_sigma_px([0.45, 0.3]),
        light_blur: LightBlur::of_sigma_px([0.8, 0.5]),
        ..DisplayModel::ideal(setup)
    }
}

#[test]
fn learned_display_matches_the_engine() {
    for (orders, distance_m, carrier, within) in [
        (Orders::First, 0.2e-3, None, 1e-4),
        (Orders::First, 5e-3, Some(Carrier::HalfOrderX), 1e-4),
        (Orders::First, 20e-3, Some(Carrier::HalfOrderY), 1e-4),
        (FILTERED, 0.2e-3, Some(Carrier::HalfOrderX), 1e-4),
        (FILTERED, 20e-3, None, 1e-4),
        // The engine samples the errors on a padded frame, in which a little light comes back. Here hardly any leaves
        // it.
        (Orders::SQUARE, 0.2e-3, None, 2e-2),
        // What comes back of the orders' differences falls on the image's rim.
        (Orders::SQUARE, 1e-3, None, 0.1),
    ] {
        let (setup, _) = setup(16, 24, distance_m).with_orders(orders).unwrap().planned().unwrap();
        let model = flawed(setup);
        let phase = Plane::from_fn(16, 24, |y, x| (0.2 * x as f32).sin() + (0.3 * y as f32).cos());
        let engine = Engine::new(&model, Detector::Pixel, carrier).unwrap();
        let shown = ShownLight::of_frames(&engine, std::slice::from_ref(&phase)).unwrap();
        // The places of both detectors at once: the judge's sum over all orders takes as long for one place.
        let all = Places { along_x: vec![-0.25, 0.0, 0.25], along_y: vec![-0.25, 0.0, 0.25] };
        let found = steered_light((&model, carrier), &phase, &all);
        for detector in [Detector::Point, Detector::Supersampled] {
            let (places, seen) = (places(&model, detector).0, shown.seen_by(detector));
            let down = places.along_y.len();
            for (i, &y_px) in places.along_y.iter().enumerate() {
                for (j, &x_px) in places.along_x.iter().enumerate() {
                    let expected = Plane::from_fn(16, 24, |y, x| f64::from(seen.at(down * y + i, down * x + j)));
                    let at = |along: &[f64], place: f64| along.iter().position(|&other| other == place).unwrap();
                    let found = &found[at(&all.along_y, y_px) * all.along_x.len() + at(&all.along_x, x_px)];
                    let difference = difference(found, &expected);
                    assert!(difference < within, "{orders:?}, {distance_m} m, {x_px}, {y_px} px: {difference:e}");
                }
            }
        }
    }
}

/// A hologram of a setup, and the second opinion on it.
fn judged(setup: OpticalSetup, detector: Detector, effort: Effort) -> SecondOpinion {
    let (grid, model) = (setup.grid(), DisplayModel::ideal(setup));
    let target = picture(grid.height_px(), grid.width_px(), 3);
    let region = RegionOfInterest::middle(&grid);
    let engine = Engine::new(&model, detector, None).unwrap();
    let problem = HologramProblem::new(engine.clone(), target.clone(), region).unwrap();
    let start = initial_phase(grid.height_px(), grid.width_px(), 0.5, 4).unwrap().into_vec();
    let mut optimization =
        Optimization::start(problem, HologramOptions::new(HologramMethod::Lbfgs, 30), start).unwrap();
    while optimization.step().is_some() {}
    let phase = Plane::try_from_vec(grid.height_px(), grid.width_px(), optimization.phases().to_vec()).unwrap();
    let shown = ShownLight::of_frames(&engine, std::slice::from_ref(&phase)).unwrap();
    let found = SecondOpinion::of((&model, None), &[phase], &shown, detector, (&target, region).into(), effort)
        .unwrap()
        .unwrap();
    if effort == Effort::THOROUGH {
        // All rows of the region were compared, as in the reported quality.
        let reported = match detector {
            Detector::Point => shown.quality((&target, region).into()).unwrap().point,
            Detector::Pixel => shown.quality((&target, region).into()).unwrap().pixel,
            Detector::Supersampled => shown.quality((&target, region).into()).unwrap().supersampled,
        };
        assert_eq!(found.rows as usize, region.height_px());
        assert!((found.engine_psnr_db - reported.psnr_db).abs() < 1e-3, "{found:?} {reported:?}");
    }
    found
}

#[test]
fn opinions_agree_at_every_distance_and_detector() {
    // The critical distances are 12 mm along y and 18 mm along x.
    for distance_m in [1e-3, 6e-3, 15e-3, 50e-3] {
        for orders in [Orders::First, FILTERED, Orders::SQUARE] {
            // At a tenth of the critical distance the pixels of all orders have details that four samples miss.
            if orders.are_all() && distance_m < 3e-3 {
                continue;
            }
            let (setup, _) = setup(48, 72, distance_m).with_orders(orders).unwrap().planned().unwrap();
            let of_small_camera_pixels = (setup.with_camera_fill_factor(0.6).unwrap(), Detector::Pixel);
            let cases = Detector::ALL.map(|detector| (setup, detector)).into_iter().chain([of_small_camera_pixels]);
            for (setup, detector) in cases {
                let found = judged(setup, detector, Effort::THOROUGH);
                let difference = found.difference_db();
                let within = if found.engine_psnr_db <= 40.0 { 0.3 } else { 0.5 };
                assert!(difference.abs() < within, "{setup:?}, {detector:?}: {found:?}");
            }
        }
    }
}

#[test]
fn methods_that_wrap_around_are_contradicted() {
    // Between the critical distances of the two axes.
    let between = setup(48, 72, 15e-3);
    let wrapped = between.with_method_regardless(ConvolutionMethod::AngularSpectrum);
    let found = judged(wrapped, Detector::Pixel, Effort::CHEAP);
    assert!(found.is_contradiction() && found.difference_db() < 0.0, "{found:?}");
    assert_eq!(found.rows, 8);
    let (right, _) = between.planned().unwrap();
    let found = judged(right, Detector::Pixel, Effort::CHEAP);
    assert!(!found.is_contradiction(), "{found:?}");
}

/// Fields of a kernel that changes over the SLM by some tenths.
fn variation() -> SpatialVariation {
    SpatialVariation::new(std::array::from_fn(|power| {
        let mut field = SmoothField::flat(3);
        field.log_amplitude.iter_mut().enumerate().for_each(|(i, c)| *c = 0.03 * ((i + power) as f64).sin());
        field.phase.iter_mut().enumerate().for_each(|(i, c)| *c = 0.15 * ((i + 2 * power) as f64).cos());
        field
    }))
}

#[test]
fn kernel_that_varies_over_the_modulator_matches_the_engine() {
    // Hardly any light leaves the frame, on which the engine samples such kernels. It interpolates between nine kernels.
    let (setup, report) = setup(40, 56, 0.2e-3).planned().unwrap();
    let uniform = flawed(setup);
    let model = DisplayModel { variation: variation(), ..uniform.clone() };
    let phase = Plane::from_fn(40, 56, |y, x| (0.2 * x as f32).sin() + (0.3 * y as f32).cos());
    let engine = Engine::new(&model, Detector::Point, None).unwrap();
    let expected = engine.samples(&phase).unwrap().map(f64::from);
    let places = Places { along_x: vec![0.0], along_y: vec![0.0] };
    let difference_to = |model: &DisplayModel| difference(&light(model, &phase, &places)[0], &expected);
    let (with, without) = (difference_to(&model), difference_to(&uniform));
    let warned = |model: &DisplayModel| {
        let codes = report.clone().through_kernel_of(model).warnings.into_iter().map(|warning| warning.code);
        codes.collect::<Vec<_>>()
    };
    assert_eq!((warned(&model), warned(&uniform)), (vec![WarningCode::KernelWrapAround], vec![]));
    assert!(with < 2e-2 && without > 5.0 * with, "{with:e}, with the same kernel everywhere {without:e}");
}

#[test]
fn kernel_with_a_value_for_each_frequency_matches_the_engine() {
    for (distance_m, orders) in [(0.2e-3, Orders::First), (20e-3, Orders::First), (20e-3, FILTERED)] {
        let (setup, _) = setup(30, 40, distance_m).with_orders(orders).unwrap().planned().unwrap();
        let smooth = flawed(setup);
        let sampled = smooth.sampled();
        let frequency = |i: usize, bins: usize| (i as f64 - bins as f64 / 2.0) / (bins as f64 * 8e-6);
        // Its values between two frequencies follow from no formula.
        let random = initial_phase(60, 80, 0.3, 5).unwrap();
        let bins = Plane::from_fn(60, 80, |y, x| {
            let h = sampled(frequency(x, 80), frequency(y, 60)) * Complex64::cis(f64::from(random.at(y, x)));
            Complex32::new(h.re as f32, h.im as f32)
        });
        let kernel = KernelShape::Bins(bins);
        let model = DisplayModel { kernel, ghost: Ghost::NONE, coherence: PartialCoherence::none(), ..smooth.clone() };
        let phase = initial_phase(30, 40, 6.0, 3).unwrap();
        let engine = Engine::new(&model, Detector::Point, None).unwrap();
        let expected = engine.samples(&phase).unwrap().map(f64::from);
        let places = Places { along_x: vec![0.0], along_y: vec![0.0] };
        let difference = difference(&light(&model, &phase, &places)[0], &expected);
        assert!(difference < 1e-4, "{distance_m} m, {orders:?}: {difference:e}");
    }
}

#[test]
fn displays_beyond_the_effort_have_no_opinion() {
    let size = |setup: &OpticalSetup, has_bins, per_side| OpinionSize::of(setup, has_bins, per_side, 1);
    let setup = setup(24, 32, 1e-3);
    let uniform = size(&setup, false, 1).unwrap().values;
    assert!(uniform > 0 && size(&setup, true, 1).unwrap().values >= 3 * uniform);
    assert_eq!(size(&setup, false, 3).unwrap().values, 25 * uniform);
    let huge = OpticalSetup::try_new(Grid::try_new(8192, 8192, 4e-6).unwrap(), 515e-9, 5.0).unwrap();
    assert_eq!(size(&huge, false, 1), None);
    // Only the number of frequencies is computed here; their nodes would take hours.
    let far = OpticalSetup::try_new(Grid::try_new(64, 64, 1e-6).unwrap(), 1e-6, 10.0).unwrap();
    assert_eq!(size(&far, false, 1), None);
    let (phase, region) = (Plane::filled(24, 32, 0.0), RegionOfInterest::full(&setup.grid()));
    let ideal = DisplayModel::ideal(setup);
    let engine = Engine::new(&ideal, Detector::Pixel, None).unwrap();
    let shown = ShownLight::of_frames(&engine, std::slice::from_ref(&phase)).unwrap();
    let wanted = (&Plane::filled(24, 30, 0.5), region);
    let refused = SecondOpinion::of((&ideal, None), &[phase], &shown, Detector::Pixel, wanted.into(), Effort::CHEAP);
    assert!(matches!(refused, Err(Error::SizeMismatch { .. })), "{refused:?}");
}
