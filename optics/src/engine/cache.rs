//! Cache of FFT plans and sampled transfer functions, which engines of several jobs share.

use super::convolution::{Convolver, Kernels, Transfer};
use super::core::{EngineCore, convolver, sample_kernels};
use super::kept_transfers::KeptTransfers;
use super::prepared::{Prepared, PreparedMode};
use super::single_precision::Engine;
use super::sub_samples::offsets_px;
use crate::display::{Carrier, Detector, DisplayModel, Dust, KernelShape, OpticalSetup};
use crate::error::Result;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Largest number of FFT plans in the cache, one for each size and detector. A plan is much smaller than a transfer
/// function.
const PLANS_MAX: usize = 8;

/// Creates engines from cached parts. Engines of one size and detector share FFT plans; engines of one setup and kernel
/// share transfer functions. The cache removes the least recently used parts first.
///
/// Transfer functions of kernels that were learned bin by bin are not cached: such a kernel is as large as its transfer
/// function and is quickly converted to it. Those of a display with all orders, one for each sub-sample, are too large.
/// The exact transfer functions with which ideal optics are judged are cached, too.
#[derive(Debug)]
pub struct EngineCache {
    parts: Arc<Parts>,
}

#[derive(Debug)]
struct Parts {
    transfers_bytes_max: usize,
    cached: Mutex<CachedParts>,
}

/// Cached parts, ordered from the least to the most recently used.
#[derive(Debug, Default)]
struct CachedParts {
    plans: Vec<Arc<Convolver<f32>>>,
    transfers: Vec<CachedTransfers>,
}

/// Transfer functions, with what they are of.
#[derive(Debug)]
enum CachedTransfers {
    /// Those of an engine. The key is its whole model but for the dust, which takes memory and does not change them.
    Kernels(Box<DisplayModel>, Arc<Kernels<f32>>),
    /// An exact one, to a place in the pixels of a setup \[px\].
    Exact(OpticalSetup, [f64; 2], Arc<Transfer<f32>>),
}

impl EngineCache {
    /// Cache that keeps transfer functions of at most `transfers_bytes_max` in total \[bytes\]. A transfer function
    /// takes 32 bytes for each pixel of its display, 9 to 25 times as much if the kernel varies over the SLM; judging ideal
    /// optics in full takes two more.
    #[must_use]
    pub fn new(transfers_bytes_max: usize) -> Self {
        Self { parts: Arc::new(Parts { transfers_bytes_max, cached: Mutex::default() }) }
    }

    /// Creates the same engine as [`Engine::new`], from cached parts where possible.
    ///
    /// # Errors
    ///
    /// The errors of [`Engine::new`].
    pub fn engine(&self, model: &DisplayModel, detector: Detector, carrier: Option<Carrier>) -> Result<Engine> {
        Ok(self.engine_of(&Prepared::new(model, detector, carrier)?))
    }

    /// Creates the engine of a prepared display.
    #[must_use]
    pub fn engine_of(&self, prepared: &Prepared<'_>) -> Engine {
        Engine { core: self.keeping(EngineCore::of_parts(prepared, self.plans(prepared), |mode| self.kernels(mode))) }
    }

    /// An engine that takes exact transfer functions from this cache, and keeps them here.
    pub(crate) fn keeping(&self, core: EngineCore<f32>) -> EngineCore<f32> {
        EngineCore { kept: Some(Arc::clone(&self.parts) as Arc<_>), ..core }
    }

    fn plans(&self, prepared: &Prepared<'_>) -> Arc<Convolver<f32>> {
        let (setup, detector) = (prepared.setup(), prepared.detector());
        if prepared.shows_all_orders() {
            return Arc::new(convolver(&setup, detector, prepared.order_errors().as_ref()));
        }
        let (height_px, width_px) = (prepared.height_px(), prepared.width_px());
        let offsets_px = offsets_px(&setup, detector);
        let fits = |plans: &Arc<Convolver<f32>>| {
            (plans.height_px, plans.width_px, plans.offsets_px()) == (height_px, width_px, &*offsets_px)
        };
        let mut parts = self.parts.lock();
        let plans = match parts.plans.iter().position(fits) {
            Some(at) => parts.plans.remove(at),
            None => Arc::new(convolver(&setup, detector, None)),
        };
        parts.plans.push(Arc::clone(&plans));
        if parts.plans.len() > PLANS_MAX {
            parts.plans.remove(0);
        }
        plans
    }

    fn kernels(&self, mode: &PreparedMode<'_>) -> Arc<Kernels<f32>> {
        if matches!(mode.model().kernel, KernelShape::Bins(_)) {
            return Arc::new(sample_kernels(mode));
        }
        let key = DisplayModel { dust: Dust::none(), ..mode.model().clone() };
        let found = self.parts.found(|part| match part {
            CachedTransfers::Kernels(of, kernels) if **of == key => Some(Arc::clone(kernels)),
            _ => None,
        });
        // The cache is not locked while sampling, which is slow. Two jobs that need the same transfer function at once
        // both sample it.
        found.unwrap_or_else(|| {
            let kernels = Arc::new(sample_kernels(mode));
            self.parts.insert(CachedTransfers::Kernels(Box::new(key), Arc::clone(&kernels)));
            kernels
        })
    }
}

