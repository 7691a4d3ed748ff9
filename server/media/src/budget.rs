//! The memory that reading a file may take, counted before it is allocated.
//!
//! A file from outside may say of itself that it unpacks to any size. So each reader gets a [`Budget`], counts there what
//! it is about to allocate, and refuses the file once that is more than the budget has left. Then the account of a call is
//! an upper bound of its memory, whatever is in the file. Counting also looks at the
//! [interrupt] of the computation, so that a reader ends soon after its client left.

use lightpath_optics::interrupt;
use std::cell::Cell;

/// Memory that reading a file may take.
#[derive(Debug)]
pub struct Budget {
    bytes: u64,
    left: Cell<u64>,
}

/// A file needs more memory than is counted for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "reading the file takes at least {need_bytes} bytes of memory, but {budget_bytes} are counted for a file of its size; \
     save it again without what is packed into it besides the numbers or pixels"
)]
pub struct OverBudget {
    /// Memory up to the allocation that was refused \[bytes\].
    pub need_bytes: u64,
    /// Memory that the file may take \[bytes\].
    pub budget_bytes: u64,
}

impl Budget {
    /// A budget of `bytes`.
    #[must_use]
    pub fn new(bytes: u64) -> Self {
        Self { bytes, left: Cell::new(bytes) }
    }

    /// Counts memory that stays until the reader has returned its result.
    ///
    /// # Errors
    ///
    /// [`OverBudget`] if less is left. Then the caller must not allocate it.
    pub fn take(&self, bytes: u64) -> Result<(), OverBudget> {
        interrupt::check();
        let left = self.left.get().checked_sub(bytes).ok_or_else(|| OverBudget {
            need_bytes: (self.bytes - self.left.get()).saturating_add(bytes),
            budget_bytes: self.bytes,
        })?;
        self.left.set(left);
        Ok(())
    }

    /// Counts memory while the returned value lives.
    ///
    /// # Errors
    ///
    /// [`OverBudget`] if less is left. Then the caller must not allocate it.
    pub fn hold(&self, bytes: u64) -> Result<Held<'_>, OverBudget> {
        self.take(bytes)?;
        Ok(Held { budget: self, bytes })
    }
}

/// Memory that is counted in a budget while this value lives.
#[derive(Debug)]
#[must_use]
pub struct Held<'a> {
    budget: &'a Budget,
    bytes: u64,
}

impl Drop for Held<'_> {
    fn drop(&mut self) {
        self.budget.left.set(self.budget.left.get() + self.bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_optics::interrupt::{Interrupt, Interrupted};

    #[test]
    fn memory_is_refused_before_it_is_allocated_and_free_again_afterwards() {
        let budget = Budget::new(100);
        budget.take(30).unwrap();
        let held = budget.hold(70).unwrap();
        assert_eq!(budget.take(1), Err(OverBudget { need_bytes: 101, budget_bytes: 100 }));
        drop(held);
        assert!(budget.hold(71).is_err() && budget.hold(u64::MAX).is_err());
        budget.take(70).unwrap();
    }

    #[test]
    fn counting_looks_at_the_interrupt() {
        let interrupt = Interrupt::default();
        interrupt.raise();
        // Its threads look at the flag, too, so they are not those of other tests.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert_eq!(pool.install(|| interrupt.run(|| Budget::new(1).take(1))), Err(Interrupted));
    }
}
