//! What the fits of learning ask of a [layout](Layout) of θ.

use super::adjoint::{Adjoint, ModeAdjoint, OrdersAdjoint, SeriesGradient};
use super::options::KernelModel;
use crate::display::SpatialVariation;
use crate::display::parts::blocks::Blocks;
pub(super) use crate::display::parts::layout::Layout;
use crate::display::parts::spatial_variation::local_kernels;
use crate::display::parts::{Block, ModelPart};
use crate::engine::Real;
use crate::numerics::chebyshev::ChebyshevBasis;

/// The part of the display that a parameter describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// The terms T_1(fx) and T_1(fy) of the kernel's phase, in the band and beyond it, which move the image.
    Tilt,
    /// A term of the kernel other than these tilts.
    Kernel,
    /// A parameter of the source, the phase response, the zero order, the blur of the light, the variation over the
    /// SLM, or the modes of light.
    Slm,
}

impl Layout {
    /// Layout of a model with a kernel of total degree up to `order` and some blocks.
    pub(super) fn of(model: KernelModel, order: usize, blocks: Blocks) -> Self {
        match model {
            KernelModel::Smooth => Self::new(false, order, blocks),
            KernelModel::Display | KernelModel::Varying => Self::new(true, order, blocks),
            KernelModel::Paper | KernelModel::Dense => unreachable!("models of bins are learned by their own method"),
        }
    }

    /// Positions of the kernel's tilts along x and y.
    pub(super) fn tilts(&self) -> impl Iterator<Item = usize> + use<> {
        let kernel = self.kernel;
        let term = move |wanted| kernel.degrees().position(|degrees| degrees == wanted);
        [(1, 0), (0, 1)].into_iter().filter_map(term).map(move |term| kernel.terms() + term)
    }

    pub(super) fn has_slm(&self) -> bool {
        self.len() > self.source()
    }

    /// The part of the display that the parameter at a position of θ describes.
    pub(super) fn part(&self, position: usize) -> Part {
        if position >= self.source() {
            return Part::Slm;
        }
        let phase = |start: usize, basis: ChebyshevBasis| {
            position.checked_sub(start + basis.terms()).and_then(|term| basis.degrees().nth(term))
        };
        match phase(0, self.kernel).or_else(|| phase(self.beyond(), self.beyond)) {
            Some((0, 1) | (1, 0)) => Part::Tilt,
            _ => Part::Kernel,
        }
    }

    /// The gradient with respect to θ.
    pub(super) fn gradient(&self, adjoint: &Adjoint) -> Vec<f64> {
        let mut gradient = vec![0.0; self.len()];
        for (m, ModeAdjoint { light, kernels }) in adjoint.modes.iter().enumerate() {
            self.add_local_gradients(kernels.len().isqrt(), kernels, &mut gradient);
            if let Some(further) = m.checked_sub(1) {
                self.add_mode_gradients(further, kernels, &mut gradient);
                // The share of the light is the square of an amplitude, and the gain compensates what the other modes
                // lose.
                gradient[self.mode_light(further)] = *light;
            }
        }
        let mut write = |start: usize, values: &[f64]| gradient[start..][..values.len()].copy_from_slice(values);
        if let Some(OrdersAdjoint { band, beyond, .. }) = &adjoint.orders {
            for (start, (alpha, psi)) in [(0, band), (self.beyond(), beyond)] {
                write(start, alpha);
                write(start + alpha.len(), psi);
            }
        }
        if let (Some(ghost), true) = (adjoint.ghost, self.blocks.contains(Block::Ghost)) {
            write(self.start(ModelPart::Ghost), &ghost);
        }
        if let (Some(blur), true) = (adjoint.blur, self.blocks.contains(Block::LightBlur)) {
            write(self.start(ModelPart::LightBlur), &blur);
        }
        if let Some(modulator) = &adjoint.modulator {
            let (alpha, psi) = &modulator.source;
            write(self.source(), alpha);
            write(self.source() + alpha.len(), psi);
            write(self.start(ModelPart::PhaseResponse), modulator.response.as_flattened());
            write(self.start(ModelPart::ZeroOrder), &modulator.zero_order);
            if self.blocks.contains(Block::Crosstalk) {
                write(self.start(ModelPart::Crosstalk), &modulator.crosstalk);
            }
            if self.blocks.contains(Block::UnevenResponse) {
                write(self.start(ModelPart::UnevenResponse), &modulator.variation);
            }
        }
        if let Some(orders) = &adjoint.orders {
            // The tilts go on beyond the band.
            for (tilt, beyond) in self.tilts().zip(orders.tilts_beyond) {
                gradient[tilt] += beyond;
            }
        }
        gradient
    }

