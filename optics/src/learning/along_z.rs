//! Models of one display at several distances.
//!
//! ```text
//! H(f; z) = H_ideal(f; z) · exp( Σ_k T_k(t) ( α_k(f) + iψ_k(f) ) ),   k = 0 … degree,   t = (2z − z₁ − z_n) / (z_n − z₁)
//! ```
//!
//! z₁ is the nearest and z_n the farthest of the n photographed distances, T_k are Chebyshev polynomials; the degree is
//! n − 1, but at most two. Propagation is exact at each z: only the errors of the optics are polynomials of z. Source,
//! phase response and zero order belong to the modulator and are the same at all z. The blur of the light is the same,
//! too, as that of a camera is, although that of a source with an extent grows with the distance. The tilts of ψ, which
//! move the image, are not polynomials: the camera was set up anew at each distance, so each distance has its own
//! tilts. Between neighbouring distances the tilts are interpolated linearly.

use super::layout::{Layout, Part};
use crate::display::{DisplayModel, KernelShape, OpticalSetup};
use crate::error::Error;
use crate::numerics::SmoothField;
use crate::numerics::chebyshev::polynomials;

/// Highest degree in z. Over a photographed range, rails and lenses change along a line or a parabola; a higher degree
/// would follow the noise.
const DEGREE_MAX: usize = 2;

fn degree(planes: usize) -> usize {
    (planes - 1).min(DEGREE_MAX)
}

/// Positions of the parameters of several planes' models in a joint θ. With a single plane, the joint θ is that plane's
/// θ.
#[derive(Clone, Debug)]
pub(super) struct JointLayout {
    /// Layout of the θ of each plane.
    pub(super) layout: Layout,
    distances_m: Vec<f64>,
    /// For each joint parameter: its position in the θ of a plane, and the index of the function of z that it
    /// multiplies.
    slots: Vec<(usize, usize)>,
    /// Value of that function, indexed \[plane\]\[parameter\].
    weights: Vec<Vec<f64>>,
}

impl JointLayout {
    pub(super) fn new(layout: Layout, distances_m: &[f64]) -> Self {
        let planes = distances_m.len();
        let functions = |position| match layout.part(position) {
            Part::Slm => 1,
            Part::Tilt => planes,
            Part::Kernel => degree(planes) + 1,
        };
        let of_function =
            |k| (0..layout.len()).filter(move |&position| k < functions(position)).map(move |position| (position, k));
        let slots: Vec<(usize, usize)> = (0..planes).flat_map(of_function).collect();
        let (nearest_m, farthest_m) = range(distances_m);
        let weights = distances_m.iter().enumerate().map(|(plane, z_m)| {
            let span_m = farthest_m - nearest_m;
            let t = if span_m > 0.0 { (2.0 * z_m - nearest_m - farthest_m) / span_m } else { 0.0 };
            let along_z = polynomials(degree(planes), t);
            let weight = |&(position, k): &(usize, usize)| match layout.part(position) {
                Part::Slm => 1.0,
                Part::Tilt => f64::from(u8::from(k == plane)),
                Part::Kernel => along_z[k],
            };
            slots.iter().map(weight).collect()
        });
        Self { layout, weights: weights.collect(), distances_m: distances_m.to_vec(), slots }
    }

    /// The joint layout of the same planes for another layout of a plane.
    pub(super) fn with_layout(&self, layout: Layout) -> Self {
        Self::new(layout, &self.distances_m)
    }

    pub(super) fn len(&self) -> usize {
        self.slots.len()
    }

    pub(super) fn planes(&self) -> usize {
        self.distances_m.len()
    }

    /// Computes the θ of one plane from the joint θ.
    pub(super) fn plane_parameters(&self, plane: usize, theta: &[f64]) -> Vec<f64> {
        let mut plane_theta = vec![0.0; self.layout.len()];
        for ((&(position, _), weight), value) in self.slots.iter().zip(&self.weights[plane]).zip(theta) {
            plane_theta[position] += weight * value;
        }
        plane_theta
    }

