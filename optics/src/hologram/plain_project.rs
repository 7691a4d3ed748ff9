//! Projections of the slow twin: what the image sends back to the modulator, from the definition of the adjoint.
//!
//! ```text
//! (Aᴴ v)(x) = Σ_k ℓ_k(x) F⁻¹[ H_k* F v ](x)
//! ```

use super::evaluate::{Evaluation, Project};
use super::gerchberg_saxton::subtract_excess;
use super::plain::{PlainProblem, best_gain, widened};
use crate::display::Detector;
use crate::engine::slm::Slm;
use crate::metrics::Gain;
use crate::numerics::Plane;
use crate::reference::display_light::{Optics, behind_modulator, image, spread};
use num_complex::{Complex32, Complex64};

impl Project for PlainProblem {
    fn slm(&self) -> &Slm<f32> {
        &self.slm
    }

    fn target_amplitudes(&self) -> Vec<Plane<f32>> {
        self.planes.iter().map(|plane| plane.target.map(f32::sqrt)).collect()
    }

    fn back_propagated(&self, image_phase: &[f32]) -> Vec<Complex32> {
        let (height_px, width_px) = (self.size.height_px, self.size.width_px);
        let mut field = vec![Complex64::ZERO; self.size.frame_len()];
        for plane in &self.planes {
            let image = Plane::from_fn(height_px, width_px, |y, x| {
                let amplitude = f64::from(plane.target.at(y, x)).sqrt() * plane.weight(y, x) * plane.share;
                Complex64::from_polar(amplitude, image_phase[y * width_px + x].into())
            });
            let to_points = Optics::new(&plane.model, Detector::Point);
            let (_, first_mode) = &to_points.modes[0];
            to_points.add_returned(&image, &first_mode[0], &mut field);
        }
        narrowed(&field)
    }

    fn project(&mut self, phase: &mut [f32], wanted: &mut [Plane<f32>], weighted: bool) -> Evaluation {
        let exact = widened(phase);
        let lights = self.lights_of_planes(&exact);
        let mut wanted_exact: Vec<_> = wanted.iter().map(|wanted| wanted.map(f64::from)).collect();
        if weighted {
            self.raise(&lights, &mut wanted_exact);
            wanted.iter_mut().zip(&wanted_exact).for_each(|(wanted, exact)| *wanted = exact.map(|value| value as f32));
        }
        let excess = narrowed(&self.excess(&exact, &lights, &wanted_exact));
        subtract_excess(&self.slm, self.size.frame_len(), &excess, phase);
        self.compare(&lights, Gain::Given(1.0), 0.0)
    }
}

impl PlainProblem {
    /// Excess of the field of all frames on the modulator, see [Gerchberg–Saxton](super::gerchberg_saxton): the mean over
    /// the planes of Aᴴ[ Bᵀ( w · ( 1 − W√t / (s√p) ) ) · u ]. `wanted` holds W√t.
    fn excess(&self, phase: &[f64], lights: &[Vec<Plane<f64>>], wanted: &[Plane<f64>]) -> Vec<Complex64> {
        let gain = best_gain(&self.compared(lights, f64::sqrt, wanted));
        let places = self.detector.places_px().len();
        let mut excess = vec![Complex64::ZERO; phase.len()];
        for ((plane, lights), wanted) in self.planes.iter().zip(lights).zip(wanted) {
            let slope = |light: &Plane<f64>| {
                let relative = |y, x| plane.weight(y, x) * (1.0 - wanted.at(y, x) / (gain * light.at(y, x).sqrt()));
                let (height_px, width_px) = (self.size.height_px, self.size.width_px);
                let inside = |y, x| self.region.columns(y).is_some_and(|columns| columns.contains(&x));
                spread(
                    &plane.model,
                    &Plane::from_fn(height_px, width_px, |y, x| if inside(y, x) { relative(y, x) } else { 0.0 }),
                )
            };
            let slopes: Vec<_> = lights.iter().map(slope).collect();
            let frames = phase.chunks_exact(self.size.frame_len()).zip(excess.chunks_exact_mut(self.size.frame_len()));
            for (phase, excess) in frames {
                let spectra = plane.optics.spectra(&behind_modulator(&plane.model, plane.carrier, phase));
                for (share, to_places) in &plane.optics.modes {
                    for (place, transfers) in to_places.iter().enumerate() {
                        let (image, slopes) = (image(&spectra, transfers), &slopes[place % slopes.len()]);
                        let factor = plane.share * share / places as f64;
                        let field = Plane::from_fn(slopes.height_px(), slopes.width_px(), |y, x| {
                            image.at(y, x) * (slopes.at(y, x) * factor)
                        });
                        plane.optics.add_returned(&field, transfers, excess);
                    }
                }
            }
        }
        excess
    }

    /// W ← W · √t / (s√p), with W between ⅓ and 3, at every pixel. `wanted` holds W√t.
    fn raise(&self, lights: &[Vec<Plane<f64>>], wanted: &mut [Plane<f64>]) {
        let amplitudes: Vec<_> = self.planes.iter().map(|plane| plane.target.map(|t| f64::from(t).sqrt())).collect();
        let gain = best_gain(&self.compared(lights, f64::sqrt, &amplitudes));
        for ((lights, amplitude), wanted) in lights.iter().zip(&amplitudes).zip(wanted) {
            *wanted = Plane::from_fn(self.size.height_px, self.size.width_px, |y, x| {
                let light = lights.iter().map(|light| light.at(y, x)).sum::<f64>() / lights.len() as f64;
                let (target, shown) = (amplitude.at(y, x), gain * light.sqrt());
                if target == 0.0 {
                    return wanted.at(y, x);
                }
                (wanted.at(y, x) * target / shown.max(target / 3.0)).clamp(target / 3.0, 3.0 * target)
            });
        }
    }
}

fn narrowed(field: &[Complex64]) -> Vec<Complex32> {
    field.iter().map(|c| Complex32::new(c.re as f32, c.im as f32)).collect()
}
