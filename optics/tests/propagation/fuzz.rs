//! Random valid inputs: propagation never panics, and its results are finite.

use crate::propagation::{ConvolutionMethod, ImageWindow, PropagationMethod, assess, plan, plan_onto};
use crate::{Detector, DisplayModel, Engine, Grid, OpticalSetup, Plane, Propagator};
use num_complex::Complex32;
use proptest::prelude::*;

/// Random numbers between `low` and `high`, spread evenly over the orders of magnitude.
fn over(low: f64, high: f64) -> impl Strategy<Value = f64> {
    (low.ln()..high.ln()).prop_map(f64::exp)
}

fn setups() -> impl Strategy<Value = OpticalSetup> {
    let signed = (over(1e-9, 9.99), any::<bool>()).prop_map(|(z, behind)| if behind { -z } else { z });
    (1..=64usize, 1..=64usize, over(1.01e-8, 0.99e-2), over(1.01e-7, 0.99e-5), signed).prop_map(
        |(height_px, width_px, pitch_m, wavelength_m, distance_m)| {
            OpticalSetup::try_new(Grid::try_new(height_px, width_px, pitch_m).unwrap(), wavelength_m, distance_m)
                .unwrap()
        },
    )
}

/// Random windows of about the display's size, on and off the axis.
fn windows() -> impl Strategy<Value = (usize, usize, f64, f64, f64)> {
    (1..=32usize, 1..=32usize, over(0.2, 4.0), -2.0..2.0, -2.0..2.0)
}

fn field(setup: &OpticalSetup) -> Plane<Complex32> {
    let grid = setup.grid();
    Plane::from_fn(grid.height_px(), grid.width_px(), |y, x| Complex32::cis((3 * y * y + 7 * x) as f32))
}

fn is_finite(plane: &Plane<Complex32>) -> bool {
    plane.values().iter().all(|u| u.re.is_finite() && u.im.is_finite())
}

fn is_finite_both_ways(propagator: &Propagator, field: &Plane<Complex32>) -> bool {
    let there = propagator.forward(field).unwrap();
    let back = propagator.adjoint(&there).unwrap();
    is_finite(&there) && is_finite(&back)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_setups_give_finite_fields_and_reports(setup in setups(), beside in (-0.01..0.01, -0.01..0.01)) {
        let field = field(&setup);
        for method in PropagationMethod::ALL {
            if let Ok(report) = assess(&setup, method) {
                prop_assert!((0.0..=1.0).contains(&report.band_kept_x) && (0.0..=1.0).contains(&report.band_kept_area));
                prop_assert!(!report.to_string().contains("NaN"), "{report}");
            }
            if let Ok(propagator) = Propagator::regardless(&setup, method) {
                prop_assert!(is_finite_both_ways(&propagator, &field), "{method} {setup:?}");
            }
        }
        match plan(&setup) {
            Ok(report) => prop_assert!(Propagator::new(&setup, report.method).is_ok()),
            Err(refusal) => prop_assert!(!refusal.to_string().contains("NaN"), "{refusal}"),
        }
        let beside = setup.with_centre(beside.0, beside.1).unwrap();
        let propagator = Propagator::regardless(&beside, PropagationMethod::Shifted).unwrap();
        prop_assert!(is_finite_both_ways(&propagator, &field));
    }

    #[test]
    fn random_windows_give_finite_fields(setup in setups(), (rows, columns, ratio, x, y) in windows()) {
        let grid = setup.grid();
        let Ok(window) = ImageWindow::try_new(rows, columns, ratio * grid.pixel_pitch_m()) else { return Ok(()) };
        let side_m = |side_px: usize| side_px as f64 * grid.pixel_pitch_m();
        let window = window.centred_at(x * side_m(grid.width_px()), y * side_m(grid.height_px())).unwrap();
        if let (Ok(report), Ok(propagator)) = (plan_onto(&setup, &window), Propagator::onto(&setup, &window)) {
            prop_assert_eq!(report.method, propagator.method());
            prop_assert!(is_finite_both_ways(&propagator, &field(&setup)), "{setup:?} {window:?}");
        }
    }

    #[test]
    fn random_setups_give_finite_light_in_engines(setup in setups()) {
        let phase = field(&setup).map(|u| u.arg());
        for method in ConvolutionMethod::ALL {
            let setup = setup.with_method_regardless(method);
            for detector in Detector::ALL {
                let light = Engine::new(&DisplayModel::ideal(setup), detector, None).unwrap().light(&phase).unwrap();
                prop_assert!(light.values().iter().all(|light| light.is_finite()), "{method} {setup:?}");
            }
        }
    }
}
