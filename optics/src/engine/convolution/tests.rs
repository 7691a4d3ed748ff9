//! Tests of the fused passes against the plain padded transform in f64, on odd, prime and non-square sizes.

use crate::display::{Detector, DisplayModel, KernelShape, OpticalSetup, SpatialVariation};
use crate::engine::convolution::Real;
use crate::engine::core::{EngineCore, Fields};
use crate::numerics::{Grid, Plane, SmoothField};
use crate::reference;
use num_complex::{Complex, Complex64};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SIZES: [(usize, usize); 6] = [(1, 1), (16, 16), (17, 31), (64, 48), (45, 101), (130, 96)];

fn setup(height_px: usize, width_px: usize, distance_m: f64) -> OpticalSetup {
    OpticalSetup::try_new(Grid::try_new(height_px, width_px, 8e-6).unwrap(), 515e-9, distance_m).unwrap()
}

fn random_field(height_px: usize, width_px: usize, seed: u64) -> Plane<Complex64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut number = || random.random_range(-1.0..1.0);
    Plane::from_fn(height_px, width_px, |_, _| Complex64::new(number(), number()))
}

fn narrowed<T: Real>(field: &Plane<Complex64>) -> Plane<Complex<T>> {
    field.map(|c| Complex::new(T::of(c.re), T::of(c.im)))
}

fn relative_l2<T: Real>(actual: &Plane<Complex<T>>, expected: &Plane<Complex64>) -> f64 {
    let pairs = actual.values().iter().zip(expected.values());
    let error: f64 = pairs.map(|(a, e)| (Complex64::new(a.re.wide(), a.im.wide()) - e).norm_sqr()).sum();
    (error / expected.values().iter().map(Complex64::norm_sqr).sum::<f64>()).sqrt()
}

fn check_against_reference<T: Real>(bound: f64) {
    for (height_px, width_px) in SIZES {
        for distance_m in [2e-3, -0.05] {
            let setup = setup(height_px, width_px, distance_m);
            let engine = EngineCore::<T>::new(&DisplayModel::ideal(setup), Detector::Point, None).unwrap();
            let field = random_field(height_px, width_px, 7);
            let expected = reference::propagate(&field, 8e-6, |fx, fy| setup.transfer(fx, fy));
            let error = relative_l2(&engine.propagate(&narrowed(&field)).unwrap(), &expected);
            assert!(error < bound, "{width_px}×{height_px} px at {distance_m} m: {error:e}");
        }
    }
}

#[test]
fn f64_passes_match_plain_transform() {
    check_against_reference::<f64>(1e-12);
}

// The bound covers rounding: ε·log₂N for the transforms, and the same amount for the tables.
#[test]
fn f32_passes_match_plain_transform() {
    check_against_reference::<f32>(1e-6);
}

fn inner<T: Real>(a: &[Complex<T>], b: &[Complex<T>]) -> Complex64 {
    let wide = |c: &Complex<T>| Complex64::new(c.re.wide(), c.im.wide());
    a.iter().zip(b).map(|(a, b)| wide(a).conj() * wide(b)).sum()
}

/// Models of free space, and of kernels that vary a little and a lot over the SLM.
fn models(setup: OpticalSetup) -> [DisplayModel; 3] {
    let varying = |size: f64| {
        let mut field = SmoothField::flat(2);
        (field.log_amplitude, field.phase) = (vec![-0.1 * size; 5], vec![size; 5]);
        let (kernel, variation) =
            (KernelShape::Smooth(field.clone()), SpatialVariation::new([(); 5].map(|()| field.clone())));
        DisplayModel { kernel, variation, ..DisplayModel::ideal(setup) }
    };
    [DisplayModel::ideal(setup), varying(0.02), varying(0.5)]
}

/// Checks that ⟨A u, v⟩ = ⟨u, Aᴴ v⟩ within `bound`.
fn check_adjoint<T: Real>(bound: f64) {
    for ((height_px, width_px), i) in SIZES.into_iter().flat_map(|size| (0..3).map(move |i| (size, i))) {
        let model = &models(setup(height_px, width_px, 2e-3))[i];
        let engine = EngineCore::<T>::new(model, Detector::Point, None).unwrap();
        let (u, v) = (random_field(height_px, width_px, 3), random_field(height_px, width_px, 4));
        let (u, v) = (narrowed::<T>(&u), narrowed::<T>(&v));
        let there = inner(engine.propagate(&u).unwrap().values(), v.values());

        let (mut fields, mut back) = (Fields::new(&engine), u.clone());
        let spectrum = &mut fields.spectrum[..engine.image_len()];
        engine.convolver.forward_rows(spectrum, &[None], |y, row| row.copy_from_slice(v.row(y)));
        engine.return_rows(&mut fields, back.values_mut(), |_, row, out| out.copy_from_slice(row));
        let here = inner(u.values(), back.values());
        // The error is compared with the lengths of the vectors, because the products themselves are small by chance.
        let length = (inner(u.values(), u.values()).re * inner(v.values(), v.values()).re).sqrt();
        assert!((there - here).norm() < bound * length, "{width_px}×{height_px} px, {i}: {there} against {here}");
    }
}

#[test]
fn backward_propagation_is_adjoint_of_forward_propagation() {
    check_adjoint::<f32>(1e-6);
    check_adjoint::<f64>(1e-14);
}
