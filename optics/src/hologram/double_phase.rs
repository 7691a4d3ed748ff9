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

use super::evaluate::{ProblemSize, Project};
use crate::interrupt;
use num_complex::Complex32;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Taps of the low-pass filter on either side of its middle.
const REACH: usize = 8;

/// Returns the phases of all frames \[rad\] and the largest amplitude max |c|. The light is the target's divided by
/// max².
pub(super) fn double_phase(problem: &dyn Project, image_phase: &[f32]) -> (Vec<f32>, f64) {
    let (size, slm) = (problem.size(), problem.slm());
    let ProblemSize { height_px, width_px, .. } = size;
    let mut phases = vec![0.0; size.parameters()];
    let mut scale = 0.0_f64;
    for (phase, image_phase) in
        phases.chunks_exact_mut(size.frame_len()).zip(image_phase.chunks_exact(size.frame_len()))
    {
        let mut field = problem.back_propagated(image_phase);
        low_pass(&mut field, height_px, width_px);
        slm.divide_by_source(&mut field);
        let rows =
            field.par_chunks(width_px).map(|row| row.iter().map(|c| f64::from(c.norm_sqr())).fold(0.0, f64::max));
        let largest = rows.reduce(|| 0.0, f64::max).sqrt();
        let norm = (1.0 / largest.max(f64::MIN_POSITIVE)) as f32;
        phase.par_chunks_mut(width_px).zip(field.par_chunks(width_px)).enumerate().for_each(|(y, (phase, row))| {
            interrupt::check();
            for (x, (phase, c)) in phase.iter_mut().zip(row).enumerate() {
                let c = c.scale(norm) - slm.zero_order.scale(slm.sign(y, x));
                // Rounding and the zero order may raise |c| slightly above one.
                let half_angle = c.norm().min(1.0).acos();
                let angle = c.im.atan2(c.re);
                *phase = if (y + x) % 2 == 0 { angle + half_angle } else { angle - half_angle };
            }
            slm.phases_to_display_row(y, phase);
        });
        scale = scale.max(largest);
    }
    (phases, scale)
}

/// Filters the field to the inner half of the band along both axes, with a sinc of two pixels under a Lanczos window.
fn low_pass(field: &mut [Complex32], height_px: usize, width_px: usize) {
    let sinc = |x: f64| if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) };
    let raw: Vec<f64> =
        (-(REACH as i32)..=REACH as i32).map(f64::from).map(|n| sinc(n / 2.0) * sinc(n / (REACH + 1) as f64)).collect();
    let sum: f64 = raw.iter().sum();
    let taps: Vec<f32> = raw.iter().map(|tap| (tap / sum) as f32).collect();
    let mut along_x = vec![Complex32::ZERO; field.len()];
    along_x.par_chunks_mut(width_px).zip(field.par_chunks(width_px)).for_each(|(out, row)| {
        interrupt::check();
        for (x, out) in out.iter_mut().enumerate() {
            *out = (0..taps.len()).filter_map(|k| Some(row.get((x + k).checked_sub(REACH)?)?.scale(taps[k]))).sum();
        }
    });
    field.par_chunks_mut(width_px).enumerate().for_each(|(y, out)| {
        interrupt::check();
        out.fill(Complex32::ZERO);
        for (k, &tap) in taps.iter().enumerate() {
            let Some(from) = (y + k).checked_sub(REACH).filter(|from| *from < height_px) else { continue };
            for (out, value) in out.iter_mut().zip(&along_x[from * width_px..]) {
                *out += value.scale(tap);
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::{Detector, DisplayModel, OpticalSetup};
    use crate::engine::Engine;
    use crate::hologram::HologramProblem;
    use crate::metrics::{Gain, fitted_intensity_scale, psnr_db};
    use crate::numerics::{Grid, Plane, RegionOfInterest};
    use crate::pictures_of_tests::picture;

    #[test]
    fn filtered_light_matches_target_divided_by_squared_amplitude() {
        let (height_px, width_px) = (120, 160);
        let grid = Grid::try_new(height_px, width_px, 8e-6).unwrap();
        let setup = OpticalSetup::try_new(grid, 515e-9, 8e-3).unwrap();
        let region = RegionOfInterest::middle(&grid);
        let engine = Engine::new(&DisplayModel::ideal(setup), Detector::Point, None).unwrap();
        let target = picture(height_px, width_px, 2);
        let problem = HologramProblem::new(engine.clone(), target.clone(), region).unwrap();
        let (phase, largest) = double_phase(&*problem.body, &vec![0.0; height_px * width_px]);
        let mut field: Vec<Complex32> = phase.iter().map(|&phi| Complex32::cis(phi)).collect();
        low_pass(&mut field, height_px, width_px);
        let image = engine.propagate(&Plane::try_from_vec(height_px, width_px, field).unwrap()).unwrap();
        let light = image.map(|u| u.norm_sqr());
        let psnr_db = psnr_db(&light, &target, region, Gain::Fitted).unwrap();
        assert!(psnr_db > 25.0, "{psnr_db} dB");
        let gain = fitted_intensity_scale(&light, &target, region).unwrap();
        assert!((gain / largest.powi(2) - 1.0).abs() < 0.03, "gain {gain}, largest amplitude {largest}");
    }

    #[test]
    fn filter_keeps_inner_half_of_band() {
        let wave = |cycles_per_px: f64| {
            let (height_px, width_px) = (64, 64);
            let turn = |i: usize| Complex32::cis((2.0 * PI * cycles_per_px * (i % width_px) as f64) as f32);
            let mut field: Vec<Complex32> = (0..height_px * width_px).map(turn).collect();
            low_pass(&mut field, height_px, width_px);
            field[32 * width_px + 32].norm()
        };
        assert!((wave(0.0) - 1.0).abs() < 1e-6 && (wave(0.15) - 1.0).abs() < 0.02, "{}", wave(0.15));
        assert!(wave(0.35) < 0.02 && wave(0.5) < 0.01, "{} {}", wave(0.35), wave(0.5));
    }
}
