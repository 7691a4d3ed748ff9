//! Scratch memory of threads, reused between passes.

use super::axis::Axis;
use super::bins::padded_columns;
use crate::numerics::batch_fft::Planes;
use crate::numerics::real::Number;
use num_complex::Complex;
use std::{
    fmt,
    ops::{Deref, DerefMut},
    sync::{Mutex, PoisonError},
};

/// Number of half-transformed rows that are gathered together. Tiles are far apart in memory, so several rows are read
/// from each tile at a time.
pub(crate) const ROWS: usize = 8;

/// Scratch memory of one thread.
pub(crate) struct Scratch<T> {
    /// Room for two half-transformed rows.
    pub(crate) row: Vec<Complex<T>>,
    /// Room for several half-transformed rows.
    pub(crate) rows: Vec<Complex<T>>,
    /// Sub-samples of a row, one offset after the other.
    pub(crate) samples: Vec<Complex<T>>,
    /// Real numbers: one for each pixel of a row, and one for each sub-sample of a row.
    pub(crate) reals: [Vec<T>; 2],
    /// Spectra of a tile, with room for their transforms.
    pub(crate) tile: TileScratch<T>,
    /// Scratch memory that the FFTs along x need.
    pub(crate) fft: Vec<Complex<T>>,
}

/// Spectra of a tile, with room for their transforms.
pub(crate) struct TileScratch<T> {
    /// Even and odd bins of the spectra.
    pub(super) spectra: [Planes<T>; 2],
    /// Even and odd bins for one offset or one kernel.
    pub(super) shifted: [Planes<T>; 2],
    pub(super) spare: Planes<T>,
}

impl<T: Number> TileScratch<T> {
    fn new(len: usize) -> Self {
        let planes = || Planes::zeros(len);
        Self { spectra: [planes(), planes()], shifted: [planes(), planes()], spare: planes() }
    }
}

/// Pool of scratch memory: lends it to threads, which return it when they are done.
pub(crate) struct ScratchPool<T> {
    idle: Mutex<Vec<Scratch<T>>>,
    samples_len: usize,
    width_px: usize,
    height_px: usize,
    tile_columns: usize,
    fft_len: usize,
}

impl<T> fmt::Debug for ScratchPool<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ScratchPool").finish_non_exhaustive()
    }
}

impl<T: Number> ScratchPool<T> {
    pub(crate) fn new(along_x: &Axis<T>, along_y: &Axis<T>, tile_columns: usize) -> Self {
        let needs = [&along_x.forward, &along_x.inverse];
        Self {
            idle: Mutex::new(Vec::new()),
            samples_len: along_x.offsets.len() * along_y.offsets.len() * along_x.n,
            width_px: along_x.n,
            height_px: along_y.n,
            tile_columns,
            fft_len: needs.iter().map(|fft| fft.get_inplace_scratch_len()).max().unwrap_or(0),
        }
    }

    pub(crate) fn take(&self) -> PooledScratch<'_, T> {
        let idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner).pop();
        PooledScratch { pool: self, scratch: Some(idle.unwrap_or_else(|| self.allocate())) }
    }

    fn allocate(&self) -> Scratch<T> {
        let zeros = |len| vec![Complex::new(T::zero(), T::zero()); len];
        Scratch {
            row: zeros(4 * self.width_px),
            rows: zeros(ROWS * padded_columns(self.width_px, self.tile_columns)),
            samples: zeros(self.samples_len),
            reals: [vec![T::zero(); self.width_px], vec![T::zero(); self.samples_len]],
            tile: TileScratch::new(self.height_px * self.tile_columns),
            fft: zeros(self.fft_len),
        }
    }
}

/// Scratch memory on loan from a pool; dropping it returns it to the pool.
pub(crate) struct PooledScratch<'a, T> {
    pool: &'a ScratchPool<T>,
    scratch: Option<Scratch<T>>,
}

impl<T> Deref for PooledScratch<'_, T> {
    type Target = Scratch<T>;

    fn deref(&self) -> &Scratch<T> {
        self.scratch.as_ref().expect("the scratch memory is taken out only when dropped")
    }
}

impl<T> DerefMut for PooledScratch<'_, T> {
    fn deref_mut(&mut self) -> &mut Scratch<T> {
        self.scratch.as_mut().expect("the scratch memory is taken out only when dropped")
    }
}

/// Room for two half-transformed rows.
impl<T> AsMut<[Complex<T>]> for PooledScratch<'_, T> {
    fn as_mut(&mut self) -> &mut [Complex<T>] {
        &mut self.row
    }
}

impl<T> Drop for PooledScratch<'_, T> {
    fn drop(&mut self) {
        if let Some(scratch) = self.scratch.take() {
            self.pool.idle.lock().unwrap_or_else(PoisonError::into_inner).push(scratch);
        }
    }
}