    /// Sets a parameter that all planes share.
    pub(super) fn set_shared(&self, theta: &mut [f64], position: usize, value: f64) {
        if let Some(slot) = self.slots.iter().position(|slot| *slot == (position, 0)) {
            theta[slot] = value;
        }
    }

    /// Adds `by` to a parameter of one plane, or of all if they share it.
    pub(super) fn add_to_plane(&self, theta: &mut [f64], plane: usize, position: usize, by: f64) {
        let function = if self.layout.part(position) == Part::Tilt { plane } else { 0 };
        for (slot, value) in self.slots.iter().zip(theta) {
            if *slot == (position, function) {
                *value += by;
            }
        }
    }

    /// Adds `by` to a parameter of each plane.
    pub(super) fn add_to_all_planes(&self, theta: &mut [f64], position: usize, by: f64) {
        let is_tilt = self.layout.part(position) == Part::Tilt;
        for ((of, k), value) in self.slots.iter().zip(theta) {
            if *of == position && (*k == 0 || is_tilt) {
                *value += by;
            }
        }
    }

    /// Moves parameters that have limits into them.
    pub(super) fn limit(&self, theta: &mut [f64]) {
        for (&(position, _), value) in self.slots.iter().zip(theta) {
            *value = self.layout.limited(position, *value);
        }
    }

    /// Computes the joint θ of a display that has the θ `plane_theta` at all distances.
    pub(super) fn parameters_for_all_planes(&self, plane_theta: &[f64]) -> Vec<f64> {
        let value = |&(position, k): &(usize, usize)| match self.layout.part(position) {
            Part::Kernel if k > 0 => 0.0,
            Part::Slm | Part::Tilt | Part::Kernel => plane_theta[position],
        };
        self.slots.iter().map(value).collect()
    }

    /// Adds `share` times the gradient of one plane's loss to the joint gradient.
    pub(super) fn add_gradient(&self, plane: usize, own: &[f64], share: f64, total: &mut [f64]) {
        for ((&(position, _), weight), total) in self.slots.iter().zip(&self.weights[plane]).zip(total) {
            *total += weight * (own[position] * share);
        }
    }

    /// Adds `share` times the curvature of one plane's loss to the joint curvature, both stored row after row.
    pub(super) fn add_curvature(&self, plane: usize, own: &[f64], share: f64, total: &mut [f64]) {
        let slots = || self.slots.iter().map(|(position, _)| position).zip(&self.weights[plane]);
        for ((a, weight_a), total) in slots().zip(total.chunks_exact_mut(self.len())) {
            let own = &own[a * self.layout.len()..];
            for ((&b, weight_b), total) in slots().zip(total) {
                *total += weight_a * weight_b * (own[b] * share);
            }
        }
    }

    /// Converts θ to another joint layout of the same planes. Parameters that the other layout lacks are left out.
    pub(super) fn converted(&self, theta: &[f64], to: &Self) -> Vec<f64> {
        let mut converted = vec![0.0; to.len()];
        for function in 0..self.planes() {
            let mut part = vec![0.0; self.layout.len()];
            for (&(position, k), &value) in self.slots.iter().zip(theta) {
                if k == function {
                    part[position] = value;
                }
            }
            let part = self.layout.converted(&part, &to.layout);
            for (&(position, k), value) in to.slots.iter().zip(&mut converted) {
                if k == function {
                    *value = part[position];
                }
            }
        }
        converted
    }
}

/// The smallest and the largest distance.
fn range(distances_m: &[f64]) -> (f64, f64) {
    distances_m.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &z_m| (low.min(z_m), high.max(z_m)))
}

