//! Comparisons of each method with closed forms, with the direct sum and with its adjoint.

use super::fields::{
    PITCH_M, WAVELENGTH_M, energy, half_band_spots, inner_product, noise, relative_l2, setup, spots_over_the_band,
};
use crate::engine::{PropagatorCore, Real};
use crate::propagation::{ImageWindow, PropagationMethod};
use crate::reference::{gaussian_beam, rayleigh_sommerfeld, rayleigh_sommerfeld_onto};
use crate::{Grid, OpticalSetup, Orders, Plane};
use num_complex::{Complex, Complex64};
use std::f64::consts::{PI, TAU};

fn propagated<T: Real>(propagator: &PropagatorCore<T>, field: &Plane<Complex64>) -> Plane<Complex64> {
    wide(&propagator.forward(&narrow(field)).unwrap())
}

fn narrow<T: Real>(field: &Plane<Complex64>) -> Plane<Complex<T>> {
    field.map(|u| Complex::new(T::of(u.re), T::of(u.im)))
}

fn wide<T: Real>(field: &Plane<Complex<T>>) -> Plane<Complex64> {
    field.map(|u| Complex64::new(u.re.wide(), u.im.wide()))
}

/// Propagators of every method onto its default window, at distances where the method is valid, and onto three other
/// windows.
fn propagators<T: Real>(height_px: usize, width_px: usize) -> Vec<PropagatorCore<T>> {
    let at = |distance_m: f64| setup(height_px, width_px, distance_m);
    let (near_m, far_m) = (0.4 * critical_m(&at(1.0)), 2.0 * critical_m(&at(1.0)));
    let mut all = Vec::new();
    for (method, distances_m) in [
        (PropagationMethod::BandResponse, [near_m, -far_m]),
        (PropagationMethod::AngularSpectrum, [near_m, -near_m]),
        (PropagationMethod::BandLimited, [far_m, -near_m]),
        (PropagationMethod::RayleighSommerfeld, [far_m, -far_m]),
        (PropagationMethod::FresnelTransferFunction, [near_m, -near_m]),
        (PropagationMethod::FresnelImpulseResponse, [far_m, -far_m]),
        (PropagationMethod::BandExtended, [far_m, -near_m]),
    ] {
        all.extend(distances_m.map(|z| PropagatorCore::regardless(&at(z), method).unwrap()));
    }
    let shown = |z: f64| at(z).with_orders(Orders::SQUARE).unwrap();
    all.extend([near_m, -far_m].map(|z| PropagatorCore::regardless(&shown(z), PropagationMethod::AllOrders).unwrap()));
    let beside = |z: f64| at(z).with_centre(0.2 * far_m * WAVELENGTH_M / PITCH_M, -1e-5).unwrap();
    all.extend([far_m, -far_m].map(|z| PropagatorCore::regardless(&beside(z), PropagationMethod::Shifted).unwrap()));
    all.extend([3.0, -3.0].map(|z| PropagatorCore::regardless(&at(z), PropagationMethod::Fraunhofer).unwrap()));
    for (rows, columns, pitch_m, z) in [(20, 33, 2e-6, near_m), (17, 12, 11e-6, -far_m), (24, 9, 1e-6, 8.0 * far_m)] {
        let window = ImageWindow::try_new(rows, columns, pitch_m).unwrap().centred_at(3e-5, -2e-5).unwrap();
        all.push(PropagatorCore::onto(&at(z), &window).unwrap());
    }
    all
}

fn critical_m(setup: &OpticalSetup) -> f64 {
    setup.critical_distance_x_m().max(setup.critical_distance_y_m())
}

fn label<T>(propagator: &PropagatorCore<T>) -> String
where
    T: Real,
{
    format!("{} at {} m", propagator.method(), propagator.setup().distance_m())
}

#[test]
fn propagators_cover_every_method() {
    let listed: Vec<PropagationMethod> = propagators::<f32>(24, 31).iter().map(PropagatorCore::method).collect();
    for method in PropagationMethod::ALL {
        assert!(listed.contains(&method), "{method}");
    }
}

