//! What is installed in a directory, for people.

use crate::optics::in_words;
use crate::slots::{Slot, Slots};
use crate::state::{self, Confirmed};
use crate::vouching::{installed_manifest, read_document};
use lightpath_manifest::{Manifest, SignedKeyring, SignedManifest, Wanted};
use std::path::Path;

/// The text, and whether a whole kernel is in use. Nothing is changed, and no server is asked.
#[must_use]
pub fn status(directory: &Path) -> (String, bool) {
    let slots = Slots::at(directory);
    let current = slots.current();
    let mut lines = Vec::new();
    let mut is_good = false;
    for slot in Slot::BOTH {
        let found = verified(&slots, slot);
        let use_ = if current == Some(slot) { ", in use" } else { "" };
        is_good |= current == Some(slot) && matches!(found, Ok(Some(_)));
        let text = match found {
            Ok(Some(manifest)) => about(&manifest),
            Ok(None) => "empty".to_owned(),
            Err(reason) => format!("damaged: {reason}"),
        };
        lines.push(format!("slot {}{use_}: {text}", slot.name()));
    }
    if current.is_none() {
        lines.push("no kernel is in use".to_owned());
    }
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
    (lines.join("\n"), is_good)
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
