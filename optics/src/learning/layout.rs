//! Which parameter of a model stands where in θ.
//!
//! α and ψ of the kernel, log amplitude and phase of the source, [a_k, b_k] of the phase response, and the zero order's two
//! parts; of `smooth` the kernel alone. Gain and offset are each photograph's own.

use super::LearnModel;
use crate::chebyshev::ChebyshevBasis;
use crate::{DisplayModel, KernelShape, OpticalSetup, SmoothField};
use num_complex::Complex64;

/// Highest total degree of the source profile.
pub(super) const SOURCE_ORDER: usize = 4;
/// Harmonics of the phase response.
pub(super) const HARMONICS: usize = 3;

/// Which parameter stands where in θ.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    pub(super) kernel: ChebyshevBasis,
    pub(super) source: ChebyshevBasis,
    pub(super) harmonics: usize,
    zero_order: usize,
}

/// What a parameter describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// The phase's terms T_1(fx) and T_1(fy): where the image lies.
    Tilt,
    /// Any other term of the kernel.
    Kernel,
    /// Source, phase response or zero order.
    Slm,
}

impl Layout {
    /// Of a model with a kernel up to total degree `order`.
    pub(super) fn new(model: LearnModel, order: usize) -> Self {
        let (source, harmonics, zero_order) = match model {
            LearnModel::Smooth { .. } => (0, 0, 0),
            LearnModel::Display { .. } => (SOURCE_ORDER, HARMONICS, 2),
            LearnModel::Paper | LearnModel::Dense => unreachable!("models of bins are learned by their own method"),
        };
        Self { kernel: ChebyshevBasis::new(order), source: ChebyshevBasis::new(source), harmonics, zero_order }
    }

    pub(super) fn len(&self) -> usize {
        self.zero_order() + self.zero_order
    }

    pub(super) fn source(&self) -> usize {
        2 * self.kernel.terms()
    }

    pub(super) fn response(&self) -> usize {
        self.source() + 2 * self.source.terms()
    }

    pub(super) fn zero_order(&self) -> usize {
        self.response() + 2 * self.harmonics
    }

    pub(super) fn has_slm(&self) -> bool {
        self.len() > self.source()
    }

    /// What the parameter at a place of θ describes.
    pub(super) fn part(&self, place: usize) -> Part {
        if place >= self.source() {
            return Part::Slm;
        }
        let degrees = place.checked_sub(self.kernel.terms()).and_then(|term| self.kernel.degrees().nth(term));
        match degrees {
            Some((0, 1) | (1, 0)) => Part::Tilt,
            _ => Part::Kernel,
        }
    }

    /// The display that θ describes.
    pub(super) fn model(&self, setup: &OpticalSetup, (gain, offset): (f64, f64), parameters: &[f64]) -> DisplayModel {
        let smooth = |basis: ChebyshevBasis, start: usize| {
            let (log_amplitude, rest) = parameters[start..].split_at(basis.terms());
            SmoothField {
                order: basis.order(),
                log_amplitude: log_amplitude.to_vec(),
                phase: rest[..basis.terms()].to_vec(),
            }
        };
        let zero_order = &parameters[self.zero_order()..self.len()];
        DisplayModel {
            setup: *setup,
            kernel: KernelShape::Smooth(smooth(self.kernel, 0)),
            source: smooth(self.source, self.source()),
            response: parameters[self.response()..self.zero_order()].as_chunks().0.to_vec(),
            zero_order: zero_order.first_chunk().map_or(Complex64::ZERO, |&[re, im]| Complex64::new(re, im)),
            gain,
            offset,
        }
    }

    /// θ of the same display in a layout that differs in the kernel's order; terms that it lacks are left out.
    pub(super) fn carried(&self, theta: &[f64], to: &Self) -> Vec<f64> {
        let (log_amplitude, rest) = theta.split_at(self.kernel.terms());
        let (phase, slm) = rest.split_at(self.kernel.terms());
        let mut carried = coefficients(to.kernel, self.kernel, log_amplitude);
        carried.extend(coefficients(to.kernel, self.kernel, phase));
        carried.extend(slm);
        carried
    }

    /// θ of a display, as far as this layout can describe it: what it has no place for is left out.
    pub(super) fn parameters(&self, model: &DisplayModel) -> Vec<f64> {
        let mut parameters = Vec::with_capacity(self.len());
        let mut push = |basis: ChebyshevBasis, field: Option<&SmoothField>| match field {
            Some(field) => {
                parameters.extend(coefficients(basis, field.basis(), &field.log_amplitude));
                parameters.extend(coefficients(basis, field.basis(), &field.phase));
            }
            None => parameters.extend(vec![0.0; 2 * basis.terms()]),
        };
        let KernelShape::Smooth(kernel) = &model.kernel else { return vec![0.0; self.len()] };
        push(self.kernel, Some(kernel));
        push(self.source, Some(&model.source));
        for harmonic in 0..self.harmonics {
            parameters.extend(model.response.get(harmonic).copied().unwrap_or_default());
        }
        parameters.extend([model.zero_order.re, model.zero_order.im].iter().take(self.zero_order));
        parameters
    }
}

/// The same series in another basis, without the terms that it lacks.
fn coefficients(to: ChebyshevBasis, from: ChebyshevBasis, values: &[f64]) -> Vec<f64> {
    let value = |degree: (usize, usize)| from.degrees().zip(values).find(|(at, _)| *at == degree).map(|(_, v)| *v);
    to.degrees().map(|degree| value(degree).unwrap_or(0.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Grid;

    #[test]
    fn a_display_keeps_its_shape_in_a_larger_basis() {
        let setup = OpticalSetup::try_new(Grid::try_new(18, 23, 8e-6).unwrap(), 515e-9, 2e-3).unwrap();
        let small = Layout::new(LearnModel::Display { order: None }, 3);
        let theta: Vec<f64> = (0..small.len()).map(|i| (i as f64 * 1.3 + 0.5).sin()).collect();
        let model = small.model(&setup, (0.7, 0.1), &theta);
        let large = Layout::new(LearnModel::Display { order: None }, 8);
        let again = large.model(&setup, (model.gain, model.offset), &large.parameters(&model));
        let (KernelShape::Smooth(before), KernelShape::Smooth(after)) = (&model.kernel, &again.kernel) else {
            panic!()
        };
        for (x, y) in [(-0.9, 0.2), (0.3, 0.7), (1.0, -1.0)] {
            assert!((before.value(x, y) - after.value(x, y)).norm() < 1e-12);
        }
        let kernel = KernelShape::Ideal;
        assert_eq!(DisplayModel { kernel: kernel.clone(), ..again }, DisplayModel { kernel, ..model });
    }
}
