//! Blocks of the display model: parts that only some displays need.
//!
//! Learning tries each block when the simpler model is fitted, and keeps it if it lowers the validation loss enough.

use super::options::KernelModel;
use crate::display::DisplayModel;
use crate::numerics::SmoothField;
use crate::numerics::chebyshev::position;
use serde::{Deserialize, Serialize};

/// Highest total degree of the source profile.
pub(crate) const SOURCE_ORDER: usize = 4;
/// Highest total degree of a fine source profile. Order 8 leaves 3 dB less light in place on a surface of 1.5 waves.
pub(crate) const FINE_SOURCE_ORDER: usize = 10;

/// A part of the display model that only some displays need.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Block {
    /// A source profile of order 10 instead of 4, for the uneven surface of a modulator.
    FineSource,
    /// [`Crosstalk`](crate::Crosstalk) between neighbouring pixels.
    Crosstalk,
    /// A phase response that [varies over the SLM](crate::ResponseVariation).
    UnevenResponse,
    /// A [blur of the light](crate::LightBlur), by the camera or by a source with an extent.
    LightBlur,
    /// Light of several modes that do not interfere: [partial coherence](crate::PartialCoherence).
    PartialCoherence,
    /// A kernel that [varies over the SLM](crate::SpatialVariation).
    Varying,
    /// A [`Ghost`](crate::Ghost): a second image.
    Ghost,
    /// [`Dust`](crate::Dust) and fringes in the light on the SLM.
    Dust,
}

impl Block {
    /// All blocks.
    pub const ALL: [Self; 8] = [
        Self::FineSource,
        Self::Crosstalk,
        Self::UnevenResponse,
        Self::LightBlur,
        Self::PartialCoherence,
        Self::Varying,
        Self::Ghost,
        Self::Dust,
    ];

    /// Name of the block in lower case, as it is stored.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::FineSource => "fine_source",
            Self::Crosstalk => "crosstalk",
            Self::UnevenResponse => "uneven_response",
            Self::LightBlur => "light_blur",
            Self::PartialCoherence => "partial_coherence",
            Self::Varying => "varying",
            Self::Ghost => "ghost",
            Self::Dust => "dust",
        }
    }

    /// Whether validation pairs may choose the block in a fit of `model`.
    pub(super) fn belongs_to(self, model: KernelModel) -> bool {
        match self {
            Self::Varying => model == KernelModel::Varying,
            _ => matches!(model, KernelModel::Display | KernelModel::Varying),
        }
    }
}

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
        Self {
            surface_rms_rad: blocks.fine_source.then(|| surface_rms_rad(&model.source)),
            crosstalk_px: blocks.crosstalk.then(|| model.crosstalk.sigma_px()),
            response_variation_rms: blocks.uneven_response.then(|| model.response_variation.rms()),
            light_blur_px: blocks.light_blur.then(|| model.light_blur.sigma_px()),
            image_spread_px: blocks.partial_coherence.then(|| model.coherence.spread_px()),
            kernel_varies: blocks.varying,
            ghost_share: blocks.ghost.then(|| model.ghost.share()),
            dust_contrast: blocks.dust.then(|| model.dust.contrast()),
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

/// A set of blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Blocks {
    /// [`Block::FineSource`]
    pub fine_source: bool,
    /// [`Block::Crosstalk`]
    pub crosstalk: bool,
    /// [`Block::UnevenResponse`]
    pub uneven_response: bool,
    /// [`Block::LightBlur`]
    pub light_blur: bool,
    /// [`Block::PartialCoherence`]
    pub partial_coherence: bool,
    /// [`Block::Varying`]
    pub varying: bool,
    /// [`Block::Ghost`]
    pub ghost: bool,
    /// [`Block::Dust`]
    pub dust: bool,
}

impl Blocks {
    /// No block.
    pub const NONE: Self = Self {
        fine_source: false,
        crosstalk: false,
        uneven_response: false,
        light_blur: false,
        partial_coherence: false,
        varying: false,
        ghost: false,
        dust: false,
    };

    /// All blocks.
    pub const ALL: Self = Self {
        fine_source: true,
        crosstalk: true,
        uneven_response: true,
        light_blur: true,
        partial_coherence: true,
        varying: true,
        ghost: true,
        dust: true,
    };

    /// The blocks that a display model has.
    #[must_use]
    pub fn of(model: &DisplayModel) -> Self {
        Self {
            fine_source: model.source.order > SOURCE_ORDER,
            crosstalk: !model.crosstalk.is_none(),
            uneven_response: !model.response_variation.is_none(),
            light_blur: !model.light_blur.is_none(),
            partial_coherence: !model.coherence.is_none(),
            varying: !model.variation.is_none(),
            ghost: !model.ghost.is_none(),
            dust: !model.dust.is_none(),
        }
    }

    /// Whether the set has a block.
    #[must_use]
    pub fn contains(mut self, block: Block) -> bool {
        *self.place(block)
    }

    /// The set with one more block.
    #[must_use]
    pub fn with(mut self, block: Block) -> Self {
        *self.place(block) = true;
        self
    }

    /// The set without a block.
    #[must_use]
    pub fn without(mut self, block: Block) -> Self {
        *self.place(block) = false;
        self
    }

    /// The blocks of the set, in the order of [`Block::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Block> {
        Block::ALL.into_iter().filter(move |&block| self.contains(block))
    }

    fn place(&mut self, block: Block) -> &mut bool {
        match block {
            Block::FineSource => &mut self.fine_source,
            Block::Crosstalk => &mut self.crosstalk,
            Block::UnevenResponse => &mut self.uneven_response,
            Block::LightBlur => &mut self.light_blur,
            Block::PartialCoherence => &mut self.partial_coherence,
            Block::Varying => &mut self.varying,
            Block::Ghost => &mut self.ghost,
            Block::Dust => &mut self.dust,
        }
    }
}