fn check_adjoints<T: Real>(bound: f64) {
    for (height_px, width_px) in [(24, 31), (17, 16), (1, 13)] {
        for propagator in propagators::<T>(height_px, width_px) {
            let window = propagator.window();
            let (u, v) = (noise(height_px, width_px, 3), noise(window.height_px(), window.width_px(), 4));
            let there = propagated(&propagator, &u);
            let back = wide(&propagator.adjoint(&narrow(&v)).unwrap());
            let difference = inner_product(&there, &v) - inner_product(&u, &back);
            let scale = (energy(&there) * energy(&v)).sqrt();
            assert!(difference.norm() <= bound * scale, "{height_px}×{width_px} {}: {difference}", label(&propagator));
        }
    }
}

#[test]
fn adjoint_satisfies_inner_product_identity() {
    check_adjoints::<f64>(1e-12);
    check_adjoints::<f32>(1e-6);
}

#[test]
fn single_precision_matches_double_precision() {
    let field = noise(24, 31, 5);
    for (single, double) in propagators::<f32>(24, 31).iter().zip(propagators::<f64>(24, 31)) {
        let error = relative_l2(&propagated(single, &field), &propagated(&double, &field));
        assert!(error < 1e-5, "{}: {error:e}", label(single));
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let field = noise(40, 31, 6);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            propagators::<f32>(40, 31)
                .iter()
                .map(|propagator| propagator.forward(&narrow(&field)).unwrap())
                .collect::<Vec<_>>()
        })
    };
    let one = on(1);
    assert!(on(2) == one && on(8) == one);
}

#[test]
fn gaussian_beam_matches_closed_form() {
    let (height_px, width_px, waist_m) = (129, 96, 60e-6);
    let beam = |window: &ImageWindow, z: f64| {
        Plane::from_fn(window.height_px(), window.width_px(), |y, x| {
            gaussian_beam(window.x_m(x) - 20e-6, window.y_m(y) + 30e-6, z, waist_m, WAVELENGTH_M)
        })
    };
    let own = setup(height_px, width_px, 1.0).window();
    let check = |propagator: PropagatorCore<f64>, bound: f64| {
        let z = propagator.setup().distance_m();
        let error = relative_l2(&propagated(&propagator, &beam(&own, 0.0)), &beam(propagator.window(), z));
        assert!(error < bound, "{}: {error:e}", label(&propagator));
    };
    // The closed form is paraxial. Its error is the difference to the exact methods.
    let (paraxial, exact) = (1e-6, 5e-5);
    for z in [15e-3, -15e-3, 40e-3, -40e-3] {
        let setup = setup(height_px, width_px, z);
        let is_near = z.abs() < 20e-3;
        for (method, bound, is_valid) in [
            (PropagationMethod::BandResponse, exact, true),
            (PropagationMethod::AngularSpectrum, exact, is_near),
            (PropagationMethod::BandLimited, exact, true),
            (PropagationMethod::BandExtended, exact, true),
            (PropagationMethod::FresnelTransferFunction, paraxial, is_near),
            (PropagationMethod::RayleighSommerfeld, exact, !is_near),
            (PropagationMethod::FresnelImpulseResponse, paraxial, !is_near),
        ] {
            if is_valid {
                check(PropagatorCore::new(&setup, method).unwrap(), bound);
            }
        }
        let zoom = ImageWindow::try_new(50, 71, 3e-6).unwrap().centred_at(40e-6, -10e-6).unwrap();
        let reduced = ImageWindow::try_new(30, 33, 20e-6).unwrap();
        for window in [zoom, reduced, own.centred_at(1e-4, -5e-5).unwrap()] {
            check(PropagatorCore::onto(&setup, &window).unwrap(), exact);
        }
        check(
            PropagatorCore::new(&setup.with_centre(1e-4, -5e-5).unwrap(), PropagationMethod::Shifted).unwrap(),
            exact,
        );
        if !is_near {
            check(PropagatorCore::regardless(&setup, PropagationMethod::ScaledFresnel).unwrap(), paraxial);
        }
    }
}

