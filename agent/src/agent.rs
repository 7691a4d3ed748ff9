//! The agent: the order of all steps.

mod install;
mod member;
mod recovery;

pub(crate) use member::Offer;

use crate::http::{Answer, Document, Http};
use crate::problem::Problem;
use crate::report::{Reporter, Standing};
use crate::rounds::Rounds;
use crate::slots::{Lock, Slot, Slots};
use crate::state::{Confirmed, Proof, StateFile};
use crate::vouching::Vouching;
use crate::{Pace, Settings, kernel_search, log};
use lightpath_manifest::{Distrust, Manifest, Now, Time};
use std::time::{Duration, Instant};

/// The result of one question to the server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Checked {
    /// Version in use; 0: none.
    pub version: u32,
    /// Whether the version in use is the one that the server offers. It is not, if the agent gave that one up before.
    pub is_offered: bool,
    /// Time after which to ask again.
    pub poll_after: Duration,
}

/// Keeps a verified kernel in a directory.
#[derive(Debug)]
pub struct Agent {
    settings: Settings,
    http: Http,
    slots: Slots,
    state: StateFile,
    vouching: Vouching,
    /// The slot in use and what its manifest says.
    in_use: Option<(Slot, Manifest)>,
    /// When the agent learned the earliest time of its state; not before its start.
    earliest_at: Instant,
    /// When the keyring was fetched last; `None`: not since the start.
    keyring_at: Option<Instant>,
    /// The last problem that the server should know of, and that is no version's fault.
    trouble: Option<String>,
    reporter: Reporter,
    /// For an agent that fetches a kernel of a set: what reports say is in use, which is the kernel of the set.
    shown: Option<Option<Manifest>>,
    _lock: Lock,
}

impl Agent {
    /// Opens the directory, checks what lies in it, and lets the application use a kernel that is whole:
    ///
    /// 1. What a kill has left half written is removed.
    /// 2. The slot in use is checked: its kernel against its manifest, its manifest against the keyring beside it.
    /// 3. If it is damaged, the other slot is used, if that one is whole; otherwise none.
    ///
    /// # Errors
    ///
    /// [`Problem::Locked`], [`Problem::Setting`], and [`Problem::Disk`] if the directory cannot be made or read.
    pub fn start(settings: Settings) -> Result<Self, Problem> {
        let http = Http::new(&settings)?;
        let (slots, lock) = Slots::open(&settings.directory)?;
        let state = StateFile::open(slots.file("state"));
        let vouching = Vouching::load(&slots.file("keyring"), &settings, &state.state.roots);
        let reporter = Reporter::new(&settings.pace);
        let mut agent = Self {
            settings,
            http,
            slots,
            state,
            vouching,
            in_use: None,
            earliest_at: Instant::now(),
            keyring_at: None,
            trouble: None,
            reporter,
            shown: None,
            _lock: lock,
        };
        if let Now::AtLeast(earliest) = agent.now() {
            log::line(format_args!("the agent takes {earliest} or later for the time: no clock says a later one"));
        }
        agent.recover();
        Ok(agent)
    }

    /// Asks the server once, and does what follows from its answer:
    ///
    /// 1. The keyring is fetched at the start, each day and before its end.
    /// 2. The server is asked for the id of the kernel, if that is not known.
    /// 3. The manifest is fetched, unless it is still the same. It must be for this kernel, count now, and have no lower
    ///    generation than one before. Then its generation is remembered.
    /// 4. Its file is fetched into the slot that is not in use, and its size and digest are checked.
    /// 5. The self-test runs. A version that it refuses is not tried again.
    /// 6. The slot becomes the one in use.
    ///
    /// The server may hold its answer back for `wait`, until something changes. An answer that nothing has changed counts
    /// until the manifest that was accepted last expires: a server without keys can give it, too.
    ///
    /// # Errors
    ///
    /// [`Problem`]. The kernel in use stays as it was.
    pub fn check(&mut self, wait: Duration) -> Result<Checked, Problem> {
        let checked = self.check_and_install(wait).map_err(|problem| self.unconfirmed(problem));
        match &checked {
            // The state remembers a version that the self-test refused.
            Ok(_) | Err(Problem::SelfTest { .. }) => self.trouble = None,
            // The network, the server or the device is at fault, and not the version: a rollout must not count it.
            Err(problem) if problem.is_for_report() => self.trouble = Some(problem.to_string()),
            Err(_) => {}
        }
        checked
    }

    /// Reports to the server, if a report is due and the kernel's id is known. Problems are logged.
    pub fn report(&mut self) {
        let Some(kernel) = self.known_kernel() else { return };
        let standing = self.standing(kernel);
        self.reporter.send(&standing, &self.http, &self.settings);
    }

    /// Checks and reports for ever. A problem is logged, and the next try comes after a pause.
    pub fn run(&mut self) -> ! {
        self.go_on()
    }

    /// The slot and the version in use.
    #[must_use]
    pub fn in_use(&self) -> Option<(Slot, u32)> {
        self.in_use.as_ref().map(|(slot, manifest)| (*slot, manifest.version))
    }

