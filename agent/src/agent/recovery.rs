//! What the agent does with what it finds on the disk.

use super::{Agent, pinned_text};
use crate::log;
use crate::problem::Problem;
use crate::slots::Slot;
use crate::state::{Proof, State};
use lightpath_manifest::Manifest;

impl Agent {
    /// Checks both slots, removes what is damaged, and lets the application use a kernel that is whole. Problems are
    /// logged: a disk that became read-only must not keep the agent from starting.
    pub(crate) fn recover(&mut self) {
        self.slots.remove_temporary();
        let linked = self.slots.current();
        let (mut whole, mut damaged) = (Vec::new(), Vec::new());
        for slot in Slot::BOTH {
            match self.slots.verified(slot, &self.settings) {
                Ok(Some(manifest)) => whole.push((slot, manifest)),
                Ok(None) => {}
                Err(reason) => {
                    let folder = self.slots.folder(slot);
                    log::line(format_args!("the agent does not use {}: {reason}", folder.display()));
                    damaged.push(slot);
                }
            }
        }
        self.remember(&whole);
        let best = best(whole, linked);
        if best.as_ref().map(|(slot, _)| *slot) != linked {
            // What the last manifest said must be done again.
            self.state.state.etag.clear();
        }
        if let Err(problem) = self.use_what_is_whole(best, linked, &damaged) {
            log::line(problem);
        }
        match &self.in_use {
            Some((slot, manifest)) => log::line(format_args!(
                "the agent uses version {} of {} in {}",
                manifest.version,
                self.settings.subject(),
                self.slots.folder(*slot).display()
            )),
            None => log::line(format_args!(
                "{} has no whole kernel of {}: the agent must fetch it",
                self.slots.root().display(),
                self.settings.subject()
            )),
        }
    }

    fn use_what_is_whole(
        &mut self,
        best: Option<(Slot, Manifest)>,
        linked: Option<Slot>,
        damaged: &[Slot],
    ) -> Result<(), Problem> {
        // Whatever is in use: it is not known to be whole before the link leads there.
        self.in_use = None;
        match best {
            Some((slot, manifest)) => {
                if linked != Some(slot) {
                    self.slots.use_slot(slot)?;
                }
                self.in_use = Some((slot, manifest));
                self.slots.remove_other_parts(slot, None)?;
            }
            None => self.slots.use_none()?,
        }
        for slot in damaged {
            // The other slot is good, or free.
            self.slots.empty(*slot).unwrap_or_else(log::line);
        }
        self.state.save()
    }

    /// What the state must know: at least what the slots show, and nothing of another display or another server.
    fn remember(&mut self, whole: &[(Slot, Manifest)]) {
        let pinned = pinned_text(&self.settings);
        let state = &mut self.state.state;
        let is_other_display = !state.display.is_empty() && state.display != self.settings.display;
        let is_other_server = !state.roots.is_empty() && state.keyring > 0 && self.vouching.keyring().is_none() && {
            let mut earlier = state.roots.split(',');
            !earlier.any(|root| pinned.split(',').any(|text| text == root))
        };
        if is_other_display || is_other_server {
            log::line("the agent begins anew, because the display or all root keys are others than before");
            let (keyring, proof) = if is_other_server { (0, Proof::Keyring) } else { (state.keyring, Proof::Manifest) };
            self.state.begin_anew(State { keyring, ..State::default() }, proof);
        }
        let state = &mut self.state.state;
        if state.display.is_empty() && !is_other_server {
            // The state was lost: the generation that it had is at least that of the slots.
            state.generation = whole.iter().map(|(_, manifest)| manifest.generation).max().unwrap_or_default();
        }
        state.display.clone_from(&self.settings.display);
        if state.roots.is_empty() {
            state.roots = pinned;
        }
        let version = self.vouching.keyring().map_or(0, |keyring| keyring.version);
        state.keyring = state.keyring.max(version);
    }
}

/// The slot to use: the one in use if it is whole, otherwise the one with the higher generation.
fn best(whole: Vec<(Slot, Manifest)>, linked: Option<Slot>) -> Option<(Slot, Manifest)> {
    whole.into_iter().max_by_key(|(slot, manifest)| (linked == Some(*slot), manifest.generation))
}