    /// Adds to the gradient of θ the contributions of all local kernels of a grid, given the gradients with respect to
    /// their α and ψ.
    fn add_local_gradients(&self, side: usize, local: &[SeriesGradient], gradient: &mut [f64]) {
        let slots = self.terms_in_kernel(self.variation);
        for ((alpha, psi), powers) in local.iter().zip(self.local_powers(side)) {
            let terms = self.kernel.terms();
            gradient[..terms].iter_mut().zip(alpha).for_each(|(sum, value)| *sum += value);
            gradient[terms..2 * terms].iter_mut().zip(psi).for_each(|(sum, value)| *sum += value);
            for (power, weight) in powers.into_iter().enumerate() {
                let start = self.variation(power);
                for &(slot, term) in &slots {
                    gradient[start + slot] += weight * alpha[term];
                    gradient[start + self.variation.terms() + slot] += weight * psi[term];
                }
            }
        }
    }

    /// Powers of the position of each local kernel of a grid. A uniform kernel has one entry of zeros.
    fn local_powers(&self, side: usize) -> Vec<[f64; SpatialVariation::POWERS]> {
        match self.varies() {
            true => local_kernels::nodes(side).map(|(x, y)| SpatialVariation::powers(x, y)).collect(),
            false => vec![[0.0; SpatialVariation::POWERS]],
        }
    }

    /// Adds to the gradient of θ what the gradients with respect to α and ψ of the local kernels of further mode `m`
    /// say of the mode's own errors.
    fn add_mode_gradients(&self, m: usize, local: &[SeriesGradient], gradient: &mut [f64]) {
        let (start, slots) = (self.mode_errors(m), self.terms_in_kernel(self.mode));
        for (alpha, psi) in local {
            for &(slot, term) in &slots {
                gradient[start + slot] += alpha[term];
                gradient[start + self.mode.terms() + slot] += psi[term];
            }
        }
    }

    /// For each term of a series: its index, and the index of the same term in the kernel's series.
    fn terms_in_kernel(&self, basis: ChebyshevBasis) -> Vec<(usize, usize)> {
        let kernel_term = |degrees| self.kernel.degrees().position(|of_kernel| of_kernel == degrees);
        basis.degrees().enumerate().filter_map(|(slot, degrees)| Some((slot, kernel_term(degrees)?))).collect()
    }

    /// Weight of each local kernel's light in the derivative by a power of the position on the SLM. With no power all
    /// are 1.
    pub(super) fn local_weights<T: Real>(&self, side: usize, power: Option<usize>) -> Vec<T> {
        let weight = |powers: [f64; SpatialVariation::POWERS]| T::of(power.map_or(1.0, |power| powers[power]));
        self.local_powers(side).into_iter().map(weight).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::parts::Block;
    use crate::display::{DisplayModel, KernelShape, OpticalSetup, ResponseVariation};
    use crate::numerics::{Grid, SmoothField};

    #[test]
    fn larger_basis_keeps_display_unchanged() {
        let setup = OpticalSetup::try_new(Grid::try_new(18, 23, 8e-6).unwrap(), 515e-9, 2e-3).unwrap();
        let small = Layout::of(KernelModel::Display, 3, Blocks::NONE);
        let theta: Vec<f64> = (0..small.len()).map(|i| (i as f64 * 1.3 + 0.5).sin()).collect();
        let model = small.model(&setup, (0.7, 0.1), &theta);
        let blocks = Blocks::ALL.without(Block::Varying).without(Block::PartialCoherence);
        let large = Layout::of(KernelModel::Display, 8, blocks);
        let again = large.model(&setup, (model.gain, model.offset), &large.parameters(&model));
        let (KernelShape::Smooth(before), KernelShape::Smooth(after)) = (&model.kernel, &again.kernel) else {
            panic!()
        };
        for (x, y) in [(-0.9, 0.2), (0.3, 0.7), (1.0, -1.0)] {
            assert!((before.value(x, y) - after.value(x, y)).norm() < 1e-12);
        }
        for (x, y) in [(-0.9, 0.2), (0.3, 0.7), (1.0, -1.0)] {
            assert!((model.source.value(x, y) - again.source.value(x, y)).norm() < 1e-12);
        }
        let (kernel, source) = (KernelShape::Ideal, SmoothField::flat(0));
        let rest =
            |model: &DisplayModel| DisplayModel { kernel: kernel.clone(), source: source.clone(), ..model.clone() };
        let again = DisplayModel { response_variation: ResponseVariation::none(), ..again };
        assert_eq!(rest(&again), rest(&model));
        assert_eq!(small.converted(&theta, &large), large.parameters(&model));
        assert_eq!(large.converted(&large.parameters(&model), &small), theta);
    }
}
