//! A simulated bench gives the same photographs every time, and its flaws degrade ideal holograms.
#![allow(clippy::unwrap_used)]

use lightpath_bench::{SimulatedBench, SimulatedDisplay};
use lightpath_optics::Carrier;
use lightpath_optics::hologram::initial_phase;
use lightpath_optics::metrics::{Gain, psnr_db};
use lightpath_optics::reference::propagate;
use lightpath_optics::{Grid, OpticalSetup, Orders, Plane, RegionOfInterest};
use num_complex::Complex64;
use rayon::ThreadPoolBuilder;
use std::f64::consts::TAU;

const FAIR: SimulatedBench = SimulatedBench { seed: 7, misalignment_px: 0.3, ..SimulatedBench::FAIR };

#[test]
fn same_seed_gives_same_photograph_on_any_number_of_threads() {
    let phase = Plane::from_fn(60, 90, |y, x| ((y * 13 + x * x * 7) % 63) as f32 / 10.0);
    let photograph = |threads: usize, seed: u64, noise_seed: u64| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let bench = SimulatedBench { seed, ..FAIR };
            SimulatedDisplay::draw(setup(60, 90, 0.03), None, bench).unwrap().capture(&phase, noise_seed).unwrap()
        })
    };
    let one = photograph(1, 7, 1);
    assert_eq!(one, photograph(2, 7, 1));
    assert_eq!(one, photograph(8, 7, 1));
    assert_ne!(one, photograph(2, 7, 2), "other noise");
    assert_ne!(one, photograph(2, 8, 1), "other bench");
}

#[test]
fn bench_has_imperfections_of_given_strength() {
    for seed in 0..8 {
        let display = SimulatedDisplay::draw(setup(60, 90, 0.01), None, SimulatedBench { seed, ..FAIR }).unwrap();
        assert!((0.02..0.04).contains(&display.zero_order().norm()));
        assert!(display.shift_px().0.abs() <= 0.3 && display.shift_px().1.abs() <= 0.3);
        let bend = (0..64).map(|i| f64::from(i) / 64.0 * TAU).map(|phase| (display.response(phase) - phase).abs());
        assert!((0.1..0.3).contains(&bend.fold(0.0, f64::max)));
        let source = Plane::from_fn(60, 90, |y, x| display.source(y, x));
        let peak = source.values().iter().copied().fold(0.0, f64::max);
        let corner = source.values().iter().copied().fold(1.0, f64::min);
        assert!(peak == 1.0 && (0.1..0.8).contains(&corner), "{corner}");
        let nyquist = 1.0 / 16e-6;
        let edges = [(0.999, 0.0), (-0.999, 0.0), (0.0, 0.999), (0.0, -0.999)]
            .map(|(x, y)| display.true_transfer(x * nyquist, y * nyquist).norm());
        assert!(edges.iter().all(|edge| (0.2..0.95).contains(edge)), "{edges:?}");
    }
}

#[test]
fn exposure_suits_images() {
    let target = card(108, 192);
    let display = SimulatedDisplay::draw(setup(108, 192, 0.025), None, FAIR).unwrap();
    let phase = hologram(&display.setup(), &target, &|fx, fy| display.setup().transfer(fx, fy));
    let photograph = display.capture(&phase, 3).unwrap();
    let clipped = photograph.values().iter().filter(|&&level| level == 255).count();
    let bright = photograph.values().iter().filter(|&&level| level > 100).count();
    assert!(clipped * 200 < photograph.values().len(), "{clipped} pixels are clipped");
    assert!(bright * 50 > photograph.values().len(), "only {bright} pixels are bright");
}

#[test]
fn camera_image_is_independent_of_carrier() {
    let phase = Plane::from_fn(60, 90, |y, x| ((y * 13 + x * x * 7) % 63) as f32 / 10.0);
    let ideal = SimulatedBench { strength: 0.0, ..FAIR };
    for carrier in [Carrier::HalfOrderX, Carrier::HalfOrderY] {
        let plain = SimulatedDisplay::draw(setup(60, 90, 0.03), None, ideal).unwrap();
        let steered = SimulatedDisplay::draw(setup(60, 90, 0.03), Some(carrier), ideal).unwrap();
        let (a, b) = (plain.light(&phase).unwrap(), steered.light(&carrier.applied_to(&phase)).unwrap());
        assert!(a.values().iter().zip(b.values()).all(|(a, b)| (a - b).abs() < 1e-5));
    }
}

