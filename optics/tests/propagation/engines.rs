//! Tests that every propagation engine must pass, whatever its implementation.
//!
//! To test another engine, add it to [`ENGINES`].

use super::fields::{
    PITCH_M, WAVELENGTH_M, centroid_and_waists, cropped, energy, flat_top, half_band_spots, inner_product, noise,
    relative_l2, setup, sinc,
};
use crate::engine::EngineCore;
use crate::propagation::transfer_function::angular_spectrum;
use crate::reference::{filter, gaussian_beam, propagate, propagate_uncropped, rayleigh_sommerfeld, square_aperture};
use crate::{Detector, DisplayModel, KernelShape, OpticalSetup, Plane};
use num_complex::{Complex32, Complex64};
use std::f64::consts::TAU;

/// A transfer function H(fx, fy), frequencies in 1/m.
type Transfer<'a> = &'a (dyn Fn(f64, f64) -> Complex64 + Sync);

struct Engine {
    name: &'static str,
    /// Propagates a field through free space, onto its own pixels.
    free_space: fn(&OpticalSetup, &Plane<Complex64>) -> Plane<Complex64>,
    /// Pads a field twofold with zeros, applies any transfer function, and crops the result.
    filtered: fn(&OpticalSetup, Transfer<'_>, &Plane<Complex64>) -> Plane<Complex64>,
    /// Relative L2 error of the field that the rounding of the engine's number format explains.
    rounding: f64,
}

const ENGINES: &[Engine] = &[
    Engine {
        name: "plain f64",
        free_space: |setup, field| propagate(field, PITCH_M, |fx, fy| setup.transfer(fx, fy)),
        filtered: |_, transfer, field| propagate(field, PITCH_M, transfer),
        rounding: 1e-12,
    },
    Engine {
        name: "fused f64",
        free_space: |setup, field| wide(&DisplayModel::ideal(*setup), field),
        filtered: |setup, transfer, field| wide(&filter_of(setup, transfer), field),
        rounding: 1e-12,
    },
    Engine {
        name: "fused f32",
        free_space: |setup, field| narrow(&DisplayModel::ideal(*setup), field),
        filtered: |setup, transfer, field| narrow(&filter_of(setup, transfer), field),
        rounding: 1e-5,
    },
];

/// A display whose kernel is this transfer function.
fn filter_of(setup: &OpticalSetup, transfer: Transfer<'_>) -> DisplayModel {
    let (height_px, width_px) = (setup.grid().height_px(), setup.grid().width_px());
    // Bins have zero frequency in the middle of the padded plane.
    let frequency = |bin: usize, side_px: usize| (bin as f64 - side_px as f64) / (2.0 * side_px as f64 * PITCH_M);
    let bins = Plane::from_fn(2 * height_px, 2 * width_px, |v, u| {
        let value = transfer(frequency(u, width_px), frequency(v, height_px));
        Complex32::new(value.re as f32, value.im as f32)
    });
    DisplayModel { kernel: KernelShape::Bins(bins), ..DisplayModel::ideal(*setup) }
}

fn wide(model: &DisplayModel, field: &Plane<Complex64>) -> Plane<Complex64> {
    EngineCore::<f64>::new(model, Detector::Point, None).unwrap().propagate(field).unwrap()
}

fn narrow(model: &DisplayModel, field: &Plane<Complex64>) -> Plane<Complex64> {
    let engine = crate::Engine::new(model, Detector::Point, None).unwrap();
    let narrowed = field.map(|value| Complex32::new(value.re as f32, value.im as f32));
    engine.propagate(&narrowed).unwrap().map(|value| Complex64::new(f64::from(value.re), f64::from(value.im)))
}

#[test]
fn engines_agree_with_the_reference() {
    for engine in ENGINES {
        for (height_px, width_px, distance_m) in [(64, 96, 0.01), (45, 81, -0.15), (50, 128, 0.5)] {
            let (setup, field) = (setup(height_px, width_px, distance_m), noise(height_px, width_px, 1));
            let expected = propagate(&field, PITCH_M, |fx, fy| setup.transfer(fx, fy));
            let error = relative_l2(&(engine.free_space)(&setup, &field), &expected);
            assert!(error <= engine.rounding, "{} {height_px}×{width_px} {distance_m} m: {error:e}", engine.name);
        }
    }
}

#[test]
fn gaussian_beam_keeps_centre_and_matches_closed_form() {
    let waist_m = 0.286e-3;
    for engine in ENGINES {
        for (height_px, width_px) in [(270, 480), (271, 481), (301, 272)] {
            for distance_m in [0.07, 0.15, 0.5, -0.15] {
                let setup = setup(height_px, width_px, distance_m);
                let centre = (height_px as f64 / 2.0 - 3.3, width_px as f64 / 2.0 + 2.6);
                let beam = |z: f64| {
                    Plane::from_fn(height_px, width_px, |y, x| {
                        let (y, x) = ((y as f64 - centre.0) * PITCH_M, (x as f64 - centre.1) * PITCH_M);
                        gaussian_beam(x, y, z, waist_m, WAVELENGTH_M)
                    })
                };
                let image = (engine.free_space)(&setup, &beam(0.0));
                let label = format!("{} {height_px}×{width_px} {distance_m} m", engine.name);
                let (found, waists) = centroid_and_waists(&image);
                assert!((found.0 - centre.0).abs() < 1e-3 && (found.1 - centre.1).abs() < 1e-3, "{label}: {found:?}");
                let range_m = TAU / 2.0 * waist_m * waist_m / WAVELENGTH_M;
                let expected = waist_m / PITCH_M * (1.0 + (distance_m / range_m).powi(2)).sqrt();
                for waist in waists {
                    assert!((waist / expected - 1.0).abs() < 1e-4, "{label}: waist {waist} px, expected {expected} px");
                }
                let error = relative_l2(&image, &beam(distance_m));
                assert!(error < 1e-5 + engine.rounding, "{label}: relative error {error:e}");
            }
        }
    }
}

#[test]
fn uncropped_plane_conserves_energy() {
    for (height_px, width_px) in [(270, 480), (61, 45)] {
        let setup = setup(height_px, width_px, 0.01);
        let (there, back) = (|fx, fy| setup.transfer(fx, fy), |fx, fy| setup.transfer(fx, fy).conj());
        let field = noise(height_px, width_px, 2);
        let image = propagate_uncropped(&field, PITCH_M, there);
        assert!((energy(&image) / energy(&field) - 1.0).abs() < 1e-12);
        let returned = cropped(&filter(&image, PITCH_M, back), height_px, width_px);
        assert!(relative_l2(&returned, &field) < 1e-12);
    }
}

/// Two spots whose light stays far from the frame's sides over a centimetre of propagation.
fn two_spots() -> Plane<Complex64> {
    Plane::from_fn(160, 200, |y, x| {
        let spot = |cy: f64, cx: f64| (-((y as f64 - cy).powi(2) + (x as f64 - cx).powi(2)) / 72.0).exp();
        Complex64::new(spot(80.0, 90.0), -0.7 * spot(85.5, 110.0))
    })
}

#[test]
fn light_inside_frame_conserves_energy() {
    for engine in ENGINES {
        for distance_m in [0.01, -0.005] {
            let image = (engine.free_space)(&setup(160, 200, distance_m), &two_spots());
            let change = energy(&image) / energy(&two_spots()) - 1.0;
            assert!(change.abs() < engine.rounding, "{} {distance_m} m: {change:e}", engine.name);
        }
    }
}

#[test]
fn single_precision_matches_double_precision() {
    for (height_px, width_px, distance_m) in [(270, 480, 0.15), (271, 97, -0.03), (64, 64, 0.2)] {
        let (setup, field) = (setup(height_px, width_px, distance_m), noise(height_px, width_px, 5));
        let model = DisplayModel::ideal(setup);
        let error = relative_l2(&narrow(&model, &field), &wide(&model, &field));
        assert!(error < 1e-5, "{height_px}×{width_px} {distance_m} m: {error:e}");
    }
}

#[test]
fn propagation_forth_and_back_restores_field() {
    for engine in ENGINES {
        let field = two_spots();
        let image = (engine.free_space)(&setup(160, 200, 0.01), &field);
        let returned = (engine.free_space)(&setup(160, 200, -0.01), &image);
        let error = relative_l2(&returned, &field);
        assert!(error < engine.rounding, "{}: {error:e}", engine.name);
    }
}

#[test]
fn propagation_over_negative_distance_is_adjoint() {
    for engine in ENGINES {
        let setup = setup(48, 70, 0.15);
        let (u, v) = (noise(48, 70, 3), noise(48, 70, 4));
        let forwards = inner_product(&(engine.free_space)(&setup, &u), &v);
        // Propagation over the negative distance has the conjugate transfer function.
        let adjoint = (engine.free_space)(&self::setup(48, 70, -0.15), &v);
        let backwards = inner_product(&u, &adjoint);
        let scale = (energy(&u) * energy(&v)).sqrt();
        assert!((forwards - backwards).norm() / scale < 1e-6_f64.min(engine.rounding), "{}", engine.name);
    }
}

#[test]
fn engines_match_direct_diffraction_sum() {
    for engine in ENGINES {
        for (height_px, width_px, distance_m) in [(32, 32, 0.012), (32, 32, -0.012), (27, 34, 0.0095)] {
            let setup = setup(height_px, width_px, distance_m);
            assert!(distance_m.abs() > setup.critical_distance_x_m().max(setup.critical_distance_y_m()));
            let field = half_band_spots(height_px, width_px);
            let expected = rayleigh_sommerfeld(&setup, &field).unwrap();
            let error = relative_l2(&(engine.free_space)(&setup, &field), &expected);
            assert!(error < 1e-3, "{} {height_px}×{width_px} {distance_m} m: {error:e}", engine.name);
        }
    }
}

#[test]
fn square_aperture_gives_fresnel_fringes() {
    let (side_px, hole_px) = (512, 100);
    for engine in ENGINES {
        let setup = setup(side_px, side_px, 0.15);
        let first = (side_px - hole_px) / 2;
        let hole = first..first + hole_px;
        let field = Plane::from_fn(side_px, side_px, |y, x| {
            Complex64::from(if hole.contains(&y) && hole.contains(&x) { 1.0 } else { 0.0 })
        });
        // A sample stands for a whole square pixel, not for a point.
        let transfer = |fx: f64, fy: f64| setup.transfer(fx, fy) * sinc(fx * PITCH_M) * sinc(fy * PITCH_M);
        let image = (engine.filtered)(&setup, &transfer, &field).map(|value| value.norm_sqr());
        let middle = (side_px - 1) as f64 / 2.0;
        let expected = Plane::from_fn(side_px, side_px, |y, x| {
            let (y, x) = ((y as f64 - middle) * PITCH_M, (x as f64 - middle) * PITCH_M);
            square_aperture(x, y, setup.distance_m(), hole_px as f64 * PITCH_M, WAVELENGTH_M).norm_sqr()
        });
        let worst = image.values().iter().zip(expected.values()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 5e-3, "{}: largest error of the intensity {worst:e}", engine.name);
    }
}

#[test]
fn grating_images_itself_at_talbot_distances() {
    let (height_px, width_px, period_px) = (480, 1024, 16);
    let period_m = period_px as f64 * PITCH_M;
    let talbot_m = 2.0 * period_m * period_m / WAVELENGTH_M;
    let grating = |x: usize| 1.0 + 0.8 * (TAU * x as f64 / period_px as f64).cos();
    let field = Plane::from_fn(height_px, width_px, |y, x| {
        Complex64::from(flat_top(y, height_px) * flat_top(x, width_px) * grating(x))
    });
    for engine in ENGINES {
        for (distance_m, moved_px) in [(talbot_m, 0), (talbot_m / 2.0, period_px / 2)] {
            let image = (engine.free_space)(&setup(height_px, width_px, distance_m), &field);
            for x in width_px / 2 - 3 * period_px..width_px / 2 + 3 * period_px {
                let (found, expected) = (image.at(height_px / 2, x).norm_sqr(), grating(x + moved_px).powi(2));
                assert!((found - expected).abs() < 1e-3, "{} {distance_m} m, x = {x}: {found}", engine.name);
            }
        }
    }
}

#[test]
fn plane_wave_only_gains_phase() {
    let side_px = 480;
    for engine in ENGINES {
        for (u, v, distance_m) in [(0, 0, 0.07), (5, -3, 0.07), (-12, 8, -0.03)] {
            let (fx, fy) = [u, v].map(|bin: i32| f64::from(bin) / (2.0 * side_px as f64 * PITCH_M)).into();
            let wave = |y: usize, x: usize| Complex64::cis(TAU * PITCH_M * (fx * x as f64 + fy * y as f64));
            let field =
                Plane::from_fn(side_px, side_px, |y, x| wave(y, x) * flat_top(y, side_px) * flat_top(x, side_px));
            let image = (engine.free_space)(&setup(side_px, side_px, distance_m), &field);
            let gained = angular_spectrum(fx, fy, WAVELENGTH_M, distance_m);
            for (y, x) in [(240, 240), (236, 244), (245, 233)] {
                let error = (image.at(y, x) - gained * wave(y, x)).norm();
                assert!(error < 1e-5, "{} ({u}, {v}) {distance_m} m: {error:e}", engine.name);
            }
        }
    }
}