#[test]
fn impulse_response_matches_direct_sum() {
    for (height_px, width_px) in [(20, 31), (33, 8)] {
        for times in [1.0, -1.0, 4.0] {
            let setup = setup(height_px, width_px, times * critical_m(&setup(height_px, width_px, 1.0)));
            let field = noise(height_px, width_px, 7);
            let expected = rayleigh_sommerfeld(&setup, &field).unwrap();
            for (found, bound) in [
                (
                    propagated(
                        &PropagatorCore::<f64>::new(&setup, PropagationMethod::RayleighSommerfeld).unwrap(),
                        &field,
                    ),
                    1e-12,
                ),
                (
                    propagated(
                        &PropagatorCore::<f32>::new(&setup, PropagationMethod::RayleighSommerfeld).unwrap(),
                        &field,
                    ),
                    1e-5,
                ),
            ] {
                let error = relative_l2(&found, &expected);
                assert!(error < bound, "{height_px}×{width_px} {times} z_c: {error:e}");
            }
        }
    }
}

#[test]
fn fields_in_any_window_match_direct_sum() {
    let (height_px, width_px, finer) = (32, 28, 3);
    let grid = Grid::try_new(height_px * finer, width_px * finer, PITCH_M / finer as f64).unwrap();
    let (field, fine) = (half_band_spots(height_px, width_px), spots_resampled(height_px, width_px, finer));
    for z in [5e-3, 0.012, -0.012, 0.04] {
        let (setup, fine_setup) =
            (setup(height_px, width_px, z), OpticalSetup::try_new(grid, WAVELENGTH_M, z).unwrap());
        let check = |propagator: PropagatorCore<f64>| {
            let expected = rayleigh_sommerfeld_onto(&fine_setup, &fine, propagator.window()).unwrap();
            let error = relative_l2(&propagated(&propagator, &field), &expected);
            assert!(error < 1e-3, "{}: {error:e}", label(&propagator));
        };
        for (rows, columns, pitch_m, x_m, y_m) in
            [(16, 16, 3e-6, 0.0, 0.0), (20, 13, 9e-6, 4e-5, -3e-5), (12, 30, 16e-6, 0.0, 2e-5)]
        {
            let window = ImageWindow::try_new(rows, columns, pitch_m).unwrap().centred_at(x_m, y_m).unwrap();
            check(PropagatorCore::onto(&setup, &window).unwrap());
        }
        if z.abs() < 0.02 {
            check(PropagatorCore::new(&setup.with_centre(3e-5, -2e-5).unwrap(), PropagationMethod::Shifted).unwrap());
        }
    }
}

/// [`half_band_spots`] of `height_px` × `width_px`, sampled `finer` times as finely.
fn spots_resampled(height_px: usize, width_px: usize, finer: usize) -> Plane<Complex64> {
    // The centre of fine pixel i lies at (i + ½)/finer − ½ pixels.
    let spots = [(0.5, 0.45, 1.0, 0.03), (0.42, 0.55, -0.6, -0.05), (0.55, 0.6, 0.5, 0.04)];
    Plane::from_fn(height_px * finer, width_px * finer, |y, x| {
        let [y, x] = [y, x].map(|i| (i as f64 + 0.5) / finer as f64 - 0.5);
        let spot = |(cy, cx, size, tilt): (f64, f64, f64, f64)| {
            let (dy, dx) = (y - cy * height_px as f64, x - cx * width_px as f64);
            Complex64::cis(TAU * tilt * (dx - dy)) * size * (-(dx * dx + dy * dy) / 16.0).exp()
        };
        spots.map(spot).into_iter().sum()
    })
}

