//! How strong the [blocks](Block) of a learned display are.

use crate::display::DisplayModel;
use crate::display::parts::Block;
use crate::display::parts::blocks::Blocks;
use crate::numerics::SmoothField;
use crate::numerics::chebyshev::position;
use serde::{Deserialize, Serialize};

/// Strengths of the blocks that a display needed; `None` for a block that it has not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BlockStrengths {
    /// Root mean square of the phase of the uneven surface, without its mean and its tilt \[rad\].
    pub surface_rms_rad: Option<f64>,
    /// Standard deviation of the cross-talk along x and along y \[px\].
    pub crosstalk_px: Option<[f64; 2]>,
    /// Root mean square of the relative change of the phase response over the SLM.
    pub response_variation_rms: Option<f64>,
    /// Standard deviation of the blur of the light along x and along y \[px\].
    pub light_blur_px: Option<[f64; 2]>,
    /// Standard deviation of the places of the images of modes that do not interfere, along x and along y \[px\].
    pub image_spread_px: Option<[f64; 2]>,
    /// Whether the kernel varies over the SLM.
    pub kernel_varies: bool,
    /// Light of the ghost relative to that of the image.
    pub ghost_share: Option<f64>,
    /// Contrast of the dust and fringes in the light on the SLM.
    pub dust_contrast: Option<f64>,
}

impl BlockStrengths {
    /// The strengths of the blocks of a display model.
    #[must_use]
    pub fn of(model: &DisplayModel) -> Self {
        let blocks = Blocks::of(model);
        let has = |block| blocks.contains(block);
        Self {
            surface_rms_rad: has(Block::FineSource).then(|| surface_rms_rad(&model.source)),
            crosstalk_px: has(Block::Crosstalk).then(|| model.crosstalk.sigma_px()),
            response_variation_rms: has(Block::UnevenResponse).then(|| model.response_variation.rms()),
            light_blur_px: has(Block::LightBlur).then(|| model.light_blur.sigma_px()),
            image_spread_px: has(Block::PartialCoherence).then(|| model.coherence.spread_px()),
            kernel_varies: has(Block::Varying),
            ghost_share: has(Block::Ghost).then(|| model.ghost.share()),
            dust_contrast: has(Block::Dust).then(|| model.dust.contrast()),
        }
    }

    /// Whether the display needed no block.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

/// Root mean square of a source's phase over the SLM without its mean and its tilt, which only moves the image.
fn surface_rms_rad(source: &SmoothField) -> f64 {
    /// Number of positions along each axis.
    const SIDE: usize = 64;
    let basis = source.basis();
    let places = || (0..SIDE * SIDE).map(|i| (position(i % SIDE, SIDE), position(i / SIDE, SIDE)));
    let phases: Vec<f64> = places().map(|(x, y)| basis.value(&source.phase, x, y)).collect();
    // The mean and both tilts are orthogonal to each other on this grid.
    let share = |of: fn((f64, f64)) -> f64| {
        let product: f64 = places().zip(&phases).map(|(place, phase)| of(place) * phase).sum();
        product / places().map(|place| of(place).powi(2)).sum::<f64>()
    };
    let (mean, tilt_x, tilt_y) = (share(|_| 1.0), share(|place| place.0), share(|place| place.1));
    let rest = places().zip(&phases).map(|((x, y), phase)| (phase - mean - tilt_x * x - tilt_y * y).powi(2));
    (rest.sum::<f64>() / phases.len() as f64).sqrt()
}
