//! Speckle contrast of a photograph in blocks of the target that are flat and bright.
//!
//! ```text
//! C = median over blocks of  σ(p) / mean(p)
//! ```
//!
//! p is the photograph's light in a block of 16 × 16 pixels. The blocks lie side by side from the region's upper left
//! corner. In each of them the target varies by at most 2 % of its brightest value in the region, and its mean is at
//! least half of that value. A camera's gain does not change C. Uneven light over more than a block does not count.

use lightpath_optics::{Plane, RegionOfInterest, interrupt};

/// Side of a block \[px\].
pub const BLOCK_PX: usize = 16;
/// Fewest blocks for a median.
pub const BLOCKS_MIN: usize = 5;
/// Largest difference of the target's values in a flat block, as a part of the region's brightest value.
const TOLERANCE: f32 = 0.02;
/// Least mean of a bright block, as a part of the region's brightest value.
const BRIGHT: f32 = 0.5;

/// Speckle contrast: the median over flat bright blocks of standard deviation over mean. `None` if the region has fewer
/// than [`BLOCKS_MIN`] such blocks with light. Both planes must cover the region.
#[must_use]
pub fn block_speckle_contrast(light: &Plane<f32>, target: &Plane<f32>, region: RegionOfInterest) -> Option<f64> {
    let rows = region.y_px()..region.y_px() + region.height_px();
    let columns = region.x_px()..region.x_px() + region.width_px();
    let brightest = rows.clone().flat_map(|y| &target.row(y)[columns.clone()]).fold(0.0_f32, |most, &t| most.max(t));
    let mut contrasts = Vec::new();
    for top in rows.clone().step_by(BLOCK_PX).filter(|top| top + BLOCK_PX <= rows.end) {
        interrupt::check();
        for left in columns.clone().step_by(BLOCK_PX).filter(|left| left + BLOCK_PX <= columns.end) {
            if is_flat_and_bright(target, (top, left), brightest) {
                contrasts.extend(contrast(light, (top, left)));
            }
        }
    }
    if contrasts.len() < BLOCKS_MIN {
        return None;
    }
    contrasts.sort_by(f64::total_cmp);
    let middle = contrasts.len() / 2;
    Some(if contrasts.len() % 2 == 1 { contrasts[middle] } else { (contrasts[middle - 1] + contrasts[middle]) / 2.0 })
}

fn block(plane: &Plane<f32>, (top, left): (usize, usize)) -> impl Iterator<Item = f32> {
    (top..top + BLOCK_PX).flat_map(move |y| plane.row(y)[left..left + BLOCK_PX].iter().copied())
}

fn is_flat_and_bright(target: &Plane<f32>, corner: (usize, usize), brightest: f32) -> bool {
    let (least, most) =
        block(target, corner).fold((f32::INFINITY, 0.0_f32), |(least, most), t| (least.min(t), most.max(t)));
    let mean = block(target, corner).sum::<f32>() / (BLOCK_PX * BLOCK_PX) as f32;
    most - least <= TOLERANCE * brightest && mean >= BRIGHT * brightest && mean > 0.0
}

/// σ/mean of a block; `None` without light.
fn contrast(light: &Plane<f32>, corner: (usize, usize)) -> Option<f64> {
    let count = (BLOCK_PX * BLOCK_PX) as f64;
    let mean = block(light, corner).map(f64::from).sum::<f64>() / count;
    let variance = block(light, corner).map(|p| (f64::from(p) - mean).powi(2)).sum::<f64>() / count;
    (mean > 0.0).then(|| variance.sqrt() / mean)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_optics::Grid;

    fn full(plane: &Plane<f32>) -> RegionOfInterest {
        RegionOfInterest::full(&Grid::try_new(plane.height_px(), plane.width_px(), 8e-6).unwrap())
    }

    #[test]
    fn only_flat_bright_blocks_count() {
        // Ten bright blocks beside ten dark ones, and a row of blocks with an edge in each.
        let target = Plane::from_fn(48, 160, |y, x| match y / 16 {
            0 => 0.8,
            1 => 0.1,
            _ => (x % 2) as f32,
        });
        let light = Plane::from_fn(48, 160, |y, x| match y / 16 {
            0 if x / 16 == 3 => (x % 2) as f32,
            0 => 0.4 * if (x + y) % 2 == 0 { 1.25 } else { 0.75 },
            _ => (y * x % 7) as f32,
        });
        let found = block_speckle_contrast(&light, &target, full(&target)).unwrap();
        assert!((found - 0.25).abs() < 1e-6, "{found}");
    }

    #[test]
    fn too_few_blocks_or_no_light_give_no_contrast() {
        let flat = Plane::filled(32, 32, 0.7);
        assert_eq!(block_speckle_contrast(&flat, &flat, full(&flat)), None, "four blocks");
        let (wide, black) = (Plane::filled(32, 64, 0.7), Plane::filled(32, 64, 0.0));
        assert_eq!(block_speckle_contrast(&wide, &wide, full(&wide)), Some(0.0));
        assert_eq!(block_speckle_contrast(&black, &wide, full(&wide)), None);
        assert_eq!(block_speckle_contrast(&wide, &black, full(&wide)), None);
    }
}