/// Mean and standard deviation of the differences \[levels\] between a photograph by the bench with this flaw and one
/// without it.
fn changed_by(flaw: SimulatedBench, hours: f64) -> (f64, f64) {
    let phase = Plane::from_fn(60, 90, |y, x| ((y * 13 + x * x * 7) % 63) as f32 / 10.0);
    let light = |imperfections: SimulatedBench, hours: f64| {
        let display = SimulatedDisplay::draw(setup(60, 90, 0.03), None, imperfections).unwrap();
        display.capture_at(&phase, 1, hours).unwrap().map(f64::from)
    };
    let (with, without) = (light(flaw, hours), light(SimulatedBench { seed: flaw.seed, ..FAIR }, 0.0));
    let differences: Vec<f64> = with.values().iter().zip(without.values()).map(|(a, b)| a - b).collect();
    let mean = differences.iter().sum::<f64>() / differences.len() as f64;
    (mean, differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>().sqrt() / (differences.len() as f64).sqrt())
}

#[test]
fn each_flaw_changes_photographs_and_time_alone_does_not() {
    for (name, flaw, hours) in [
        ("rotation", SimulatedBench { rotation_rad: 2.0_f64.to_radians(), ..FAIR }, 0.0),
        ("blur", SimulatedBench { blur_px: 1.0, ..FAIR }, 0.0),
        ("shot noise", SimulatedBench { full_well_electrons: 500.0, ..FAIR }, 0.0),
        ("camera's response", SimulatedBench { camera_nonlinearity: 0.1, ..FAIR }, 0.0),
        ("speckle", SimulatedBench { speckle_contrast: 0.2, ..FAIR }, 0.0),
        ("cross-talk", SimulatedBench { crosstalk_px: 0.5, ..FAIR }, 0.0),
        ("cross-talk along y", SimulatedBench { crosstalk_y_px: 0.5, ..FAIR }, 0.0),
        ("surface", SimulatedBench { surface_waves: 1.0, ..FAIR }, 0.0),
        ("varying response", SimulatedBench { response_variation: 0.1, ..FAIR }, 0.0),
        ("dust", SimulatedBench { dust_contrast: 0.1, ..FAIR }, 0.0),
        ("ghost", SimulatedBench { ghost_share: 0.05, ..FAIR }, 0.0),
        ("extended source", SimulatedBench { source_angle_rad: 1e-3, ..FAIR }, 0.0),
        ("wide line", SimulatedBench { bandwidth: 0.03, ..FAIR }, 0.0),
        ("distortion", SimulatedBench { distortion: 0.02, ..FAIR }, 0.0),
        ("vignetting", SimulatedBench { vignetting: 0.3, ..FAIR }, 0.0),
        ("flicker", SimulatedBench { flicker: 0.1, ..FAIR }, 0.0),
        ("drift", SimulatedBench { drift_px_per_hour: 1.0, ..FAIR }, 2.0),
        ("dimming", SimulatedBench { dimming_per_hour: 0.1, ..FAIR }, 2.0),
    ] {
        let (mean, spread) = changed_by(flaw, hours);
        // Without the flaw all levels would be equal.
        assert!(spread > 0.1, "{name}: {mean} ± {spread} levels");
    }
    // Time alone changes no photograph.
    assert_eq!(changed_by(FAIR, 5.0), (0.0, 0.0));
    // Two hours at a loss of 10 % per hour take 19 % of the light.
    let (dimmed, _) = changed_by(SimulatedBench { dimming_per_hour: 0.1, ..FAIR }, 2.0);
    let (dark, _) = changed_by(SimulatedBench { dimming_per_hour: 1.0, ..FAIR }, 1.0);
    assert!((dimmed / dark - 0.19).abs() < 0.02, "{dimmed} of {dark} levels");
}

#[test]
fn true_kernel_gives_better_photographs_than_ideal_kernel() {
    let (height_px, width_px) = (135, 240);
    let setup = setup(height_px, width_px, 0.03);
    let roi = RegionOfInterest::middle(&setup.grid());
    let target = card(height_px, width_px);
    let display = SimulatedDisplay::draw(setup, None, FAIR).unwrap();
    let captured_psnr_db = |transfer: Transfer<'_>| {
        let photograph = display.capture(&hologram(&setup, &target, transfer), 1).unwrap();
        psnr_db(&photograph.map(|level| f32::from(level) / 255.0), &target, roi, Gain::Fitted).unwrap()
    };
    let ideal = captured_psnr_db(&|fx, fy| setup.transfer(fx, fy));
    let through_true_kernel = captured_psnr_db(&|fx, fy| display.true_transfer(fx, fy));
    assert!((9.0..20.0).contains(&ideal), "{ideal}");
    assert!(
        through_true_kernel > ideal + 2.0,
        "{through_true_kernel} dB through the true kernel, {ideal} dB through the ideal one"
    );
}

