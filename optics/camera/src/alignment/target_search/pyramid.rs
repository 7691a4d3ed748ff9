//! A picture in steps of half its size, and its details at each step.

use crate::alignment::box_blur::box_blur;
use crate::alignment::homography::Point;
use lightpath_optics::{Plane, interrupt};

/// A picture and its reductions. Step k has one pixel for 2ᵏ × 2ᵏ pixels of the picture.
#[derive(Clone, Debug)]
pub(super) struct Pyramid(Vec<Plane<f32>>);

/// Shortest side of the smallest reduction \[px\].
const SIDE_MIN: usize = 16;
/// Radius of the blur that removes noise and speckle finer than a pixel of the reduction \[px\]; three passes come near
/// a Gaussian with a standard deviation of 1.4 px.
const FINE_PX: usize = 1;
/// Radius of the blur whose result is subtracted, so that uneven light does not count \[px\].
const WIDE_PX: usize = 6;
const PASSES: usize = 3;
/// Distance at which other pixels change a detail \[px\].
pub(super) const DETAILS_REACH: usize = WIDE_PX * PASSES;

/// Longest side of the target in the last refinement \[px\]. More would not make it more accurate, but slower.
const LAST_PX: f64 = 1100.0;

/// The step of the details with which the last refinement works.
pub(super) fn last_step(longer_px: usize) -> usize {
    (longer_px as f64 / LAST_PX).log2().ceil().max(0.0) as usize
}

impl Pyramid {
    pub(super) fn of(picture: &Plane<f32>) -> Self {
        let mut steps = vec![picture.clone()];
        while let Some(last) = steps.last()
            && last.height_px().min(last.width_px()) >= 2 * SIDE_MIN
        {
            let next = halved(last);
            steps.push(next);
        }
        Self(steps)
    }

    /// The picture in its own size.
    pub(super) fn whole(&self) -> &Plane<f32> {
        &self.0[0]
    }

    /// The largest step whose pixels have at most `px` pixels of the picture along a side.
    pub(super) fn step_below(&self, px: f64) -> usize {
        (px.max(1.0).log2().floor() as usize).min(self.0.len() - 1)
    }

    /// The step whose pixels are nearest to `px` pixels of the picture along a side.
    pub(super) fn step_near(&self, px: f64) -> usize {
        (px.max(1.0).log2().round() as usize).min(self.0.len() - 1)
    }

    /// The value at a point of the picture, interpolated between the pixels of a step. `None` outside.
    pub(super) fn value(&self, step: usize, [x, y]: Point) -> Option<f32> {
        let px = (1_usize << step) as f64;
        let inside = |v: f64, side: usize| v >= -0.5 && v <= side as f64 - 0.5;
        let whole = self.whole();
        if !inside(x, whole.width_px()) || !inside(y, whole.height_px()) {
            return None;
        }
        let at = |v: f64| (v - (px - 1.0) / 2.0) / px;
        Some(Sample::at(&self.0[step], [at(x), at(y)])?.value)
    }

    /// The picture's details at a step: blurred a little, without what is wider than some pixels.
    pub(super) fn details(&self, step: usize) -> Details {
        let fine = box_blur(&self.0[step], FINE_PX, PASSES);
        let wide = box_blur(&self.0[step], WIDE_PX, PASSES);
        let values = Plane::from_fn(fine.height_px(), fine.width_px(), |y, x| fine.at(y, x) - wide.at(y, x));
        Details { values, px: (1_usize << step) as f64 }
    }
}

/// Details of a picture, with one value for `px` × `px` of its pixels.
#[derive(Clone, Debug)]
pub(super) struct Details {
    pub(super) values: Plane<f32>,
    px: f64,
}

impl Details {
    /// The picture's point \[px\] of a value.
    pub(super) fn point(&self, y: usize, x: usize) -> Point {
        [x, y].map(|i| self.px * i as f64 + (self.px - 1.0) / 2.0)
    }

    /// Number of the picture's pixels along the side of a value.
    pub(super) fn px(&self) -> f64 {
        self.px
    }

    /// The value at a point of the picture, with its slopes for each pixel of the picture. `None` outside.
    pub(super) fn sample(&self, point: Point) -> Option<Sample> {
        let Sample { value, slope } = Sample::at(&self.values, point.map(|v| (v - (self.px - 1.0) / 2.0) / self.px))?;
        Some(Sample { value, slope: slope.map(|slope| slope / self.px as f32) })
    }
}

/// A value between pixels and its slopes along x and y.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) value: f32,
    pub(super) slope: [f32; 2],
}

impl Sample {
    /// Bilinear interpolation. `None` more than half a pixel outside.
    #[inline]
    fn at(plane: &Plane<f32>, [x, y]: Point) -> Option<Self> {
        let (w, h) = (plane.width_px() as f64, plane.height_px() as f64);
        // NaN is outside, too.
        if !(x >= -0.5 && y >= -0.5 && x <= w - 0.5 && y <= h - 0.5) {
            return None;
        }
        let cell = |v: f64, side: f64| v.floor().clamp(0.0, (side - 2.0).max(0.0));
        let (left, top) = (cell(x, w), cell(y, h));
        let (fx, fy) = ((x - left).clamp(0.0, 1.0) as f32, (y - top).clamp(0.0, 1.0) as f32);
        let (i, j) = (left as usize, top as usize);
        let (right, below) = ((i + 1).min(plane.width_px() - 1), (j + 1).min(plane.height_px() - 1));
        let (upper, lower) = (plane.row(j), plane.row(below));
        let (a, b, c, d) = (upper[i], upper[right], lower[i], lower[right]);
        let (first, second) = (a + fx * (b - a), c + fx * (d - c));
        Some(Self { value: first + fy * (second - first), slope: [(b - a) + fy * ((d - c) - (b - a)), second - first] })
    }
}

fn halved(plane: &Plane<f32>) -> Plane<f32> {
    Plane::from_fn(plane.height_px() / 2, plane.width_px() / 2, |y, x| {
        if x == 0 {
            interrupt::check();
        }
        let (upper, lower) = (plane.row(2 * y), plane.row(2 * y + 1));
        (upper[2 * x] + upper[2 * x + 1] + lower[2 * x] + lower[2 * x + 1]) / 4.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_step_keeps_a_slope_in_place() {
        let slope = Plane::from_fn(128, 192, |y, x| (0.25 * x as f64 - 0.5 * y as f64) as f32);
        let pyramid = Pyramid::of(&slope);
        assert_eq!(pyramid.0.len(), 4);
        for step in 0..4 {
            let value = pyramid.value(step, [100.3, 60.7]).unwrap();
            assert!((f64::from(value) - (25.075 - 30.35)).abs() < 1e-4, "{step}: {value}");
        }
        assert!(pyramid.value(0, [-0.6, 5.0]).is_none() && pyramid.value(0, [f64::NAN, 5.0]).is_none());
        let details = pyramid.details(1);
        assert_eq!(details.point(3, 5), [10.5, 6.5]);
        assert!(details.values.at(32, 48).abs() < 1e-4, "a slope has no details");
    }
}
