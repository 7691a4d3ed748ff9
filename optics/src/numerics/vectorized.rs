//! Long loops as vector instructions.

use pulp::{Arch, Simd, WithSimd};

/// Runs `work`, compiled for the vector instructions of the machine. Mark the closure as `#[inline(always)]`.
///
/// [`Arch::dispatch`] takes closures, too, but calls them through a function of their own, which the compiler does not
/// inline if it is long. Then it is compiled for the oldest processors.
#[inline(always)]
pub(crate) fn vectorized<R>(work: impl FnMut() -> R) -> R {
    Arch::new().dispatch(Work(work))
}

struct Work<F>(F);

impl<R, F: FnMut() -> R> WithSimd for Work<F> {
    type Output = R;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) -> R {
        (self.0)()
    }
}