/// The display at the distance of `setup`, interpolated between `models` that were learned
/// [together](super::Learner::start_joint). At the distance of one of the models the result is that model. Gain and
/// offset are interpolated linearly.
///
/// # Errors
///
/// [`Error::Extrapolation`] for a distance outside the range of the models' distances; [`Error::IncompatibleDistances`]
/// for fewer than two models, or models that are not from one joint fit.
pub fn interpolated(models: &[DisplayModel], setup: OpticalSetup) -> Result<DisplayModel, Error> {
    let mut models: Vec<&DisplayModel> = models.iter().collect();
    models.sort_by(|a, b| a.setup.distance_m().total_cmp(&b.setup.distance_m()));
    let kernels = kernels_of_joint_fit(&models, &setup)?;
    let distances_m: Vec<f64> = models.iter().map(|model| model.setup.distance_m()).collect();
    let (z_m, (nearest_m, farthest_m)) = (setup.distance_m(), range(&distances_m));
    if !(nearest_m..=farthest_m).contains(&z_m) {
        return Err(Error::Extrapolation { distance_m: z_m, nearest_m, farthest_m });
    }
    // A polynomial of degree d is determined by any d + 1 points; the closest ones are used.
    let mut closest: Vec<usize> = (0..models.len()).collect();
    closest.sort_by(|&a, &b| (distances_m[a] - z_m).abs().total_cmp(&(distances_m[b] - z_m).abs()));
    let along_z = lagrange(&distances_m, &closest[..=degree(models.len())], z_m);
    let above = distances_m.partition_point(|&distance_m| distance_m <= z_m).clamp(1, models.len() - 1);
    let along_line = lagrange(&distances_m, &[above - 1, above], z_m);

    let along_z_and_line = |fields: &[&SmoothField]| {
        let mut field = SmoothField::flat(fields[0].order);
        for (i, degrees) in field.basis().degrees().enumerate() {
            let sum = |weights: &[f64], of: fn(&SmoothField) -> &[f64]| -> f64 {
                fields.iter().zip(weights).map(|(field, weight)| weight * of(field)[i]).sum()
            };
            let tilt = matches!(degrees, (0, 1) | (1, 0));
            field.log_amplitude[i] = sum(&along_z, |field| &field.log_amplitude);
            field.phase[i] = sum(if tilt { &along_line } else { &along_z }, |field| &field.phase);
        }
        field
    };
    let beyond: Vec<&SmoothField> = models.iter().map(|model| &model.beyond).collect();
    let (kernel, beyond) = (along_z_and_line(&kernels), along_z_and_line(&beyond));
    let sum =
        |of: fn(&DisplayModel) -> f64| models.iter().zip(&along_line).map(|(model, weight)| weight * of(model)).sum();
    let (gain, offset) = (sum(|model| model.gain), sum(|model| model.offset));
    Ok(DisplayModel { setup, kernel: KernelShape::Smooth(kernel), beyond, gain, offset, ..models[0].clone() })
}

/// The kernels of `models`, which are sorted by distance, after a check that they can come from one joint fit.
fn kernels_of_joint_fit<'a>(models: &[&'a DisplayModel], setup: &OpticalSetup) -> Result<Vec<&'a SmoothField>, Error> {
    if models.len() < 2 {
        return Err(Error::IncompatibleDistances { reason: "at least two distances are needed" });
    }
    let kernel = |model: &&'a DisplayModel| match &model.kernel {
        KernelShape::Smooth(field) => Ok(field),
        KernelShape::Ideal | KernelShape::Bins(_) => {
            Err(Error::IncompatibleDistances { reason: "all models must have smooth kernels" })
        }
    };
    let kernels = models.iter().map(kernel).collect::<Result<Vec<_>, _>>()?;
    for (model, before) in models.iter().skip(1).zip(models) {
        if model.setup.distance_m() == before.setup.distance_m() {
            return Err(Error::IncompatibleDistances { reason: "each distance may occur only once" });
        }
        let modulator = |model: &DisplayModel| DisplayModel {
            setup: *setup,
            kernel: KernelShape::Ideal,
            beyond: SmoothField::flat(0),
            gain: 1.0,
            offset: 0.0,
            ..model.clone()
        };
        if modulator(model) != modulator(before) {
            return Err(Error::IncompatibleDistances {
                reason: "the source, dust, phase response, cross-talk, blur, zero order and variations must be the same at all distances",
            });
        }
    }
    let orders = |model: &DisplayModel, kernel: &SmoothField| (kernel.order, model.beyond.order);
    if models.iter().zip(&kernels).any(|(model, kernel)| orders(model, kernel) != orders(models[0], kernels[0])) {
        return Err(Error::IncompatibleDistances { reason: "all kernels must have the same order" });
    }
    let optics = |setup: &OpticalSetup| (setup.grid(), setup.wavelength_m());
    match models.iter().all(|model| optics(&model.setup) == optics(setup)) {
        true => Ok(kernels),
        false => Err(Error::IncompatibleDistances { reason: "grid and wavelength must be the same at all distances" }),
    }
}

