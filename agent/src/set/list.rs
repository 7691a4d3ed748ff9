//! The list of a slot: which versions it has. It is there only while all of them are.
//!
//! ```text
//! lightpath-agent set 1
//! 638nm 12 sha256-0f0f…
//! 515nm 9 sha256-92a0…
//! ```

use crate::settings::is_word;
use crate::slots::{Slot, Slots};
use crate::vouching::read_document;
use lightpath_manifest::Manifest;
use std::fmt::Write as _;
use std::io;
use std::path::PathBuf;

/// Name of the file.
const LIST: &str = "set";
const HEAD: &str = "lightpath-agent set 1";

/// Names of the kernels in the list of a slot; `None`: the slot is not complete.
pub(crate) fn listed(slots: &Slots, slot: Slot) -> Result<Option<Vec<String>>, String> {
    let Some(text) = read(slots, slot)? else { return Ok(None) };
    let names = text.lines().skip(1).filter_map(|line| Some(line.split_once(' ')?.0.to_owned()));
    Ok(Some(names.filter(|name| is_word(name)).collect()))
}

/// Whether a slot has exactly what its list says.
pub(crate) fn is_listed<'a>(
    slots: &Slots,
    slot: Slot,
    found: impl Iterator<Item = (&'a str, &'a Result<Option<Manifest>, String>)>,
) -> bool {
    let found: Option<Vec<_>> = found.map(|(name, found)| Some((name, found.as_ref().ok()?.as_ref()?))).collect();
    found.is_some_and(|found| read(slots, slot) == Ok(Some(text(found.into_iter()))))
}

/// The text of a list. What is read must be equal to it.
pub(super) fn text<'a>(kernels: impl Iterator<Item = (&'a str, &'a Manifest)>) -> String {
    let mut text = format!("{HEAD}\n");
    for (name, Manifest { version, digest, .. }) in kernels {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{name} {version} {digest}");
    }
    text
}

/// The text of the list of a slot; `None`: there is none.
pub(super) fn read(slots: &Slots, slot: Slot) -> Result<Option<String>, String> {
    match read_document(&path(slots, slot)) {
        Ok(bytes) => Ok(Some(String::from_utf8_lossy(&bytes).into_owned())),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(format!("{LIST}: {error}")),
    }
}

pub(super) fn path(slots: &Slots, slot: Slot) -> PathBuf {
    slots.folder(slot).join(LIST)
}
