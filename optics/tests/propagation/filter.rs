//! Filters that pass a part of the first order, against the direct integral over the frequencies that they pass.

use super::fields::{noise, relative_l2, setup};
use crate::engine::EngineCore;
use crate::hologram::{HologramMethod, HologramOptions, initial_phase, quality};
use crate::pictures_of_tests::picture;
use crate::propagation::{PropagationMethod, RefusalCode, plan};
use crate::reference::first_order_onto;
use crate::{
    Carrier, ConvolutionMethod, Detector, DisplayModel, Engine, Error, FilterShape, HologramProblem, OpticalSetup,
    Optimization, OrderFilter, Orders, Plane, RegionOfInterest,
};
use num_complex::Complex64;
use std::f64::consts::TAU;

fn filtered(setup: OpticalSetup, filter: OrderFilter) -> OpticalSetup {
    setup.with_orders(Orders::Filtered(filter)).unwrap().planned().unwrap().0
}

#[test]
fn field_matches_the_integral_at_every_distance() {
    // The critical distances of 16×24 px are 4 mm along y and 6 mm along x.
    let slit = OrderFilter { centre_y: -0.2, ..OrderFilter::rectangle(1.0, 0.5) };
    let iris = OrderFilter { shape: FilterShape::Ellipse, centre_x: 0.1, ..OrderFilter::rectangle(0.7, 0.9) };
    for (distance_m, filter) in [(0.5e-3, slit), (5e-3, iris), (-5e-3, slit), (20e-3, iris), (-15e-3, slit)] {
        let setup = filtered(setup(16, 24, distance_m), filter);
        let field = noise(16, 24, 5);
        let expected = first_order_onto(&setup, &field, &setup.window()).unwrap();
        let engine = EngineCore::<f64>::new(&DisplayModel::ideal(setup), Detector::Point, None).unwrap();
        let error = relative_l2(&engine.propagate(&field).unwrap(), &expected);
        assert!(error < 1e-3, "{distance_m} m, {filter:?}: {error:e}");
    }
}

#[test]
fn waves_pass_only_through_the_opening() {
    let filter = OrderFilter { centre_x: 0.25, ..OrderFilter::rectangle(0.5, 1.0) };
    let setup = filtered(setup(64, 200, 1e-3), filter);
    let engine = EngineCore::<f64>::new(&DisplayModel::ideal(setup), Detector::Point, None).unwrap();
    let light = |nu: f64| {
        let wave = Plane::from_fn(64, 200, |_, x| Complex64::cis(TAU * nu * x as f64));
        engine.propagate(&wave).unwrap().at(32, 100).norm_sqr()
    };
    for (nu, passed) in [(0.25, 1.0), (0.1, 1.0), (0.4, 1.0), (-0.1, 0.0), (-0.3, 0.0)] {
        assert!((light(nu) - passed).abs() < 0.05, "{nu} cycles per pixel: {}", light(nu));
    }
}

#[test]
fn half_order_filter_removes_the_undiffracted_light_of_a_carrier() {
    let ideal = DisplayModel::ideal(filtered(setup(60, 80, 10e-3), OrderFilter::rectangle(1.0, 0.5)));
    let whole = DisplayModel::ideal(setup(60, 80, 10e-3).planned().unwrap().0);
    let phase = initial_phase(60, 80, 1.0, 3).unwrap();
    let lights = |model: &DisplayModel| {
        [Complex64::ZERO, Complex64::new(0.3, 0.0)].map(|zero_order| {
            let model = DisplayModel { zero_order, ..model.clone() };
            Engine::new(&model, Detector::Point, Some(Carrier::HalfOrderY)).unwrap().light(&phase).unwrap()
        })
    };
    let changed = |[without, with]: [Plane<f32>; 2]| {
        let middle = (20..40).flat_map(|y| (20..60).map(move |x| (y, x)));
        middle.map(|(y, x)| (without.at(y, x) - with.at(y, x)).abs()).fold(0.0, f32::max)
    };
    let (through, beside) = (changed(lights(&ideal)), changed(lights(&whole)));
    assert!(through < 0.03 && beside > 0.3, "behind the filter {through}, without it {beside}");
}

#[test]
fn holograms_are_optimized_through_the_filter() {
    let (grid, region) = (setup(90, 120, 8e-3).grid(), RegionOfInterest::middle(&setup(90, 120, 8e-3).grid()));
    let target = picture(90, 120, 3);
    let first = DisplayModel::ideal(setup(90, 120, 8e-3).planned().unwrap().0);
    let half = DisplayModel::ideal(filtered(setup(90, 120, 8e-3), OrderFilter::rectangle(0.6, 0.5)));
    let engine = Engine::new(&half, Detector::Pixel, None).unwrap();
    let [of_first, of_half] = [&first, &half].map(|model| {
        let through = Engine::new(model, Detector::Pixel, None).unwrap();
        let problem = HologramProblem::new(through, target.clone(), region).unwrap();
        let start = initial_phase(grid.height_px(), grid.width_px(), 0.5, 4).unwrap().into_vec();
        let mut optimization =
            Optimization::start(problem, HologramOptions::new(HologramMethod::Lbfgs, 60), start).unwrap();
        while optimization.step().is_some() {}
        let phase = Plane::try_from_vec(90, 120, optimization.phases().to_vec()).unwrap();
        quality(&engine, &phase, &target, region).unwrap().pixel
    });
    assert!(of_half.psnr_db > of_first.psnr_db + 6.0, "{of_first:?}, {of_half:?}");
    // A part of the light that passes the filter, so never more than all of it.
    assert!((0.5..1.0).contains(&of_half.frame_efficiency), "{of_half:?}");
}

#[test]
fn planner_follows_the_filter_of_the_display() {
    let filter = OrderFilter::rectangle(1.0, 0.5);
    let setup = filtered(setup(64, 96, 5e-3), filter);
    let report = plan(&setup).unwrap();
    assert_eq!((report.method, setup.method()), (PropagationMethod::BandResponse, ConvolutionMethod::BandResponse));
    assert!(report.explanation.contains("1 of it along x and 0.5 along y"), "{}", report.explanation);
    for method in [ConvolutionMethod::AngularSpectrum, ConvolutionMethod::AllOrders] {
        let refused = setup.with_method(method).unwrap_err();
        assert!(matches!(refused, Error::Unsuitable { code: RefusalCode::OtherOrders, .. }), "{refused}");
    }
    let beyond = OrderFilter { centre_y: 0.3, ..filter };
    assert!(setup.with_orders(Orders::Filtered(beyond)).unwrap_err().to_string().starts_with("filter_centre_y is 0.3"));
}
