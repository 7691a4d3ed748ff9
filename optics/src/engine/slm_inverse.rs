//! Inverse of the model of the SLM ([`Slm`]): finds the phase that shows a wanted field.

use super::slm::{ShownRow, Slm};
use crate::numerics::real::{Number, unit};
use num_complex::Complex;
use std::f64::consts::{PI, TAU};

impl<T: Number> Slm<T> {
    /// Computes the phases along row `y` with which the phase of the light is nearest to that of the `wanted` field c:
    /// r(φ) = arg(k c/a − z₀). Cross-talk is ignored.
    pub(crate) fn phase_of_row(&self, y: usize, wanted: &[Complex<T>], phase: &mut [T]) {
        for (x, (phase, &wanted)) in phase.iter_mut().zip(wanted).enumerate() {
            let wanted = wanted.scale(self.sign(y, x));
            let modulated = match &self.source {
                None => wanted - self.zero_order,
                // Multiplying by |a|² gives arg(c/a − z₀) without a division by a dark source.
                Some(source) => {
                    let a = source[y * self.width_px + x];
                    wanted * a.conj() - self.zero_order.scale(a.norm_sqr())
                }
            };
            *phase = self.inverse_response(y, x, modulated.im.atan2(modulated.re)) - self.grating(y, x);
        }
    }

    /// Replaces the wanted phases of the light in `row` by the phases to display. The zero order and cross-talk are
    /// ignored.
    pub(crate) fn phases_to_display_row(&self, y: usize, row: &mut [T]) {
        for (x, phase) in row.iter_mut().enumerate() {
            let grating = self.grating(y, x);
            *phase = self.inverse_response(y, x, *phase + grating) - grating;
        }
    }

    /// Replaces a field c by c / a, the field relative to the source; 0 where no light falls on the SLM.
    pub(crate) fn divide_by_source(&self, field: &mut [Complex<T>]) {
        /// Smallest amplitude of the source, in its own unit. Pixels with less light count as dark.
        const SOURCE_MIN: f64 = 1e-3;
        let Some(source) = &self.source else { return };
        for (c, &a) in field.iter_mut().zip(source) {
            let dark = a.norm_sqr() < T::of(SOURCE_MIN * SOURCE_MIN);
            *c = if dark { Complex::new(T::zero(), T::zero()) } else { *c / a };
        }
    }

    /// Sign k of the grating at a pixel: −1 where the carrier adds π, otherwise 1.
    pub(crate) fn sign(&self, y: usize, x: usize) -> T {
        if self.carrier.is_some_and(|carrier| carrier.is_odd(y, x)) { -T::one() } else { T::one() }
    }

    /// Phase that the carrier adds at a pixel \[rad\].
    fn grating(&self, y: usize, x: usize) -> T {
        if self.carrier.is_some_and(|carrier| carrier.is_odd(y, x)) { T::of(PI) } else { T::zero() }
    }

    /// Changes the displayed phases along row `y`, which show `shown`, towards those of [`Self::phase_of_row`]. With
    /// cross-talk this has a fixed point, while repeating [`Self::phase_of_row`] blurs the phases again and again.
    pub(crate) fn approach_phase_of_row(
        &self,
        y: usize,
        shown: ShownRow<'_, T>,
        wanted: &[Complex<T>],
        phase: &mut [T],
    ) {
        let mut towards = vec![T::zero(); phase.len()];
        self.phase_of_row(y, wanted, &mut towards);
        for (x, ((phase, &towards), &shown)) in phase.iter_mut().zip(&towards).zip(shown.phases()).enumerate() {
            let change = unit(towards + self.grating(y, x) - shown);
            *phase = *phase + change.im.atan2(change.re);
        }
    }

    /// Finds φ with r(φ) = `wanted` modulo 2π at a pixel, by Newton's method. If the response varies over the SLM, φ is
    /// in [0, 2π], and the nearest phase is found where the response does not reach the wanted one.
    fn inverse_response(&self, y: usize, x: usize, wanted: T) -> T {
        /// Number of Newton steps. Responses are nearly linear: the error starts at a few tenths, and each step squares
        /// it.
        const STEPS: usize = 6;
        /// Smallest slope that a step divides by. With a smaller slope the step would overshoot.
        const SLOPE_MIN: f64 = 0.25;
        if self.harmonics.is_empty() && self.phase_gain.is_none() {
            return wanted;
        }
        let gain = self.phase_gain.as_ref().map(|gain| gain[y * self.width_px + x]);
        let (one, full) = (T::one(), T::of(TAU));
        let mut phase = match gain {
            Some(gain) => (wanted - full * (wanted / full).floor()) / gain.max(T::of(SLOPE_MIN)),
            None => wanted,
        };
        for _ in 0..STEPS {
            let (slope, modulated) = self.response(gain.unwrap_or(one), phase);
            let away = modulated * unit(-wanted);
            phase = phase - away.im.atan2(away.re) / slope.max(T::of(SLOPE_MIN));
        }
        if gain.is_none() || (T::zero()..=full).contains(&phase) {
            return phase;
        }
        let nearness = |phase: T| (self.response(gain.unwrap_or(one), phase).1 * unit(-wanted)).re;
        if nearness(T::zero()) > nearness(full) { T::zero() } else { full }
    }

