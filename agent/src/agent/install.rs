//! From an accepted manifest to a kernel in use.

use super::{Agent, is_same_file};
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
    /// Fetches the file of a manifest, tests it, and lets the application use it.
    pub(super) fn install(&mut self, manifest: &Manifest, document: &Document) -> Result<(), Problem> {
        let slot = self.slots.current().map_or(Slot::A, Slot::other);
        self.slots.create(slot)?;
        self.slots.remove_other_parts(slot, Some(&manifest.digest))?;
        let found = self.slots.vouched(slot, &self.settings);
        let is_there = found.is_ok_and(|found| found.is_some_and(|found| is_same_file(&found, manifest)));
        if is_there && self.slots.check_kernel(slot, manifest).is_ok() {
            self.test(manifest, &self.slots.kernel(slot))?;
            self.slots.vouch(slot, &document.bytes, &self.vouching.document)?;
        } else {
            let part = self.slots.part(slot, &manifest.digest);
            self.make_space(slot, manifest, &part)?;
            log::line(format_args!("the agent fetches version {} ({} bytes)", manifest.version, manifest.size_bytes));
            download::fetch(&self.http, self.settings.pace, manifest, &part)?;
            self.test(manifest, &part)?;
            self.slots.vouch(slot, &document.bytes, &self.vouching.document)?;
            self.slots.complete(slot, &manifest.digest)?;
        }
        self.slots.use_slot(slot)?;
        self.in_use = Some((slot, manifest.clone()));
        self.state.state.rejected = None;
        log::line(format_args!(
            "the agent uses version {} of {}, generation {}",
            manifest.version, self.settings.kernel, manifest.generation
        ));
        fail::point("kernel.used").map_err(Problem::disk("use", &self.slots.kernel(slot)))
    }

    /// Runs the device's own test. A version that it refuses is remembered and removed. If the test cannot be started,
    /// the fetched file stays for the next try.
    fn test(&mut self, manifest: &Manifest, kernel: &Path) -> Result<(), Problem> {
        let Some(program) = &self.settings.self_test else { return Ok(()) };
        log::line(format_args!("{} tests version {}", program.display(), manifest.version));
        let not_started = |source| Problem::SelfTestStart { program: program.clone(), source };
        let reason = match self_test::run(program, kernel, self.settings.self_test_limit).map_err(not_started)? {
            Verdict::Good(loss) => {
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
        let received = fs::metadata(part).map_or(0, |metadata| metadata.len());
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