    /// Whether the application has a kernel whose bytes are those of an accepted manifest.
    #[must_use]
    pub fn has_whole_kernel(&self) -> bool {
        self.in_use.as_ref().is_some_and(|(slot, manifest)| {
            self.slots.current() == Some(*slot) && self.slots.check_kernel(*slot, manifest).is_ok()
        })
    }

    fn check_and_install(&mut self, wait: Duration) -> Result<Checked, Problem> {
        if self.slots.current() != self.in_use.as_ref().map(|(slot, _)| *slot) {
            // A failed step, or another program, has moved the link.
            self.recover();
        }
        self.look_at_keyring()?;
        // Without a kernel the manifest is needed, also the same one again. After its end, too: everybody can answer that
        // nothing has changed.
        let counts = self.state.state.confirmed.is_some_and(|confirmed| !self.now().has_reached(confirmed.expires));
        let etag = if self.in_use.is_some() && counts { self.state.state.etag.clone() } else { String::new() };
        let answer = self.ask_for_manifest(&etag, wait)?;
        let poll_after = answer.poll_after;
        let is_offered = match answer.document {
            Some(document) => self.follow(&document)?,
            None => self.state.state.rejected.is_none(),
        };
        let version = self.in_use.as_ref().map_or(0, |(_, manifest)| manifest.version);
        Ok(Checked { version, is_offered, poll_after })
    }

    /// Asks for the manifest. If the server has no kernel with the id any more, it is asked for the id again.
    fn ask_for_manifest(&mut self, etag: &str, wait: Duration) -> Result<Answer, Problem> {
        let kernel = self.kernel()?;
        let answer = self.http.manifest(&kernel, etag, wait);
        if self.settings.kernel.is_none() && matches!(answer, Err(Problem::Refused { status: 404, .. })) {
            self.state.state.kernel = None;
            let found = self.kernel()?;
            if found != kernel {
                return self.http.manifest(&found, etag, wait);
            }
        }
        answer
    }

    /// Id of the kernel: that of the settings, the one that the state remembers, or what the server says.
    fn kernel(&mut self) -> Result<String, Problem> {
        if let Some(known) = self.known_kernel() {
            return Ok(known);
        }
        let found = kernel_search::find(&self.http, &self.settings)?;
        self.state.state.kernel = Some((self.settings.optics.digest(), found.clone()));
        self.state.save()?;
        Ok(found)
    }

    /// Id of the kernel, if the server need not be asked.
    fn known_kernel(&self) -> Option<String> {
        let remembered = || {
            let (optics, id) = self.state.state.kernel.as_ref()?;
            (*optics == self.settings.optics.digest()).then(|| id.clone())
        };
        self.settings.kernel.clone().or_else(remembered)
    }

    /// The time: that of the clock, unless documents show that it is later, or there is none. Then it is at least the time
    /// of the latest document, and what has passed since.
    fn now(&self) -> Now {
        let passed_s = i64::try_from(self.earliest_at.elapsed().as_secs()).unwrap_or(i64::MAX);
        let later = |time: Time| Time::from_unix_s(time.unix_s().saturating_add(passed_s)).unwrap_or(time);
        let earliest = self.state.state.earliest.map_or(Time::EPOCH, later);
        match self.settings.clock.now() {
            Some(now) if now >= earliest => Now::At(now),
            _ => Now::AtLeast(earliest),
        }
    }

    /// Notes when an accepted document was issued.
    fn learn_time(&mut self, issued: Time) {
        if self.state.state.earliest.is_none_or(|known| known < issued) {
            (self.state.state.earliest, self.earliest_at) = (Some(issued), Instant::now());
        }
    }

    /// A problem, with the fact that no manifest counts any more, if that is so.
    fn unconfirmed(&self, problem: Problem) -> Problem {
        match self.state.state.confirmed {
            Some(Confirmed { issued, expires }) if self.now().has_reached(expires) => {
                Problem::Unconfirmed { issued, expires, cause: Box::new(problem) }
            }
            _ => problem,
        }
    }

    /// Does what a manifest says. Returns whether its version is in use now.
    fn follow(&mut self, document: &Document) -> Result<bool, Problem> {
        let manifest = self.accept(document)?;
        let is_in_use = self.in_use.as_ref().is_some_and(|(_, known)| is_same_file(known, &manifest));
        let is_rejected = self.state.state.rejected.as_ref().is_some_and(|rejected| rejected.is_of(&manifest));
        if is_in_use {
            self.state.state.rejected = None;
        } else if is_rejected {
            log::line(format_args!("the agent does not try version {} again: it was refused before", manifest.version));
        } else {
            self.install(&manifest, document)?;
        }
        for slot in Slot::BOTH {
            self.slots.remove_other_parts(slot, None)?;
        }
        self.state.set_etag(document.etag.as_deref());
        self.state.save()?;
        Ok(self.state.state.rejected.is_none())
    }

