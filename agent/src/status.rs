//! What is installed in a directory, for people.

use crate::optics::in_words;
use crate::set::{self, KERNELS};
use crate::slots::{Slot, Slots};
use crate::state::{self, Confirmed};
use crate::vouching::{installed_manifest, read_document};
use lightpath_manifest::{Manifest, SignedKeyring, SignedManifest, Wanted};
use std::fs;
use std::path::Path;

/// The text, and whether a whole kernel is in use, or a whole set of kernels. Nothing is changed, and no server is asked.
#[must_use]
pub fn status(directory: &Path) -> (String, bool) {
    let slots = Slots::at(directory);
    let current = slots.current();
    // An agent of a single kernel leaves the folders of a set that was there before it.
    if directory.join(KERNELS).is_dir() && !current.is_some_and(|slot| slots.kernel(slot).exists()) {
        return of_set(&slots);
    }
    let mut lines = Vec::new();
    let mut is_good = false;
    for slot in Slot::BOTH {
        let found = verified(&slots, slot);
        is_good |= current == Some(slot) && matches!(found, Ok(Some(_)));
        lines.push(format!("slot {}{}: {}", slot.name(), use_(current == Some(slot)), in_slot(found)));
    }
    if current.is_none() {
        lines.push("no kernel is in use".to_owned());
    }
    lines.extend(remembered(&slots));
    (lines.join("\n"), is_good)
}

/// The same for a directory with a set of kernels.
fn of_set(slots: &Slots) -> (String, bool) {
    let current = slots.current();
    let mut lines = Vec::new();
    let mut is_good = false;
    for slot in Slot::BOTH {
        let is_used = current == Some(slot);
        let begin = format!("slot {}{}:", slot.name(), use_(is_used));
        match set::listed(slots, slot) {
            Err(reason) => lines.push(format!("{begin} damaged: {reason}")),
            Ok(None) => lines.push(format!("{begin} no whole set")),
            Ok(Some(names)) => {
                lines.push(begin);
                let found = names.iter().map(|name| verified(&Slots::of_member(slots.root(), name), slot));
                let found: Vec<_> = found.collect();
                is_good |= is_used && set::is_listed(slots, slot, names.iter().map(String::as_str).zip(&found));
                let line = |(name, found)| format!("  {name}: {}", in_slot(found));
                lines.extend(names.iter().zip(found).map(line));
            }
        }
    }
    if current.is_none() {
        lines.push("no set of kernels is in use".to_owned());
    }
    let mut agents: Vec<_> = fs::read_dir(slots.file(KERNELS)).into_iter().flatten().flatten().collect();
    agents.sort_by_key(fs::DirEntry::file_name);
    for agent in agents {
        lines.push(format!("{}:", agent.file_name().display()));
        lines.extend(remembered(&Slots::at(&agent.path())).into_iter().map(|line| format!("  {line}")));
    }
    (lines.join("\n"), is_good)
}

fn use_(is_used: bool) -> &'static str {
    if is_used { ", in use" } else { "" }
}

fn in_slot(found: Result<Option<Manifest>, String>) -> String {
    match found {
        Ok(Some(manifest)) => about(&manifest),
        Ok(None) => "empty".to_owned(),
        Err(reason) => format!("damaged: {reason}"),
    }
}

/// What an agent remembers.
fn remembered(slots: &Slots) -> Vec<String> {
    let mut lines = Vec::new();
    let keyring = read_document(&slots.file("keyring")).ok().and_then(|bytes| SignedKeyring::parse(&bytes).ok());
    if let Some(keyring) = keyring {
        let keyring = keyring.unchecked();
        lines.push(format!("keyring: version {}, until {}", keyring.version, keyring.expires));
    }
    if let Ok(Some(state)) = state::read(&slots.file("state")) {
        lines.push(format!("highest generation: {}", state.generation));
        if let Some(Confirmed { issued, expires }) = state.confirmed {
            lines.push(format!("last manifest: from {issued} until {expires}"));
        }
        if let Some(rejected) = state.rejected {
            let (version, generation) = (rejected.version, rejected.generation);
            lines.push(format!("given up: version {version}, generation {generation}: {}", rejected.message));
        }
        if let Some((digest, loss)) = state.loss {
            lines.push(format!("loss of the self-test: {loss} with {digest}"));
        }
    }
    lines
}

fn about(manifest: &Manifest) -> String {
    let Manifest { display, generation, version, format, digest, size_bytes, .. } = manifest;
    let optics = in_words(&manifest.optics);
    format!("version {version} of {display}, {optics}, generation {generation}, {format}, {size_bytes} bytes, {digest}")
}

/// The manifest of a slot whose kernel is whole.
fn verified(slots: &Slots, slot: Slot) -> Result<Option<Manifest>, String> {
    if !slots.has_kernel(slot)? {
        return Ok(None);
    }
    let (manifest, keyring) = slots.documents(slot)?;
    let said = SignedManifest::parse(&manifest).map_err(|error| error.to_string())?;
    let Manifest { display, optics, format, .. } = said.unchecked().clone();
    let wanted = Wanted { display, optics, format, generation: 0 };
    let manifest = installed_manifest(&manifest, &keyring, &wanted).map_err(|error| error.to_string())?;
    slots.check_kernel(slot, &manifest)?;
    Ok(Some(manifest))
}