#[test]
fn extended_band_helps_only_beyond_critical_distance() {
    let (near, far) = (setup(40, 40, 5e-3), setup(40, 40, 0.08));
    let field = noise(40, 40, 8);
    let by =
        |setup: &OpticalSetup, method, field| propagated(&PropagatorCore::<f64>::new(setup, method).unwrap(), field);
    let same = relative_l2(
        &by(&near, PropagationMethod::BandExtended, &field),
        &by(&near, PropagationMethod::AngularSpectrum, &field),
    );
    assert!(same < 1e-11, "{same:e}");
    let field = spots_over_the_band(40, 40, 1);
    let exact = by(&far, PropagationMethod::RayleighSommerfeld, &field);
    let error =
        |method| relative_l2(&propagated(&PropagatorCore::<f64>::regardless(&far, method).unwrap(), &field), &exact);
    let (limited, extended) = (error(PropagationMethod::BandLimited), error(PropagationMethod::BandExtended));
    assert!(extended < 0.5 * limited, "{extended} {limited}");
}

#[test]
fn far_field_of_rectangle_is_dirichlet_kernel() {
    let (height_px, width_px, (rows, columns)) = (50, 61, (10, 7));
    for z in [4.0, -4.0] {
        let propagator =
            PropagatorCore::<f64>::regardless(&setup(height_px, width_px, z), PropagationMethod::Fraunhofer).unwrap();
        let hole = |i: usize, side_px: usize, hole_px: usize| {
            2 * i.abs_diff((side_px - hole_px) / 2) < 4 * hole_px
                && i >= (side_px - hole_px) / 2
                && i < (side_px - hole_px) / 2 + hole_px
        };
        let field = Plane::from_fn(height_px, width_px, |y, x| {
            Complex64::from(if hole(y, height_px, rows) && hole(x, width_px, columns) { 1.0 } else { 0.0 })
        });
        let window = *propagator.window();
        let area_m2 = WAVELENGTH_M * z;
        let kernel = |x_m: f64, side_px: usize, hole_px: usize| {
            // Σ e^{−i2πx·x'/λz} over the hole. The hole's middle may lie half a pixel beside the display's middle.
            let middle_m =
                ((side_px - hole_px) / 2) as f64 * PITCH_M + 0.5 * (hole_px as f64 - side_px as f64) * PITCH_M;
            let turn = PI * x_m * PITCH_M / area_m2;
            let ratio =
                if turn.sin().abs() < 1e-12 { hole_px as f64 } else { (hole_px as f64 * turn).sin() / turn.sin() };
            Complex64::cis(-TAU * x_m * middle_m / area_m2) * ratio
        };
        let expected = Plane::from_fn(height_px, width_px, |y, x| {
            let (x_m, y_m) = (window.x_m(x), window.y_m(y));
            kernel(x_m, width_px, columns)
                * kernel(y_m, height_px, rows)
                * Complex64::cis(PI * (x_m * x_m + y_m * y_m) / area_m2)
                * PITCH_M.powi(2)
                / Complex64::new(0.0, area_m2)
        });
        let error = relative_l2(&propagated(&propagator, &field), &expected);
        assert!(error < 1e-11, "{z}: {error:e}");
    }
}

#[test]
fn far_field_matches_exact_integral() {
    let setup = setup(12, 16, 0.5);
    let propagator = PropagatorCore::<f64>::new(&setup, PropagationMethod::Fraunhofer).unwrap();
    let field = noise(12, 16, 10);
    let expected = rayleigh_sommerfeld_onto(&setup, &field, propagator.window()).unwrap();
    // The neglected phase: π·ρ²/λz at the display's corners.
    let neglected = PI * PITCH_M.powi(2) * (5.5_f64.powi(2) + 7.5_f64.powi(2)) / (WAVELENGTH_M * 0.5);
    // Far off the axis the phases of a paraboloid and a sphere differ, so the test compares amplitudes only.
    let amplitude = |field: &Plane<Complex64>| field.map(|u| Complex64::from(u.norm()));
    let error = relative_l2(&amplitude(&propagated(&propagator, &field)), &amplitude(&expected));
    assert!(error < neglected && neglected < 0.1, "{error} {neglected}");
}