/// Weights of the values at `points` for the polynomial through those at `nodes`, evaluated at `at` (Lagrange). Points
/// that are not nodes have weight 0.
fn lagrange(points: &[f64], nodes: &[usize], at: f64) -> Vec<f64> {
    let mut weights = vec![0.0; points.len()];
    for &i in nodes {
        let others = nodes.iter().filter(|&&j| j != i);
        weights[i] = others.map(|&j| (at - points[j]) / (points[i] - points[j])).product();
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::parts::Block;
    use crate::display::parts::blocks::Blocks;
    use crate::learning::options::KernelModel;
    use crate::numerics::Grid;

    const DISTANCES_M: [f64; 4] = [4e-3, 5e-3, 7e-3, 8e-3];

    fn setup(distance_m: f64) -> OpticalSetup {
        OpticalSetup::try_new(Grid::try_new(18, 24, 8e-6).unwrap(), 515e-9, distance_m).unwrap()
    }

    fn joint(distances_m: &[f64], order: usize) -> JointLayout {
        JointLayout::new(Layout::of(KernelModel::Display, order, Blocks::NONE), distances_m)
    }

    fn wave(len: usize) -> Vec<f64> {
        (0..len).map(|i| 0.1 * (i as f64 * 1.3 + 0.5).sin()).collect()
    }

    fn models(joint: &JointLayout, theta: &[f64]) -> Vec<DisplayModel> {
        let model = |(plane, &z_m): (usize, &f64)| {
            joint.layout.model(&setup(z_m), (1.0 + z_m, 0.1), &joint.plane_parameters(plane, theta))
        };
        joint.distances_m.iter().enumerate().map(model).collect()
    }

    #[test]
    fn joint_layout_of_single_plane_is_identity() {
        let joint = joint(&[5e-3], 4);
        let theta = wave(joint.len());
        assert_eq!(joint.len(), joint.layout.len());
        assert_eq!(joint.plane_parameters(0, &theta), theta);
        assert_eq!(joint.parameters_for_all_planes(&theta), theta);
        let mut gradient = vec![0.0; theta.len()];
        joint.add_gradient(0, &theta, 1.0, &mut gradient);
        assert_eq!(gradient, theta);
        let matrix = wave(theta.len() * theta.len());
        let mut curvature = vec![0.0; matrix.len()];
        joint.add_curvature(0, &matrix, 1.0, &mut curvature);
        assert_eq!(curvature, matrix);
    }

    #[test]
    fn gradient_and_curvature_follow_the_chain_rule() {
        let joint = joint(&DISTANCES_M, 2);
        let (n, own) = (joint.len(), joint.layout.len());
        for plane in 0..DISTANCES_M.len() {
            // Columns of ∂(θ of the plane)/∂θ.
            let unit = |i: usize| (0..n).map(|j| f64::from(u8::from(i == j))).collect::<Vec<f64>>();
            let columns: Vec<Vec<f64>> = (0..n).map(|i| joint.plane_parameters(plane, &unit(i))).collect();
            let (g, a) = (wave(own), wave(own * own));
            let (mut gradient, mut curvature) = (vec![0.0; n], vec![0.0; n * n]);
            joint.add_gradient(plane, &g, 0.5, &mut gradient);
            joint.add_curvature(plane, &a, 0.5, &mut curvature);
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            for i in 0..n {
                assert!((gradient[i] - 0.5 * dot(&columns[i], &g)).abs() < 1e-14);
                let row: Vec<f64> = (0..own).map(|b| (0..own).map(|c| columns[i][c] * a[c * own + b]).sum()).collect();
                for j in 0..n {
                    assert!((curvature[i * n + j] - 0.5 * dot(&row, &columns[j])).abs() < 1e-14);
                }
            }
        }
    }

    #[test]
    fn larger_layout_and_common_parameters_keep_display_unchanged() {
        let (small, large) = (joint(&DISTANCES_M, 3), joint(&DISTANCES_M, 5));
        let theta = wave(small.len());
        let converted = small.converted(&theta, &large);
        for plane in 0..DISTANCES_M.len() {
            assert_eq!(
                large.layout.converted(&large.plane_parameters(plane, &converted), &small.layout),
                small.plane_parameters(plane, &theta)
            );
        }
        let one = wave(small.layout.len());
        let everywhere = small.parameters_for_all_planes(&one);
        assert!((0..DISTANCES_M.len()).all(|plane| small.plane_parameters(plane, &everywhere) == one));
    }

    #[test]
    fn interpolated_kernel_is_fitted_polynomial() {
        let blocks = Blocks::NONE.with(Block::LightBlur);
        let joint = JointLayout::new(Layout::of(KernelModel::Display, 3, blocks), &DISTANCES_M);
        let theta = wave(joint.len());
        let models = models(&joint, &theta);
        for (model, z_m) in models.iter().zip(DISTANCES_M) {
            let again = interpolated(&models, setup(z_m)).unwrap();
            let (KernelShape::Smooth(a), KernelShape::Smooth(b)) = (&model.kernel, &again.kernel) else { panic!() };
            assert!((a.value(0.4, -0.7) - b.value(0.4, -0.7)).norm() < 1e-12);
            assert_eq!((&model.source, &model.response), (&again.source, &again.response));
            assert!(!again.light_blur.is_none() && again.light_blur == model.light_blur);
        }
        // One more plane in the same range: the polynomials stay the same, and its tilts are set to the interpolated
        // ones.
        let with = JointLayout::new(joint.layout, &[4e-3, 5e-3, 5.5e-3, 7e-3, 8e-3]);
        let mut more = vec![0.0; with.len()];
        for (&(position, k), value) in with.slots.iter().zip(&mut more) {
            let of = |k: usize| joint.slots.iter().position(|&slot| slot == (position, k)).map_or(0.0, |i| theta[i]);
            *value = match (joint.layout.part(position), k) {
                (Part::Tilt, 2) => 0.75 * of(1) + 0.25 * of(2),
                (Part::Tilt, 3 | 4) => of(k - 1),
                _ => of(k),
            };
        }
        let truth = with.layout.model(&setup(5.5e-3), (1.0055, 0.1), &with.plane_parameters(2, &more));
        let found = interpolated(&models, setup(5.5e-3)).unwrap();
        let (KernelShape::Smooth(a), KernelShape::Smooth(b)) = (&truth.kernel, &found.kernel) else { panic!() };
        for (a, b) in [(&a.log_amplitude, &b.log_amplitude), (&a.phase, &b.phase)] {
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12), "{a:?}, {b:?}");
        }
        assert!((found.gain - truth.gain).abs() < 1e-12);
    }

    #[test]
    fn extrapolation_and_models_of_different_fits_are_refused() {
        let joint = joint(&DISTANCES_M, 3);
        let mut models = models(&joint, &wave(joint.len()));
        for z_m in [3.9e-3, 8.1e-3, -5e-3] {
            let error = interpolated(&models, setup(z_m)).unwrap_err();
            assert_eq!(error, Error::Extrapolation { distance_m: z_m, nearest_m: 4e-3, farthest_m: 8e-3 });
            assert!(error.to_string().contains("0.004 to 0.008 m"), "{error}");
        }
        assert!(matches!(interpolated(&models[..1], setup(4e-3)), Err(Error::IncompatibleDistances { .. })));
        models[2].response[0][1] += 1e-3;
        assert!(matches!(interpolated(&models, setup(5e-3)), Err(Error::IncompatibleDistances { .. })));
        models[2] = DisplayModel::ideal(setup(7e-3));
        assert!(matches!(interpolated(&models, setup(5e-3)), Err(Error::IncompatibleDistances { .. })));
    }
}
