//! A small picture of the light while a hologram is optimized.

use super::evaluate::ProblemSize;
use super::optimization::Optimization;
use crate::numerics::Plane;
use rayon::prelude::*;

impl Optimization {
    /// The light of the first image plane, as the mean over squares of pixels, so that no side is longer than
    /// `side_px_max`, at least 1. It changes nothing of the result.
    ///
    /// Most methods leave the light of the latest evaluation in memory, and the preview costs one reading of it. Others,
    /// such as Adam with one frame, keep no light: then it is computed from the present phases, which costs about half an
    /// iteration, and the memory of the light until it is drawn.
    pub fn light_preview(&mut self, side_px_max: usize) -> Plane<f32> {
        let body = &mut self.problem.body;
        let ProblemSize { height_px, width_px, .. } = body.size();
        let small = |lights: &[f32]| mean_over_squares(lights, height_px, width_px, side_px_max);
        if let Some(lights) = body.latest_light() {
            return small(lights);
        }
        small(&body.light(self.state.phases()))
    }
}

/// The mean of `lights` over the smallest squares that make no side longer than `side_px_max`. Each row of pixels has the
/// rows of its light planes one after the other, and their mean is the light of the pixels.
fn mean_over_squares(lights: &[f32], height_px: usize, width_px: usize, side_px_max: usize) -> Plane<f32> {
    let square_px = height_px.max(width_px).div_ceil(side_px_max.max(1));
    let mut small = Plane::filled(height_px.div_ceil(square_px), width_px.div_ceil(square_px), 0.0);
    let (columns, row_len) = (small.width_px(), lights.len() / height_px);
    let rows = small.values_mut().par_chunks_mut(columns).zip(lights.par_chunks(square_px * row_len));
    rows.for_each(|(means, lights)| {
        for light in lights.chunks_exact(width_px) {
            for (mean, light) in means.iter_mut().zip(light.chunks(square_px)) {
                *mean += light.iter().sum::<f32>();
            }
        }
        let light_rows = lights.len() / width_px;
        for (mean, first_px) in means.iter_mut().zip((0..width_px).step_by(square_px)) {
            *mean /= (light_rows * square_px.min(width_px - first_px)) as f32;
        }
    });
    small
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_at_the_edges_have_the_mean_of_their_pixels() {
        let light: Vec<f32> = (0..5 * 7).map(|i| i as f32).collect();
        let small = mean_over_squares(&light, 5, 7, 3);
        // Squares of 3 px: the last column has one column of pixels, the last row two rows.
        assert_eq!((small.height_px(), small.width_px()), (2, 3));
        assert_eq!(small.values(), [8.0, 11.0, 13.0, 25.5, 28.5, 30.5]);
        assert_eq!(mean_over_squares(&light, 5, 7, 100).values(), light);
    }
}