    /// Computes r′(φ) and e^{i r(φ)} where the response has this gain 1 + v.
    fn response(&self, gain: T, phase: T) -> (T, Complex<T>) {
        let turn = unit(phase);
        let (mut response, mut slope, mut power) = (gain * phase, gain, turn);
        for (k, &[a, b]) in self.harmonics.iter().enumerate() {
            response = response + a * power.im + b * power.re;
            slope = slope + T::of((k + 1) as f64) * (a * power.re - b * power.im);
            power = power * turn;
        }
        (slope, unit(response))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::Carrier;
    use num_complex::Complex64;

    #[test]
    fn phase_of_field_reproduces_field() {
        let (height_px, width_px) = (5, 24);
        let mut slm = Slm::<f64>::ideal(width_px, Some(Carrier::HalfOrderX));
        slm.harmonics = vec![[0.2, -0.1], [0.03, 0.05]];
        slm.zero_order = Complex64::new(0.05, -0.03);
        slm.source =
            Some((0..height_px * width_px).map(|i| Complex64::from_polar(0.5 + 0.02 * i as f64, 0.1)).collect());
        for y in 0..height_px {
            let phase: Vec<f64> = (0..width_px).map(|x| (3.7 * x as f64 + y as f64) % 6.2).collect();
            let (mut field, mut found) = (vec![Complex64::ZERO; width_px], vec![0.0; width_px]);
            slm.field_row(y, slm.displayed_row(&phase).unwrap(), &mut field);
            slm.phase_of_row(y, &field, &mut found);
            for (a, b) in phase.iter().zip(&found) {
                assert!(((a - b) / 2.0).sin().abs() < 1e-9, "{a} {b}");
            }
        }
    }

    #[test]
    fn phase_of_field_is_found_where_response_varies() {
        let width_px = 24;
        let mut slm = Slm::<f64>::ideal(width_px, Some(Carrier::HalfOrderX));
        slm.harmonics = vec![[0.1, -0.05]];
        slm.phase_gain = Some((0..width_px).map(|x| 0.85 + 0.0125 * x as f64).collect());
        let phase: Vec<f64> = (0..width_px).map(|x| (3.7 * x as f64) % 6.2).collect();
        let (mut field, mut again) = (vec![Complex64::ZERO; width_px], vec![Complex64::ZERO; width_px]);
        slm.field_row(0, slm.shown(&phase).row(0), &mut field);
        let mut found = vec![0.0; width_px];
        slm.phase_of_row(0, &field, &mut found);
        slm.field_row(0, slm.shown(&found).row(0), &mut again);
        assert!(field.iter().zip(&again).all(|(a, b)| (a - b).norm() < 1e-9), "{field:?} {again:?}");
        // Where the response does not reach a phase, the nearest end is found.
        slm.harmonics.clear();
        slm.phase_of_row(0, &[Complex64::cis(5.5)], &mut found[..1]);
        assert!((found[0] - TAU).abs() < 1e-12, "{}", found[0]);
    }

    #[test]
    fn field_of_blurred_phases_leaves_phases_unchanged() {
        let width_px = 24;
        let mut slm = Slm::<f64>::ideal(width_px, Some(Carrier::HalfOrderX));
        slm.crosstalk = Some(crate::display::Crosstalk { ratio_x: 0.1, ratio_y: 0.05 });
        let phase: Vec<f64> = (0..3 * width_px).map(|i| (3.7 * i as f64) % 6.2).collect();
        let shown = slm.shown(&phase);
        for y in 0..3 {
            let (mut field, mut found) = (vec![Complex64::ZERO; width_px], phase[y * width_px..][..width_px].to_vec());
            slm.field_row(y, shown.row(y), &mut field);
            slm.approach_phase_of_row(y, shown.row(y), &field, &mut found);
            assert!(found.iter().zip(&phase[y * width_px..]).all(|(a, b)| (a - b).abs() < 1e-12));
        }
    }

    #[test]
    fn wanted_phases_of_light_are_shown_despite_response_and_carrier() {
        let mut slm = Slm::<f64>::ideal(16, Some(Carrier::HalfOrderY));
        slm.harmonics = vec![[0.2, -0.1]];
        let wanted: Vec<f64> = (0..16).map(|x| 0.4 * f64::from(x)).collect();
        for y in 0..2 {
            let (mut phase, mut field) = (wanted.clone(), vec![Complex64::ZERO; 16]);
            slm.phases_to_display_row(y, &mut phase);
            slm.field_row(y, slm.displayed_row(&phase).unwrap(), &mut field);
            // The field includes the grating's sign: φ + π is shown as −1 · −e^{iφ}.
            for (wanted, c) in wanted.iter().zip(&field) {
                assert!((Complex64::cis(*wanted) - c).norm() < 1e-9, "row {y}: {wanted} {c}");
            }
        }
    }
}
