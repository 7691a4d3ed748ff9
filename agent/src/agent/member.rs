//! An agent that fetches a kernel of a set.

use super::Agent;
use crate::slots::{Slot, Slots};
use lightpath_manifest::Manifest;

/// A kernel that an agent has fetched.
#[derive(Debug)]
pub(crate) struct Offer<'a> {
    pub(crate) slots: &'a Slots,
    pub(crate) slot: Slot,
    pub(crate) manifest: &'a Manifest,
}

impl Agent {
    /// The generation of the manifest that was accepted last. That of the kernel in use is lower, if only other kernels of
    /// the display have moved since.
    pub(crate) fn generation(&self) -> u64 {
        self.state.state.generation
    }

    /// The kernel that the agent has fetched, for a set of kernels.
    pub(crate) fn offer(&self) -> Option<Offer<'_>> {
        let (slot, manifest) = self.in_use.as_ref()?;
        Some(Offer { slots: &self.slots, slot: *slot, manifest })
    }

    /// Lets reports say that this kernel is in use, whatever the agent has fetched.
    pub(crate) fn show(&mut self, manifest: Option<Manifest>) {
        self.shown = Some(manifest);
    }
}
