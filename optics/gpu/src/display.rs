//! A display in a card's memory.

use crate::card::Card;
use crate::fault::Fault;
use crate::shaders::layout::Layout;
use crate::shaders::modulator::ModulatorParts;
use crate::tables;
use lightpath_optics::engine::Prepared;
use lightpath_optics::engine::prepared::windows;
use lightpath_optics::{Crosstalk, LightBlur};

/// Number of weights of each blur along an axis.
pub(crate) const CROSSTALK_TAPS: usize = Crosstalk::TAPS;
pub(crate) const LIGHT_BLUR_TAPS: usize = LightBlur::TAPS;

/// Tables of a display at one distance.
#[derive(Debug)]
pub(crate) struct DisplayTables {
    pub(crate) parts: ModulatorParts,
    pub(crate) numbers: wgpu::Buffer,
    pub(crate) lit: Option<wgpu::Buffer>,
    pub(crate) phase_gain: Option<wgpu::Buffer>,
    /// Weights of the cross-talk.
    pub(crate) crosstalk: Option<wgpu::Buffer>,
    /// Weights of the light's blur.
    pub(crate) blur: Option<wgpu::Buffer>,
    pub(crate) modes: Vec<ModeTables>,
}

/// Tables of a mode of a display's light.
#[derive(Debug)]
pub(crate) struct ModeTables {
    pub(crate) share: f64,
    /// Transfer functions, at index j · n + i for n windows along each axis.
    pub(crate) transfers: Vec<wgpu::Buffer>,
    /// Windows along x and along y, one after the other; `None` with a single transfer function.
    pub(crate) windows: Option<[wgpu::Buffer; 2]>,
}

impl ModeTables {
    /// Number of windows along an axis.
    pub(crate) fn per_axis(&self) -> usize {
        self.transfers.len().isqrt()
    }
}

impl DisplayTables {
    pub(crate) fn new(card: &Card, display: &Prepared<'_>, layout: &Layout) -> Result<Self, Fault> {
        let modulator = display.modulator();
        let parts = ModulatorParts {
            harmonics: modulator.harmonics().len(),
            lit: modulator.has_source(),
            uneven: modulator.is_uneven(),
            crosstalk: modulator.crosstalk().is_some(),
            grating: modulator.carrier().into(),
        };
        let taps = |ratios: Option<[f64; 2]>, taps: usize| {
            ratios.map(|ratios| card.table(&tables::blur_taps(ratios, taps))).transpose()
        };
        let modes = display.modes().map(|mode| {
            let transfers = mode.transfers();
            let sampled = transfers.iter().map(|of| card.table(&tables::transfer(of, layout)));
            let along: Option<Result<_, Fault>> = (transfers.len() > 1).then(|| {
                let [along_x, along_y] = windows(transfers.len(), layout.height_px, layout.width_px);
                let flat = |windows: Vec<Vec<f64>>| {
                    card.table(&windows.iter().flatten().map(|&factor| factor as f32).collect::<Vec<_>>())
                };
                Ok([flat(along_x)?, flat(along_y)?])
            });
            Ok(ModeTables {
                share: mode.share(),
                transfers: sampled.collect::<Result<_, _>>()?,
                windows: along.transpose()?,
            })
        });
        Ok(Self {
            numbers: card.table(&tables::modulator_numbers(&modulator))?,
            lit: parts.lit.then(|| card.table(&tables::lit(&modulator))).transpose()?,
            phase_gain: parts.uneven.then(|| card.table(&tables::phase_gain(&modulator))).transpose()?,
            crosstalk: taps(modulator.crosstalk().map(|crosstalk| crosstalk.ratios()), CROSSTALK_TAPS)?,
            blur: taps(display.blur().map(|blur| blur.ratios()), LIGHT_BLUR_TAPS)?,
            modes: modes.collect::<Result<_, Fault>>()?,
            parts,
        })
    }
}
