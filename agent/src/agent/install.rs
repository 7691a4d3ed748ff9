//! From an accepted manifest to a kernel in use.

use super::{Agent, have_same_bytes};
use crate::http::Document;
use crate::problem::Problem;
use crate::report::shortened;
use crate::self_test::{self, Verdict};
use crate::slots::Slot;
use crate::state::Rejected;
use crate::{download, log};
use lightpath_fail_points as fail;
use lightpath_manifest::Manifest;
use std::fs;
use std::path::Path;

/// Space that must stay free for the small files of the directory \[bytes\].
const SPARE_BYTES: u64 = 64 << 10;

impl Agent {
    /// Brings the file of a manifest into a slot that is not in use, tests it, and lets the application use it. A slot that
    /// cannot be used is no obstacle while the other one is free.
    pub(super) fn install(&mut self, manifest: &Manifest, document: &Document) -> Result<(), Problem> {
        let Some(used) = self.slots.current() else {
            return match self.install_into(Slot::A, manifest, document) {
                Err(problem) if problem.is_of_folder(&self.slots.folder(Slot::A)) => {
                    log::line(format_args!("{problem}; the agent takes the other slot"));
                    self.install_into(Slot::B, manifest, document)
                }
                ended => ended,
            };
        };
        self.install_into(used.other(), manifest, document)
    }

    fn install_into(&mut self, slot: Slot, manifest: &Manifest, document: &Document) -> Result<(), Problem> {
        self.slots.prepare(slot, &manifest.digest)?;
        self.slots.remove_other_parts(slot, Some(&manifest.digest))?;
        let found = self.slots.vouched(slot, &self.settings);
        let is_there = found.is_ok_and(|found| found.is_some_and(|found| have_same_bytes(&found, manifest)));
        if is_there && self.slots.check_kernel(slot, manifest).is_ok() {
            self.test(manifest, &self.slots.kernel(slot))?;
            self.slots.vouch(slot, &document.bytes, &self.vouching.document)?;
        } else {
            let part = self.slots.part(slot, &manifest.digest);
            self.make_space(slot, manifest, &part)?;
            self.bring(manifest, &part)?;
            self.test(manifest, &part)?;
            self.slots.vouch(slot, &document.bytes, &self.vouching.document)?;
            self.slots.complete(slot, &manifest.digest)?;
        }
        self.slots.use_slot(slot)?;
        self.in_use = Some((slot, manifest.clone()));
        self.state.state.rejected = None;
        log::line(format_args!(
            "the agent uses version {} of {}, generation {}",
            manifest.version,
            self.settings.subject(),
            manifest.generation
        ));
        fail::point("kernel.used").map_err(Problem::disk("use", &self.slots.kernel(slot)))
    }

    /// Brings the file of a manifest to `part`: from the slot in use, if another version there has the same bytes, or from
    /// the server.
    fn bring(&self, manifest: &Manifest, part: &Path) -> Result<(), Problem> {
        let Manifest { version, size_bytes, .. } = manifest;
        if let Some((slot, known)) = self.in_use.as_ref().filter(|(_, known)| have_same_bytes(known, manifest)) {
            log::line(format_args!("the agent copies version {version} from version {}: same bytes", known.version));
            match download::copy(&self.slots.kernel(*slot), manifest, part) {
                Ok(true) => return Ok(()),
                Ok(false) => log::line("the copy has other bytes, because the disk is damaged"),
                Err(problem) => log::line(problem),
            }
            crate::durable::remove(part).map_err(Problem::disk("remove", part))?;
        }
        log::line(format_args!("the agent fetches version {version} ({size_bytes} bytes)"));
        download::fetch(&self.http, self.settings.pace, &self.known_kernel().unwrap_or_default(), manifest, part)
    }

    /// Runs the device's own test. A version that it refuses is remembered and removed. If the test cannot be started,
    /// the fetched file stays for the next try.
    fn test(&mut self, manifest: &Manifest, kernel: &Path) -> Result<(), Problem> {
        let Some(program) = &self.settings.self_test else { return Ok(()) };
        log::line(format_args!("{} tests version {}", program.display(), manifest.version));
        let not_started = |source| Problem::SelfTestStart { program: program.clone(), source };
        let reason = match self_test::run(program, kernel, self.settings.self_test_limit).map_err(not_started)? {
            Verdict::Good(loss) => {
                require_unchanged(manifest, kernel, program)?;
                self.state.state.loss = loss.map(|loss| (manifest.digest.clone(), loss));
                return self.state.save();
            }
            Verdict::Bad(reason) => reason,
        };
        let version = manifest.version;
        let problem = Problem::SelfTest { version, reason };
        self.state.state.rejected = Some(Rejected {
            version,
            generation: manifest.generation,
            digest: manifest.digest.clone(),
            message: shortened(&problem.to_string()).to_owned(),
        });
        self.state.save()?;
        crate::durable::remove(kernel).map_err(Problem::disk("remove", kernel))?;
        Err(problem)
    }

    /// Checks that the disk has space for the rest of a file, and gives up the kernel of the slot if it has not.
    fn make_space(&self, slot: Slot, manifest: &Manifest, part: &Path) -> Result<(), Problem> {
        let received = fs::symlink_metadata(part).map_or(0, |metadata| metadata.len());
        let wanted_bytes = manifest.size_bytes.saturating_sub(received).saturating_add(SPARE_BYTES);
        let folder = self.slots.folder(slot);
        let free = || {
            let space =
                rustix::fs::statvfs(&folder).map_err(|error| Problem::disk("measure", &folder)(error.into()))?;
            Ok::<u64, Problem>(space.f_bavail.saturating_mul(space.f_frsize))
        };
        let mut free_bytes = free()?;
        if free_bytes < wanted_bytes && self.slots.kernel(slot).exists() {
            log::line(format_args!("the agent removes the kernel of {}, because the disk is full", folder.display()));
            self.slots.empty(slot)?;
            free_bytes = free()?;
        }
        if free_bytes < wanted_bytes {
            return Err(Problem::Full { path: self.slots.root().to_owned(), wanted_bytes, free_bytes });
        }
        Ok(())
    }
}

/// Refuses a file that the self-test has changed: what it tested, or what the application would get, is not the kernel.
fn require_unchanged(manifest: &Manifest, kernel: &Path, program: &Path) -> Result<(), Problem> {
    if download::digest_of_file(kernel).is_ok_and(|found| found == manifest.digest) {
        return Ok(());
    }
    crate::durable::remove(kernel).map_err(Problem::disk("remove", kernel))?;
    Err(Problem::Changed { version: manifest.version, program: program.to_owned() })
}
