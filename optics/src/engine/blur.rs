//! Blur of the light that an engine's detector measures.

use super::convolution::Real;
use super::core::EngineCore;
use crate::display::parts::light_blur::Blur;
use crate::numerics::Plane;
use crate::numerics::gaussian_blur::Rows;
use rayon::prelude::*;

impl<T: Real> EngineCore<T> {
    /// Whether all of the light must be known before any of it is compared: the light of several modes adds up, and
    /// neighbouring pixels blur.
    pub(crate) fn needs_all_light(&self) -> bool {
        !self.is_coherent() || self.blur.is_some()
    }

    /// The same display without the blur of its light.
    pub(crate) fn without_blur(&self) -> Self {
        Self { blur: None, ..self.clone() }
    }

    /// Blurs light planes. Their values before the blur are in `spare` afterwards, if the display has a blur.
    pub(crate) fn blur_lights(&self, lights: &mut Vec<T>, spare: &mut Vec<T>) {
        let Some(blur) = &self.blur else { return };
        spare.resize(lights.len(), T::zero());
        std::mem::swap(lights, spare);
        self.apply_to_lights(&Blur::new(blur.ratios()), spare, lights);
    }

    /// Applies a blur, or a derivative of one, to light planes.
    pub(crate) fn apply_to_lights(&self, blur: &Blur<T>, lights: &[T], out: &mut [T]) {
        let rows = self.rows_of(lights);
        let fill = |y: usize, plane: usize, row: &mut [T]| {
            row.copy_from_slice(&lights[(y * rows.planes + plane) * rows.width_px..][..rows.width_px]);
        };
        blur.blur(rows, fill, out);
    }

    /// Makes slopes by the blurred light slopes by the light before it. The previous values are in `spare` afterwards,
    /// if the display has a blur.
    pub(crate) fn spread_slopes(&self, slopes: &mut Vec<T>, spare: &mut Vec<T>) {
        let Some(blur) = &self.blur else { return };
        spare.resize(slopes.len(), T::zero());
        std::mem::swap(slopes, spare);
        Blur::new(blur.ratios()).spread(self.rows_of(spare), spare, false, slopes);
    }

    /// Blurs the light of the pixels, or that of several places in each pixel, in the order in which they are in the
    /// image.
    pub(crate) fn blurred(&self, mut light: Plane<T>) -> Plane<T> {
        let Some(blur) = &self.blur else { return light };
        let (height_px, width_px) = (self.height_px(), self.width_px());
        let per_side = light.width_px() / width_px;
        let fill = |y: usize, place: usize, row: &mut [T]| {
            let places = light.row(y * per_side + place / per_side)[place % per_side..].iter().step_by(per_side);
            row.iter_mut().zip(places).for_each(|(out, &light)| *out = light);
        };
        let planes = per_side * per_side;
        let mut planar = crate::numerics::buffers::zeros(height_px * planes * width_px);
        Blur::new(blur.ratios()).blur(Rows { width_px, planes }, fill, &mut planar);
        if planes == 1 {
            light.values_mut().copy_from_slice(&planar);
            return light;
        }
        let rows = light.values_mut().par_chunks_mut(per_side * width_px).enumerate();
        rows.for_each(|(row, out)| {
            let (y, below) = (row / per_side, row % per_side);
            for right in 0..per_side {
                let place = &planar[(y * planes + below * per_side + right) * width_px..][..width_px];
                out.iter_mut().skip(right).step_by(per_side).zip(place).for_each(|(out, &light)| *out = light);
            }
        });
        light
    }

    fn rows_of(&self, lights: &[T]) -> Rows {
        let width_px = self.width_px();
        Rows { width_px, planes: lights.len() / (self.height_px() * width_px) }
    }
}
