//! Dust and fringes in the light on the SLM: a complex factor for each pixel.
//!
//! ```text
//! factor(y, x) = exp( s (A + i B)(y, x) ),   s = 10⁻⁴,   A, B = −32767 … 32767
//! ```
//!
//! The factor multiplies the smooth source. Grains of dust and scratches are a few pixels wide, and the rings of dust
//! before the SLM some dozens (J. W. Goodman, *Speckle Phenomena in Optics*, 2007), so no short series holds them. A
//! and B are integers, so that every form of a kernel holds the same factors.

use super::Part;
use super::measures::{Measures, Scale, Unit};
use super::stored::{Entry, Numbers, Restored, Stored, StoredParts};
use super::terms::{Terms, Turn};
use crate::display::DisplayModel;
use crate::error::Result;
use crate::numerics::Plane;
use crate::numerics::smooth_field::out_of_range;
use num_complex::Complex64;
use std::sync::Arc;

/// Least relative decrease of the validation loss by which learning keeps dust, which makes a kernel of some kilobytes
/// one of megabytes.
const GAIN_MIN: f64 = 0.2;

/// Dust and fringes in the light on the SLM; cheap to clone.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dust(Option<Arc<Plane<[i16; 2]>>>);

impl Dust {
    /// s: logarithm of the amplitude, and phase \[rad\], of one step of A and B.
    pub const STEP: f64 = 1e-4;

    /// No dust.
    #[must_use]
    pub fn none() -> Self {
        Self(None)
    }

    /// Dust with A and B for each pixel.
    #[must_use]
    pub fn new(steps: Plane<[i16; 2]>) -> Self {
        Self(Some(Arc::new(steps)))
    }

    /// The dust that is nearest to the factors exp(`exponents[2i]` + i·`exponents[2i + 1]`), row by row.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) if the number of exponents is not twice the number of
    /// pixels.
    pub fn nearest(height_px: usize, width_px: usize, exponents: &[f32]) -> Result<Self> {
        let largest = f64::from(i16::MAX);
        let step = |value: f32| (f64::from(value) / Self::STEP).round().clamp(-largest, largest) as i16;
        let steps = exponents.as_chunks().0.iter().map(|pair: &[f32; 2]| pair.map(step)).collect();
        Ok(Self::new(Plane::try_from_vec(height_px, width_px, steps)?))
    }

    /// Whether all factors are 1.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.0.is_none()
    }

    /// A and B of each pixel; `None` without dust.
    #[must_use]
    pub fn steps(&self) -> Option<&Plane<[i16; 2]>> {
        self.0.as_deref()
    }

    /// Factor of the light on the pixel in row `y` and column `x`.
    #[must_use]
    pub fn factor(&self, y: usize, x: usize) -> Complex64 {
        match &self.0 {
            Some(steps) => Self::factor_of(steps.at(y, x)),
            None => Complex64::ONE,
        }
    }

    /// The exponents of the factors with these steps: the logarithm of the amplitude and the phase of each pixel in
    /// turn.
    pub(crate) fn exponents_of(steps: &Plane<[i16; 2]>) -> Vec<f32> {
        steps.values().as_flattened().iter().map(|&step| (f64::from(step) * Self::STEP) as f32).collect()
    }

    /// The factor of one pixel's A and B.
    pub(crate) fn factor_of(steps: [i16; 2]) -> Complex64 {
        let [log_amplitude, phase] = steps.map(|step| f64::from(step) * Self::STEP);
        Complex64::from_polar(log_amplitude.exp(), phase)
    }

    /// Contrast: root mean square of factor − 1 over the SLM.
    #[must_use]
    pub fn contrast(&self) -> f64 {
        self.0.as_ref().map_or(0.0, |steps| {
            let squares = steps.values().iter().map(|&steps| (Self::factor_of(steps) - 1.0).norm_sqr());
            (squares.sum::<f64>() / steps.values().len() as f64).sqrt()
        })
    }

    pub(crate) fn validate(&self, height_px: usize, width_px: usize) -> Result<()> {
        match &self.0 {
            Some(steps) => {
                steps.expect_size("dust", height_px, width_px)?;
                match steps.values().as_flattened().contains(&i16::MIN) {
                    true => Err(out_of_range("dust", f64::from(i16::MIN), "-32767 to 32767")),
                    false => Ok(()),
                }
            }
            None => Ok(()),
        }
    }
}

/// It has no numbers in θ: a fit of its own finds the factor of each pixel.
pub(super) struct Row;

impl Part for Row {
    fn name(&self) -> &'static str {
        "dust"
    }

    fn title(&self) -> &'static str {
        "dust and fringes"
    }

    fn is_in(&self, model: &DisplayModel) -> bool {
        !model.dust.is_none()
    }

    fn remove(&self, model: &mut DisplayModel) {
        model.dust = Dust::none();
    }

    fn store(&self, model: &DisplayModel, to: &mut Stored) {
        if let Some(steps) = model.dust.steps() {
            to.sometimes("has_dust", Entry::Flag(true));
            let numbers = Numbers::I16(steps.values().as_flattened().to_vec());
            to.array("dust", &[steps.height_px(), steps.width_px(), 2], numbers);
        }
    }

    fn restore(&self, from: &dyn StoredParts, model: &mut DisplayModel) -> Restored {
        if from.flag("has_dust")? {
            model.dust = Dust::new(from.i16_pairs("dust")?);
        }
        Ok(())
    }

    fn terms(&self) -> Option<Terms> {
        Some(Terms::new(Turn::OwnFit, GAIN_MIN, GAIN_MIN))
    }

    fn measures(&self) -> &'static Measures {
        &Measures {
            phrase: "contrast of {}",
            scales: &[Scale { name: "contrast", unit: Unit::Fraction, digits: 1 }],
            note: "",
        }
    }

    fn strengths(&self, model: &DisplayModel) -> Vec<f64> {
        vec![model.dust.contrast()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_factors_are_within_half_a_step() {
        let exponents: Vec<f32> = (0..24).map(|i| 0.8 * (i as f32 * 1.7).sin()).collect();
        let dust = Dust::nearest(3, 4, &exponents).unwrap();
        for (i, pair) in exponents.chunks_exact(2).enumerate() {
            let exact = Complex64::new(f64::from(pair[0]), f64::from(pair[1])).exp();
            assert!((dust.factor(i / 4, i % 4) / exact - 1.0).norm() < 0.75e-4);
        }
        assert_eq!(Dust::none().factor(2, 1), Complex64::ONE);
        assert_eq!(Dust::nearest(1, 1, &[9.0, -9.0]).unwrap().steps().unwrap().values(), [[32767, -32767]]);
    }

    #[test]
    fn contrast_is_that_of_the_factors() {
        let dust = Dust::new(Plane::from_fn(2, 2, |y, _| [if y == 0 { 0 } else { 953 }, 0]));
        assert!((dust.contrast() - 0.1 / 2.0_f64.sqrt()).abs() < 1e-4);
        assert_eq!(Dust::none().contrast(), 0.0);
    }

    #[test]
    fn impossible_dust_is_refused_by_name() {
        let dust = Dust::new(Plane::filled(2, 3, [0, i16::MIN]));
        assert!(dust.validate(2, 3).unwrap_err().to_string().starts_with("dust is -32768"));
        assert!(dust.validate(3, 2).unwrap_err().to_string().contains("dust"));
        assert!(Dust::none().validate(3, 2).is_ok());
    }
}
