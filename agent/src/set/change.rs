//! The slots of a set: what they have, and the change from one to the other.

use super::{KernelSet, list};
use crate::agent::{Offer, is_same_file};
use crate::problem::Problem;
use crate::slots::Slot;
use crate::{download, durable, log};
use lightpath_fail_points as fail;
use lightpath_manifest::Manifest;

impl KernelSet {
    /// Checks the slots, and lets the application use a set that is whole: the one in use, otherwise the other one. Problems
    /// are logged: a disk that became read-only must not keep the agent from starting.
    pub(super) fn recover(&mut self) {
        self.slots.remove_temporary();
        self.members.iter().for_each(|member| member.slots.remove_temporary());
        let linked = self.slots.current();
        // Until the link leads there, no set is known to be in use.
        self.in_use = None;
        let mut whole = Vec::new();
        for slot in Slot::BOTH {
            match self.verified(slot) {
                Ok(Some(manifests)) => whole.push((slot, manifests)),
                Ok(None) => {}
                Err(reason) => {
                    log::line(format_args!("the agent does not use {}: {reason}", self.slots.folder(slot).display()));
                }
            }
        }
        let generation = |manifests: &[Manifest]| manifests.iter().map(|manifest| manifest.generation).max();
        let whole = whole.into_iter().max_by_key(|(slot, set)| (linked == Some(*slot), generation(set)));
        let changed = match &whole {
            Some((slot, _)) if linked == Some(*slot) => Ok(()),
            Some((slot, _)) => self.slots.use_slot(*slot),
            None => self.slots.use_none(),
        };
        match (changed, whole) {
            (Err(problem), _) => log::line(problem),
            (Ok(()), None) => log::line(format_args!(
                "{} has no whole set of kernels: the agent must fetch them",
                self.slots.root().display()
            )),
            (Ok(()), Some(set)) => self.use_set(set),
        }
        self.show();
    }

    /// Whether the agents have other kernels than the set in use.
    pub(super) fn differs(&self) -> bool {
        let Some((_, manifests)) = &self.in_use else { return true };
        self.members
            .iter()
            .zip(manifests)
            .any(|(member, in_use)| member.agent.offer().is_none_or(|offer| !is_same_file(offer.manifest, in_use)))
    }

    /// Copies the kernels of the agents into the slot that is not in use, and lets the application use it.
    pub(super) fn change(&mut self, generation: u64) -> Result<(), Problem> {
        let slot = self.slots.current().map_or(Slot::A, Slot::other);
        self.slots.make(slot)?;
        // From here on the slot is not complete. What an agent of a single kernel left there goes, too.
        let list = list::path(&self.slots, slot);
        durable::remove(&list).map_err(Problem::disk("remove", &list))?;
        self.slots.empty(slot)?;
        let mut manifests = Vec::new();
        for at in 0..self.members.len() {
            manifests.push(self.copy(slot, at)?);
        }
        let text = list::text(self.names().zip(&manifests));
        durable::write_file(&list, text.as_bytes()).map_err(Problem::disk("write", &list))?;
        self.slots.use_slot(slot)?;
        self.use_set((slot, manifests));
        self.show();
        log::line(format_args!("the set has generation {generation}"));
        fail::point("kernel.used").map_err(Problem::disk("use", self.slots.root()))
    }

    /// Brings the kernel of an agent into a slot, unless it is there.
    fn copy(&mut self, slot: Slot, at: usize) -> Result<Manifest, Problem> {
        let member = &mut self.members[at];
        let places = &member.slots;
        let Some(Offer { slots, slot: from, manifest }) = member.agent.offer() else {
            return Err(Problem::NotReady { wavelength: member.name.clone() });
        };
        let found = places.verified(slot, &member.settings).ok().flatten();
        if let Some(found) = found.filter(|found| is_same_file(found, manifest)) {
            return Ok(found);
        }
        places.prepare(slot, &manifest.digest)?;
        places.remove_other_parts(slot, None)?;
        let part = places.part(slot, &manifest.digest);
        let documents = slots.documents(from);
        if let (true, Ok((document, keyring))) = (download::copy(&slots.kernel(from), manifest, &part)?, documents) {
            places.vouch(slot, &document, &keyring)?;
            places.complete(slot, &manifest.digest)?;
            return Ok(manifest.clone());
        }
        durable::remove(&part).map_err(Problem::disk("remove", &part))?;
        // The disk is damaged. The agent fetches the kernel anew.
        member.agent.recover();
        Err(Problem::NotReady { wavelength: member.name.clone() })
    }

    /// What the manifests of a complete slot say, and the reason if the slot is damaged; `None`: it is not complete.
    fn verified(&self, slot: Slot) -> Result<Option<Vec<Manifest>>, String> {
        let Some(found) = list::read(&self.slots, slot)? else { return Ok(None) };
        let mut manifests = Vec::new();
        for member in &self.members {
            let manifest = member.slots.verified(slot, &member.settings);
            let manifest = manifest.map_err(|reason| format!("{}: {reason}", member.name))?;
            manifests.push(manifest.ok_or_else(|| format!("it has no kernel for {}", member.name))?);
        }
        match found == list::text(self.names().zip(&manifests)) {
            true => Ok(Some(manifests)),
            false => Err("it has other kernels than its list says".to_owned()),
        }
    }

    fn use_set(&mut self, (slot, manifests): (Slot, Vec<Manifest>)) {
        for (member, manifest) in self.members.iter().zip(&manifests) {
            let (version, folder) = (manifest.version, member.slots.folder(slot));
            log::line(format_args!(
                "the set uses version {version} of {} in {}",
                member.settings.subject(),
                folder.display()
            ));
        }
        self.in_use = Some((slot, manifests));
    }

    /// Lets the reports of the agents say what the set in use has.
    fn show(&mut self) {
        for (at, member) in self.members.iter_mut().enumerate() {
            member.agent.show(self.in_use.as_ref().map(|(_, manifests)| manifests[at].clone()));
        }
    }

    fn names(&self) -> impl Iterator<Item = &str> {
        self.members.iter().map(|member| member.name.as_str())
    }
}
