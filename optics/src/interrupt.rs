//! Early ends of long computations.
//!
//! A single step on a large display can take many seconds. [`Interrupt::run`] runs a computation so that
//! [`Interrupt::raise`] ends it within milliseconds, from another thread. The computation looks at the flag for each
//! row, tile of columns or chunk of numbers. Once the flag is raised, all threads of the computation unwind to
//! [`Interrupt::run`], as after a panic but without its message. A computation that is not interrupted gives the same
//! bits as outside of [`Interrupt::run`].
//!
//! ```
//! use lightpath_optics::interrupt::{Interrupt, Interrupted};
//! use lightpath_optics::{Grid, OpticalSetup, Plane, optimize};
//!
//! let setup = OpticalSetup::try_new(Grid::try_new(90, 160, 8e-6)?, 515e-9, 0.02)?;
//! let target = Plane::filled(90, 160, 0.5);
//! let interrupt = Interrupt::default();
//! // Another thread would raise the flag, on a clone of `interrupt`.
//! interrupt.raise();
//! assert_eq!(interrupt.run(|| optimize(&target, &setup)), Err(Interrupted));
//! # Ok::<(), lightpath_optics::Error>(())
//! ```

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

thread_local! {
    /// Flag of the computation that the thread takes part in.
    static CURRENT: RefCell<Option<Interrupt>> = const { RefCell::new(None) };
}

/// A flag that ends a computation early. Clones share the flag.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

/// The computation was interrupted, and its data are incomplete.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the computation was interrupted")]
pub struct Interrupted;

impl Interrupt {
    /// Ends the computations that [`Self::run`] runs now or later.
    pub fn raise(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the flag was raised.
    #[must_use]
    pub fn is_raised(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Runs `work`, which may use all threads of the current rayon pool. Those threads must not run other computations
    /// meanwhile, because the flag would end these too. Values that an interrupted `work` has changed are incomplete:
    /// drop them.
    ///
    /// # Errors
    ///
    /// [`Interrupted`] when the flag was raised before `work` ended.
    ///
    /// # Panics
    ///
    /// When `work` panics.
    pub fn run<R>(&self, work: impl FnOnce() -> R) -> Result<R, Interrupted> {
        let _watching = Watching::start(self);
        caught(work)
    }
}

/// Ends the computation if its flag was raised: unwinds to [`Interrupt::run`]. Long loops outside of this crate call
/// it, too. Does nothing outside of [`Interrupt::run`].
#[inline]
pub fn check() {
    if CURRENT.with_borrow(|current| current.as_ref().is_some_and(Interrupt::is_raised)) {
        resume_unwind(Box::new(Interrupted));
    }
}

/// Runs `work`, and catches the unwinding of an interrupt.
fn caught<R>(work: impl FnOnce() -> R) -> Result<R, Interrupted> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|payload| match payload.downcast::<Interrupted>() {
        Ok(interrupted) => *interrupted,
        Err(payload) => resume_unwind(payload),
    })
}

/// Lets this thread and all threads of its rayon pool look at a flag.
fn look_at(flag: &Option<Interrupt>) {
    CURRENT.set(flag.clone());
    rayon::broadcast(|_| CURRENT.set(flag.clone()));
}

/// While it exists, threads look at a flag. Afterwards they look at the previous one.
struct Watching {
    before: Option<Interrupt>,
}

impl Watching {
    fn start(interrupt: &Interrupt) -> Self {
        let before = CURRENT.take();
        look_at(&Some(interrupt.clone()));
        Self { before }
    }
}

impl Drop for Watching {
    fn drop(&mut self) {
        look_at(&self.before);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;
    use rayon::{ThreadPool, ThreadPoolBuilder};
    use std::sync::atomic::AtomicUsize;

    fn pool() -> ThreadPool {
        ThreadPoolBuilder::new().num_threads(3).build().unwrap()
    }

    #[test]
    fn raised_flag_ends_work_on_all_threads() {
        let (interrupt, done) = (Interrupt::default(), AtomicUsize::new(0));
        let found = pool().install(|| {
            interrupt.run(|| {
                (0..1_000_000).into_par_iter().for_each(|_| {
                    check();
                    if done.fetch_add(1, Ordering::Relaxed) == 1000 {
                        interrupt.raise();
                    }
                });
            })
        });
        assert_eq!(found, Err(Interrupted));
        let done = done.into_inner();
        assert!((1001..10_000).contains(&done), "{done} of a million");
    }

    #[test]
    fn pool_works_after_an_interruption() {
        let pool = pool();
        let interrupt = Interrupt::default();
        interrupt.raise();
        assert_eq!(pool.install(|| interrupt.run(check)), Err(Interrupted));
        let sum = |()| (0..100_usize).into_par_iter().map(|i| (check(), i).1).sum::<usize>();
        assert_eq!(pool.install(|| sum(())), 4950);
        assert_eq!(pool.install(|| Interrupt::default().run(|| sum(()))), Ok(4950));
    }

    #[test]
    fn inner_flag_hides_outer_flag_until_its_end() {
        let (outer, inner) = (Interrupt::default(), Interrupt::default());
        let found = pool().install(|| {
            outer.run(|| {
                outer.raise();
                assert_eq!(inner.run(|| (check(), 5).1), Ok(5));
                check();
            })
        });
        assert_eq!(found, Err(Interrupted));
    }

    #[test]
    fn panics_stay_panics() {
        let caught = catch_unwind(AssertUnwindSafe(|| Interrupt::default().run(|| panic!("a bug"))));
        assert_eq!(caught.unwrap_err().downcast_ref::<&str>(), Some(&"a bug"));
    }
}
