//! Double-phase encoding: a complex field becomes two phases on neighbouring pixels.
//!
//! ```text
//! a e^{iθ} = ½ ( e^{i(θ+δ)} + e^{i(θ−δ)} ),   δ = arccos a,   a = |c| / max |c|
//! ```
//!
//! c is the field on the SLM that would show the target. The pixels take θ+δ and θ−δ like the squares of a
//! chequerboard. The error of this encoding lies around the corners of the band, so c is first limited to the inner
//! half of the band. The method does not iterate. C.-K. Hsueh and A. Sawchuk, Applied Optics 17, 3874 (1978); A.
//! Maimone, A. Georgiou and J. Kollin, ACM Transactions on Graphics 36, 85 (2017).

use super::problem::ProblemCore;
use crate::engine::Real;
use crate::interrupt;
use crate::numerics::buffers::zeros;
use num_complex::Complex;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Taps of the low-pass filter on either side of its middle.
const REACH: usize = 8;

/// Returns the phases of all frames \[rad\] and the largest amplitude max |c|. The light is the target's divided by
/// max².
pub(super) fn double_phase<T: Real>(problem: &ProblemCore<T>, image_phase: &[T]) -> (Vec<T>, f64) {
    let (engine, frame_len) = (problem.engine(), problem.engine().height_px() * problem.engine().width_px());
    let (width_px, height_px) = (engine.width_px(), engine.height_px());
    let mut phases = vec![T::zero(); problem.parameters()];
    let mut scale = 0.0_f64;
    for (phase, image_phase) in phases.chunks_exact_mut(frame_len).zip(image_phase.chunks_exact(frame_len)) {
        let mut field = problem.back_propagated(image_phase);
        low_pass(&mut field, height_px, width_px);
        engine.slm.divide_by_source(&mut field);
        let rows = field.par_chunks(width_px).map(|row| row.iter().map(|c| c.norm_sqr().wide()).fold(0.0, f64::max));
        let largest = rows.reduce(|| 0.0, f64::max).sqrt();
        let norm = T::of(1.0 / largest.max(f64::MIN_POSITIVE));
        phase.par_chunks_mut(width_px).zip(field.par_chunks(width_px)).enumerate().for_each(|(y, (phase, row))| {
            interrupt::check();
            for (x, (phase, c)) in phase.iter_mut().zip(row).enumerate() {
                let c = c.scale(norm) - engine.slm.zero_order.scale(engine.slm.sign(y, x));
                // Rounding and the zero order may raise |c| slightly above one.
                let half_angle = c.norm().min(T::one()).acos();
                let angle = c.im.atan2(c.re);
                *phase = if (y + x) % 2 == 0 { angle + half_angle } else { angle - half_angle };
            }
            engine.slm.phases_to_display_row(y, phase);
        });
        scale = scale.max(largest);
    }
    (phases, scale)
}

/// Filters the field to the inner half of the band along both axes, with a sinc of two pixels under a Lanczos window.
fn low_pass<T: Real>(field: &mut [Complex<T>], height_px: usize, width_px: usize) {
    let sinc = |x: f64| if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) };
    let raw: Vec<f64> =
        (-(REACH as i32)..=REACH as i32).map(f64::from).map(|n| sinc(n / 2.0) * sinc(n / (REACH + 1) as f64)).collect();
    let sum: f64 = raw.iter().sum();
    let taps: Vec<T> = raw.iter().map(|tap| T::of(tap / sum)).collect();
    let zero = Complex::new(T::zero(), T::zero());
    let mut along_x: Vec<Complex<T>> = zeros(field.len());
    along_x.par_chunks_mut(width_px).zip(field.par_chunks(width_px)).for_each(|(out, row)| {
        interrupt::check();
        for (x, out) in out.iter_mut().enumerate() {
            *out = (0..taps.len())
                .filter_map(|k| Some(row.get((x + k).checked_sub(REACH)?)?.scale(taps[k])))
                .fold(zero, |sum, value| sum + value);
        }
    });
    field.par_chunks_mut(width_px).enumerate().for_each(|(y, out)| {
        interrupt::check();
        out.fill(zero);
        for (k, &tap) in taps.iter().enumerate() {
            let Some(from) = (y + k).checked_sub(REACH).filter(|from| *from < height_px) else { continue };
            for (out, value) in out.iter_mut().zip(&along_x[from * width_px..]) {
                *out = *out + value.scale(tap);
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::{DisplayModel, OpticalSetup};
    use crate::engine::Detector;
    use crate::engine::EngineCore;
    use crate::hologram::loss::{Loss, PlaneInput};
    use crate::metrics::{Gain, fitted_intensity_scale, psnr_db};
    use crate::numerics::{Grid, Plane, RegionOfInterest};
    use crate::test_cards::TestCard;
    use num_complex::Complex64;

    #[test]
    fn filtered_light_matches_target_divided_by_squared_amplitude() {
        let (height_px, width_px) = (120, 160);
        let grid = Grid::try_new(height_px, width_px, 8e-6).unwrap();
        let setup = OpticalSetup::try_new(grid, 515e-9, 8e-3).unwrap();
        let region = RegionOfInterest::middle(&grid);
        let engine = EngineCore::<f64>::new(&DisplayModel::ideal(setup), Detector::Point, None).unwrap();
        let target = TestCard::Portrait.render(height_px, width_px, 2).unwrap();
        let plane = PlaneInput { engine: engine.clone(), target: target.map(f64::from), weight: None, share: 1.0 };
        let problem = ProblemCore::with_planes(vec![plane], 1, region, Loss::default()).unwrap();
        let (phase, largest) = double_phase(&problem, &vec![0.0; height_px * width_px]);
        let mut field: Vec<Complex64> = phase.iter().map(|&phi| Complex64::cis(phi)).collect();
        low_pass(&mut field, height_px, width_px);
        let image = engine.propagate(&Plane::try_from_vec(height_px, width_px, field).unwrap()).unwrap();
        let light = image.map(|u| u.norm_sqr() as f32);
        let psnr_db = psnr_db(&light, &target, region, Gain::Fitted).unwrap();
        assert!(psnr_db > 25.0, "{psnr_db} dB");
        let gain = fitted_intensity_scale(&light, &target, region).unwrap();
        assert!((gain / largest.powi(2) - 1.0).abs() < 0.03, "gain {gain}, largest amplitude {largest}");
    }

    #[test]
    fn filter_keeps_inner_half_of_band() {
        let wave = |cycles_per_px: f64| {
            let (height_px, width_px) = (64, 64);
            let turn = |i: usize| Complex64::cis(2.0 * PI * cycles_per_px * (i % width_px) as f64);
            let mut field: Vec<Complex64> = (0..height_px * width_px).map(turn).collect();
            low_pass(&mut field, height_px, width_px);
            field[32 * width_px + 32].norm()
        };
        assert!((wave(0.0) - 1.0).abs() < 1e-9 && (wave(0.15) - 1.0).abs() < 0.02, "{}", wave(0.15));
        assert!(wave(0.35) < 0.02 && wave(0.5) < 0.01, "{} {}", wave(0.35), wave(0.5));
    }
}