impl Parts {
    fn lock(&self) -> MutexGuard<'_, CachedParts> {
        self.cached.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What `wanted` finds in a part, which becomes the most recently used one.
    fn found<V>(&self, wanted: impl Fn(&CachedTransfers) -> Option<V>) -> Option<V> {
        let mut parts = self.lock();
        let (at, found) = parts.transfers.iter().enumerate().find_map(|(at, part)| Some((at, wanted(part)?)))?;
        let part = parts.transfers.remove(at);
        parts.transfers.push(part);
        Some(found)
    }

    fn insert(&self, part: CachedTransfers) {
        if part.bytes() > self.transfers_bytes_max {
            return;
        }
        let mut parts = self.lock();
        parts.transfers.push(part);
        while parts.transfers.iter().map(CachedTransfers::bytes).sum::<usize>() > self.transfers_bytes_max {
            parts.transfers.remove(0);
        }
    }
}

impl KeptTransfers<f32> for Parts {
    fn find(&self, setup: &OpticalSetup, place_px: [f64; 2]) -> Option<Arc<Transfer<f32>>> {
        self.found(|part| match part {
            CachedTransfers::Exact(of, place, transfer) if (of, *place) == (setup, place_px) => {
                Some(Arc::clone(transfer))
            }
            _ => None,
        })
    }

    fn keep(&self, setup: &OpticalSetup, place_px: [f64; 2], transfer: &Arc<Transfer<f32>>) {
        self.insert(CachedTransfers::Exact(*setup, place_px, Arc::clone(transfer)));
    }
}

impl CachedTransfers {
    fn bytes(&self) -> usize {
        match self {
            Self::Kernels(_, kernels) => kernels.bytes(),
            Self::Exact(_, _, transfer) => transfer.bytes(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::{Grid, Plane, SmoothField};

    fn model(distance_m: f64) -> DisplayModel {
        let setup = OpticalSetup::try_new(Grid::try_new(12, 20, 8e-6).unwrap(), 515e-9, distance_m).unwrap();
        DisplayModel::ideal(setup)
    }

    fn kernels(cache: &EngineCache, model: &DisplayModel) -> Arc<Kernels<f32>> {
        cache.engine(model, Detector::Pixel, None).unwrap().core.kernels
    }

    #[test]
    fn cached_engines_share_data_and_give_same_light_as_new_engines() {
        let cache = EngineCache::new(1 << 20);
        let mut smooth = model(2e-3);
        let mut errors = SmoothField::flat(2);
        errors.log_amplitude.fill(0.1);
        errors.phase.fill(0.2);
        smooth.kernel = KernelShape::Smooth(errors);
        let phase = Plane::from_fn(12, 20, |y, x| (y * 7 + x * 3) as f32 * 0.1);
        for model in [model(2e-3), smooth, model(3e-3)] {
            let first = cache.engine(&model, Detector::Pixel, None).unwrap();
            let again = cache.engine(&model, Detector::Pixel, Some(Carrier::HalfOrderX)).unwrap();
            assert!(Arc::ptr_eq(&first.core.kernels, &again.core.kernels));
            assert!(Arc::ptr_eq(&first.core.convolver, &again.core.convolver));
            let other = cache.engine(&model, Detector::Point, None).unwrap();
            assert!(Arc::ptr_eq(&first.core.kernels, &other.core.kernels));
            assert!(!Arc::ptr_eq(&first.core.convolver, &other.core.convolver));
            let fresh = Engine::new(&model, Detector::Pixel, None).unwrap();
            assert_eq!(first.light(&phase).unwrap().values(), fresh.light(&phase).unwrap().values());
        }
    }

    #[test]
    fn judging_again_uses_the_same_exact_transfer_functions() {
        let cache = EngineCache::new(1 << 20);
        let phase = Plane::from_fn(12, 20, |y, x| (y * 7 + x * 3) as f32 * 0.1);
        let (setup, _) = model(2e-3).setup.planned().unwrap();
        let engine = |setup| cache.engine(&DisplayModel::ideal(setup), Detector::Point, None).unwrap().core;
        let light = |setup| engine(setup).exact_samples(&[std::slice::from_ref(&phase)]).unwrap().unwrap().remove(0);
        let (first, kept) = (light(setup), cache.parts.lock().transfers.len());
        assert_eq!((kept, light(setup).values()), (2, first.values()));
        assert_eq!(cache.parts.lock().transfers.len(), kept);
        let nearer = OpticalSetup::try_new(setup.grid(), 515e-9, 1e-3).unwrap().planned().unwrap().0;
        assert_ne!(light(nearer).values(), first.values());
    }

    #[test]
    fn least_recently_used_kernels_are_removed() {
        let bytes = kernels(&EngineCache::new(0), &model(1e-3)).bytes();
        let cache = EngineCache::new(2 * bytes);
        let [a, b] = [1e-3, 2e-3].map(|distance_m| kernels(&cache, &model(distance_m)));
        assert!(Arc::ptr_eq(&a, &kernels(&cache, &model(1e-3))));
        kernels(&cache, &model(3e-3));
        assert!(Arc::ptr_eq(&a, &kernels(&cache, &model(1e-3))), "the recently used kernel stays in the cache");
        assert!(!Arc::ptr_eq(&b, &kernels(&cache, &model(2e-3))));
    }
}