#[test]
fn orders_and_fill_factor_change_the_light() {
    let phase = initial_phase(60, 90, 6.0, 4).unwrap();
    let light = |orders: Orders| {
        let display = SimulatedDisplay::draw(setup(60, 90, 0.005).with_orders(orders).unwrap(), None, FAIR).unwrap();
        display.light(&phase).unwrap().map(f64::from)
    };
    let all = |fill_factor| light(Orders::All { fill_factor_x: fill_factor, fill_factor_y: fill_factor });
    // Relative L2 difference with the best gain.
    let difference = |a: &Plane<f64>, b: &Plane<f64>| {
        let sum =
            |of: &dyn Fn(f64, f64) -> f64| a.values().iter().zip(b.values()).map(|(a, b)| of(*a, *b)).sum::<f64>();
        let product = sum(&|a, b| a * b);
        (1.0 - product * product / (sum(&|a, _| a * a) * sum(&|_, b| b * b))).sqrt()
    };
    let (first, full, half) = (light(Orders::First), all(1.0), all(0.5));
    // The orders, 40 px apart, overlap in the image. The smaller the bright area, the more light they have.
    let (of_full, of_half) = (difference(&first, &full), difference(&first, &half));
    assert!(of_full > 0.2 && of_half > of_full && difference(&full, &half) > 0.1, "{of_full}, {of_half}");
}

type Transfer<'a> = &'a (dyn Fn(f64, f64) -> Complex64 + Sync);

fn setup(height_px: usize, width_px: usize, distance_m: f64) -> OpticalSetup {
    OpticalSetup::try_new(Grid::try_new(height_px, width_px, 8e-6).unwrap(), 515e-9, distance_m).unwrap()
}

/// A target picture: discs and bars of several greys on a ramp.
fn card(height_px: usize, width_px: usize) -> Plane<f32> {
    Plane::from_fn(height_px, width_px, |y, x| {
        let (v, u) = (y as f32 / height_px as f32, x as f32 / width_px as f32);
        let disc = |cy: f32, cx: f32, r: f32| (v - cy).hypot((u - cx) * 1.6) < r;
        match () {
            () if disc(0.4, 0.35, 0.12) => 1.0,
            () if disc(0.4, 0.35, 0.22) => 0.05,
            () if disc(0.6, 0.68, 0.16) => 0.7,
            () if (0.72..0.82).contains(&v) && (u * 24.0).fract() < 0.5 => 0.9,
            () => 0.1 + 0.3 * u,
        }
    })
}

/// A phase hologram by plain gradient descent with momentum (Adam, step 0.1) on the intensity at the sample points.
fn hologram(setup: &OpticalSetup, target: &Plane<f32>, transfer: Transfer<'_>) -> Plane<f32> {
    const ITERATIONS: i32 = 60;
    let (height_px, width_px, pitch_m) = (target.height_px(), target.width_px(), setup.grid().pixel_pitch_m());
    let roi = RegionOfInterest::middle(&setup.grid());
    let inside = |y: usize, x: usize| roi.columns(y).is_some_and(|columns| columns.contains(&x));
    let mut phase = Plane::from_fn(height_px, width_px, |y, x| ((y * 7919 + x * 104_729) % 1000) as f64 * 5e-4);
    let mut moments = vec![(0.0, 0.0); height_px * width_px];
    for iteration in 1..=ITERATIONS {
        let slm = phase.map(Complex64::cis);
        let image = propagate(&slm, pitch_m, transfer);
        let pixels: Vec<_> = (0..height_px).flat_map(|y| (0..width_px).map(move |x| (y, x))).collect();
        let sum = |of: &dyn Fn(f64, f64) -> f64| {
            let inside = pixels.iter().filter(|&&(y, x)| inside(y, x));
            inside.map(|&(y, x)| of(image.at(y, x).norm_sqr(), f64::from(target.at(y, x)))).sum::<f64>()
        };
        let scale = sum(&|p, t| p * t) / sum(&|p, _| p * p);
        let pull = Plane::from_fn(height_px, width_px, |y, x| {
            let u = image.at(y, x);
            let error = scale * u.norm_sqr() - f64::from(target.at(y, x));
            if inside(y, x) { u * (scale * error) } else { Complex64::ZERO }
        });
        let back = propagate(&pull, pitch_m, |fx, fy| transfer(fx, fy).conj());
        for (i, phase) in phase.values_mut().iter_mut().enumerate() {
            let slope = (slm.values()[i].conj() * back.values()[i]).im;
            let (first, second) = &mut moments[i];
            *first = 0.9 * *first + 0.1 * slope;
            *second = 0.999 * *second + 0.001 * slope * slope;
            let (mean, power) = (*first / (1.0 - 0.9f64.powi(iteration)), *second / (1.0 - 0.999f64.powi(iteration)));
            *phase -= 0.1 * mean / (power.sqrt() + 1e-20);
        }
    }
    phase.map(lightpath_optics::display::phase_response::wrap_f32)
}