    /// Checks a manifest, with a newer keyring if it needs one, and remembers its generation.
    fn accept(&mut self, document: &Document) -> Result<Manifest, Problem> {
        let wanted = self.settings.wanted(self.state.state.generation);
        let now = self.now();
        let accepted = |vouching: &Vouching| vouching.trust.manifest(&document.bytes, &wanted, now);
        let manifest = match accepted(&self.vouching) {
            Err(Distrust::UnknownKey { .. } | Distrust::KeyringTime { .. }) => {
                self.fetch_keyring()?;
                accepted(&self.vouching).map_err(Problem::Manifest)?
            }
            Err(distrust @ Distrust::OtherOptics { .. }) => {
                // The id leads to another kernel than it did.
                self.state.state.kernel = None;
                return Err(Problem::Manifest(distrust));
            }
            manifest => manifest.map_err(Problem::Manifest)?,
        };
        let is_other =
            self.state.state.rejected.as_ref().is_some_and(|rejected| rejected.generation < manifest.generation);
        if is_other {
            self.state.state.rejected = None;
        }
        self.state.state.generation = manifest.generation;
        self.learn_time(manifest.issued);
        self.state.state.confirmed = Some(Confirmed { issued: manifest.issued, expires: manifest.expires });
        self.state.note(Proof::Manifest);
        self.state.save()?;
        Ok(manifest)
    }

    /// Fetches the keyring at the start, each day and before its end. An older one that still counts is enough to go on.
    fn look_at_keyring(&mut self) -> Result<(), Problem> {
        let is_due = self.keyring_at.is_none_or(|at| at.elapsed() >= self.settings.pace.keyring_interval);
        if !is_due && !self.vouching.must_be_renewed(self.now().earliest()) {
            return Ok(());
        }
        match self.fetch_keyring() {
            Err(problem) if self.vouching.keyring().is_some_and(|keyring| !self.now().has_reached(keyring.expires)) => {
                log::line(format_args!("{problem}; the agent goes on with the keyring that it has"));
                Ok(())
            }
            fetched => fetched,
        }
    }

    fn fetch_keyring(&mut self) -> Result<(), Problem> {
        let document = self.http.keyring()?;
        let known = self.state.state.keyring;
        self.vouching.renew(document.bytes, known, self.now(), &self.slots.file("keyring"))?;
        self.keyring_at = Some(Instant::now());
        if let Some(issued) = self.vouching.keyring().map(|keyring| keyring.issued) {
            self.learn_time(issued);
        }
        let version = self.vouching.keyring().map_or(0, |keyring| keyring.version);
        self.state.state.keyring = version.max(known);
        self.state.state.roots = pinned_text(&self.settings);
        self.state.note(Proof::Keyring);
        self.state.save()
    }

    fn standing(&self, kernel: String) -> Standing {
        let rejected = self.state.state.rejected.as_ref();
        let rejected = rejected.map(|rejected| (Some(rejected.version), rejected.message.clone()));
        let trouble = self.trouble.clone().map(|message| (None, message));
        let (tried_version, message) = trouble.or(rejected).unwrap_or_default();
        let own = || self.in_use.as_ref().map(|(_, manifest)| manifest);
        let (version, digest) = match self.shown.as_ref().map_or_else(own, Option::as_ref) {
            Some(manifest) => (Some(manifest.version), manifest.digest.clone()),
            None => (None, String::new()),
        };
        let loss = self.state.state.loss.as_ref().filter(|(of, _)| *of == digest).map(|(_, loss)| *loss);
        Standing { kernel, version, digest, generation: self.state.state.generation, tried_version, message, loss }
    }
}

impl Rounds for Agent {
    fn pace(&self) -> Pace {
        self.settings.pace
    }

    fn round(&mut self, wait: Duration) -> Result<Duration, Problem> {
        Ok(self.check(wait)?.poll_after)
    }

    fn report_due(&mut self) {
        self.report();
    }

    fn report_due_in(&self) -> Duration {
        self.reporter.due_in()
    }

    /// Time until the manifest that was accepted last has expired; without end, if there is none that counts. Then the agent
    /// asks in any case, however long a pause the server named.
    fn until_expiry(&self) -> Duration {
        let now = self.now().earliest();
        let left = self.state.state.confirmed.map(|confirmed| confirmed.expires.unix_s() - now.unix_s());
        let left_s = left.and_then(|left_s| u64::try_from(left_s).ok()).filter(|left_s| *left_s > 0);
        left_s.map_or(Duration::MAX, Duration::from_secs)
    }
}

/// The pinned root keys as the state keeps them.
fn pinned_text(settings: &Settings) -> String {
    let roots: Vec<String> = settings.roots.iter().map(ToString::to_string).collect();
    roots.join(",")
}

/// Whether two manifests name the same bytes.
fn have_same_bytes(one: &Manifest, other: &Manifest) -> bool {
    (&one.digest, one.size_bytes) == (&other.digest, other.size_bytes)
}

/// Whether two manifests name the same file of the same version.
pub(crate) fn is_same_file(one: &Manifest, other: &Manifest) -> bool {
    (one.version, &one.digest) == (other.version, &other.digest)
}
