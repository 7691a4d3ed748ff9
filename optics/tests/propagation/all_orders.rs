//! All diffraction orders of rectangular pixels, against the direct sum over points within the pixels.

use super::fields::{WAVELENGTH_M, noise, relative_l2};
use crate::engine::EngineCore;
use crate::propagation::{ImageWindow, PropagationMethod, RefusalCode, plan};
use crate::reference::rayleigh_sommerfeld_onto;
use crate::{ConvolutionMethod, Detector, DisplayModel, Error, Grid, OpticalSetup, Orders, Plane};
use num_complex::Complex64;

/// Points along a side of a pixel in the direct sum.
const POINTS: usize = 96;

/// The field in a window by the direct sum over POINTS×POINTS points of each pixel. Points beyond the bright area are
/// dark.
fn summed(setup: &OpticalSetup, field: &Plane<Complex64>, window: &ImageWindow) -> Plane<Complex64> {
    let (grid, [fill_x, fill_y]) = (setup.grid(), setup.fill_factor());
    let fine = Grid::try_new(POINTS * grid.height_px(), POINTS * grid.width_px(), grid.pixel_pitch_m() / POINTS as f64);
    let points = OpticalSetup::try_new(fine.unwrap(), setup.wavelength_m(), setup.distance_m()).unwrap();
    let is_bright = |i: usize, fill: f64| {
        ((i % POINTS) as f64 + 0.5) / POINTS as f64 - 0.5 < 0.5 * fill
            && 0.5 - ((i % POINTS) as f64 + 0.5) / (POINTS as f64) < 0.5 * fill
    };
    let source = Plane::from_fn(POINTS * grid.height_px(), POINTS * grid.width_px(), |y, x| {
        let value = field.at(y / POINTS, x / POINTS);
        if is_bright(y, fill_y) && is_bright(x, fill_x) { value / (fill_x * fill_y).sqrt() } else { Complex64::ZERO }
    });
    rayleigh_sommerfeld_onto(&points, &source, window).unwrap()
}

fn setup(height_px: usize, width_px: usize, distance_m: f64, orders: Orders) -> OpticalSetup {
    let grid = Grid::try_new(height_px, width_px, 8e-6).unwrap();
    OpticalSetup::try_new(grid, WAVELENGTH_M, distance_m).unwrap().with_orders(orders).unwrap()
}

#[test]
fn field_matches_the_direct_sum_at_every_distance() {
    // The critical distances of 6×8 px are 1.5 mm along y and 2 mm along x. Fill factors are whole points.
    let gaps = Orders::All { fill_factor_x: 0.875, fill_factor_y: 0.75 };
    for (distance_m, orders) in
        [(0.2e-3, Orders::SQUARE), (1e-3, gaps), (-1.7e-3, Orders::SQUARE), (10e-3, Orders::SQUARE), (0.1, gaps)]
    {
        let setup = setup(6, 8, distance_m, orders);
        let field = noise(6, 8, 5);
        let expected = summed(&setup, &field, &setup.window());
        let engine = EngineCore::<f64>::new(&DisplayModel::ideal(setup), Detector::Pixel, None).unwrap();
        let error = relative_l2(&engine.propagate(&field).unwrap(), &expected);
        assert!(error < 1e-3, "{distance_m} m: {error:e}");
    }
}

#[test]
fn samples_within_a_pixel_match_the_direct_sum() {
    let setup = setup(6, 8, 0.8e-3, Orders::SQUARE);
    let phase = noise(6, 8, 9).map(|u| 3.0 * u.re);
    let field = phase.map(Complex64::cis);
    let engine = EngineCore::<f64>::new(&DisplayModel::ideal(setup), Detector::Supersampled, None).unwrap();
    let samples = engine.samples(&phase).unwrap();
    for (dy, dx) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let offset_m = |d: usize| if d == 0 { -2e-6 } else { 2e-6 };
        let window = setup.window().centred_at(offset_m(dx), offset_m(dy)).unwrap();
        let expected = summed(&setup, &field, &window);
        for (y, x) in (0..6).flat_map(|y| (0..8).map(move |x| (y, x))) {
            let (found, expected) = (samples.at(2 * y + dy, 2 * x + dx), expected.at(y, x).norm_sqr());
            assert!((found - expected).abs() < 1e-3, "{y} {x} + {dy} {dx}: {found} {expected}");
        }
    }
}

#[test]
fn planner_follows_the_orders_of_the_display() {
    let all = setup(64, 96, 5e-3, Orders::SQUARE);
    let report = plan(&all).unwrap();
    assert_eq!((report.method, all.method()), (PropagationMethod::AllOrders, ConvolutionMethod::AllOrders));
    assert!(report.explanation.contains("322 µm apart"), "{}", report.explanation);
    let refused = |setup: OpticalSetup, method| match setup.with_method(method) {
        Err(Error::Unsuitable { code, reason, .. }) => (code, reason),
        other => panic!("{other:?}"),
    };
    let (code, reason) = refused(all, ConvolutionMethod::BandResponse);
    assert!(code == RefusalCode::OtherOrders && reason.contains("shows all orders"), "{reason}");
    let first = all.with_orders(Orders::First).unwrap();
    let (code, reason) = refused(first, ConvolutionMethod::AllOrders);
    assert!(code == RefusalCode::OtherOrders && reason.contains("computes all orders"), "{reason}");
    let near = setup(64, 96, 10e-6, Orders::SQUARE).with_method(ConvolutionMethod::AllOrders).unwrap_err();
    assert!(near.to_string().contains("shadow of the pixels"), "{near}");
    let wide = Orders::All { fill_factor_x: 1.1, fill_factor_y: 1.0 };
    assert!(first.with_orders(wide).unwrap_err().to_string().starts_with("fill_factor_x is 1.1"));
}
