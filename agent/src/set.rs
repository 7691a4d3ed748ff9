//! Several kernels of a display, such as those of three colours, which change together.
//!
//! An [`Agent`] for each kernel fetches, checks and tests what the server offers, in a directory of its own. The set has
//! two slots, each with a folder for every kernel. When all agents have what the server offers, the kernels are copied
//! into the slot that is not in use, and one rename of a link lets the application use all of them.
//!
//! ```text
//! DIR/current ──> a          the slot in use; the application opens DIR/current/515nm/kernel and the others
//! DIR/a/515nm, DIR/b/515nm   a kernel of a slot: kernel, manifest, keyring
//! DIR/a/set, DIR/b/set       which versions the slot has; it is there only while all of them are
//! DIR/kernels/515nm          the directory of the agent that fetches this kernel
//! ```
//!
//! All kernels of a display have the same generation at the same time. A set is what the server offers in one
//! generation, after none of the display's kernels has moved for some time: an operator promotes one kernel after
//! another, and the states in between are not meant.

mod change;
mod list;

use crate::optics::wavelength_name;
use crate::problem::Problem;
use crate::rounds::Rounds;
use crate::slots::{Lock, Slot, Slots};
use crate::{Agent, Pace, Settings};
use lightpath_manifest::Manifest;
use std::thread;
use std::time::{Duration, Instant};

pub(crate) use list::{is_listed, listed};

/// Folder with the directories of the agents.
pub(crate) const KERNELS: &str = "kernels";

/// Limit on the kernels of a set, so that its list stays small.
const KERNELS_MAX: usize = 16;
/// Pause before the server is asked again, if the kernels moved between two questions.
const AGAIN: Duration = Duration::from_secs(1);

/// The result of one question to the server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SetChecked {
    /// Whether the set in use is what the server offers.
    pub is_offered: bool,
    /// Time after which to ask again.
    pub poll_after: Duration,
}

/// Keeps several kernels in a directory, and changes them together.
#[derive(Debug)]
pub struct KernelSet {
    slots: Slots,
    members: Vec<Member>,
    /// The slot in use, and what the manifests of its kernels say.
    in_use: Option<(Slot, Vec<Manifest>)>,
    settle: Duration,
    /// The generation of a set that is ready, and since when it is known.
    ready: Option<(u64, Instant)>,
    _lock: Lock,
}

#[derive(Debug)]
struct Member {
    name: String,
    settings: Settings,
    agent: Agent,
    /// Whether the agent gave up the version that the server offers.
    gave_up: bool,
    /// The places of the kernel in the slots of the set.
    slots: Slots,
}

impl KernelSet {
    /// Opens the directory of the settings, and lets the application use a set that is whole. The settings are the same for
    /// each kernel, except for its wavelength and id. A set is used after the generation has not risen for `settle`.
    ///
    /// # Errors
    ///
    /// Those of [`Agent::start`]; [`Problem::Setting`] if two kernels have the same wavelength, or there are more than 16.
    pub fn start(kernels: Vec<Settings>, settle: Duration) -> Result<Self, Problem> {
        let directory = match kernels.first() {
            Some(first) if kernels.len() <= KERNELS_MAX => first.directory.clone(),
            _ => return Err(Problem::Setting(format!("a set must have 1 to {KERNELS_MAX} kernels"))),
        };
        let (slots, lock) = Slots::open(&directory)?;
        let mut members: Vec<Member> = Vec::new();
        for settings in kernels {
            let name = wavelength_name(settings.optics.wavelength_pm);
            if members.iter().any(|member| member.name == name) {
                return Err(Problem::Setting(format!("the wavelength {name} is given twice")));
            }
            let directory = directory.join(KERNELS).join(&name);
            let agent = Agent::start(Settings { directory, ..settings.clone() })?;
            let slots = Slots::of_member(slots.root(), &name);
            members.push(Member { name, settings, agent, gave_up: false, slots });
        }
        let mut set = Self { slots, members, in_use: None, settle, ready: None, _lock: lock };
        set.recover();
        Ok(set)
    }

    /// Asks the server once for each kernel, and changes the set if it is ready:
    ///
    /// 1. The agent of each kernel checks, fetches and tests what the server offers. The first may wait for a change.
    /// 2. If one of them has a problem, or gave its version up, the set in use stays.
    /// 3. If the generation is the same for all, and has been for the time to settle, the kernels are copied into the slot
    ///    that is not in use, and the link is replaced.
    ///
    /// # Errors
    ///
    /// The first [`Problem`] of the agents, or one of the disk. The set in use stays as it was.
    pub fn check(&mut self, wait: Duration) -> Result<SetChecked, Problem> {
        if self.slots.current() != self.in_use.as_ref().map(|(slot, _)| *slot) {
            // A failed step, or another program, has moved the link.
            self.recover();
        }
        // While a set settles, a further move must be noticed and not waited for.
        let wait = if self.ready.is_some() { Duration::ZERO } else { wait };
        let asked = self.ask(wait);
        if asked.is_err() {
            self.ready = None;
        }
        let Asked { generation, poll_after } = asked?;
        let is_given_up = self.members.iter().any(|member| member.gave_up);
        let generation = generation.filter(|_| !is_given_up && self.differs());
        let Some(generation) = generation else {
            self.ready = None;
            return Ok(SetChecked { is_offered: !is_given_up && !self.differs(), poll_after });
        };
        let since = self.ready.filter(|(known, _)| *known == generation).map_or_else(Instant::now, |(_, since)| since);
        self.ready = Some((generation, since));
        let left = self.settle.saturating_sub(since.elapsed());
        if !left.is_zero() {
            return Ok(SetChecked { is_offered: false, poll_after: left });
        }
        self.ready = None;
        self.change(generation)?;
        Ok(SetChecked { is_offered: true, poll_after })
    }

    /// Checks until the set in use is what the server offers, or cannot be.
    ///
    /// # Errors
    ///
    /// Those of [`Self::check`].
    pub fn check_until_settled(&mut self) -> Result<SetChecked, Problem> {
        loop {
            let checked = self.check(Duration::ZERO)?;
            let is_moving = self.members.windows(2).any(|two| two[0].agent.generation() != two[1].agent.generation());
            if self.ready.is_none() && !is_moving {
                return Ok(checked);
            }
            thread::sleep(checked.poll_after);
        }
    }

    /// Sends the reports that are due. They say which kernels the set in use has.
    pub fn report(&mut self) {
        self.members.iter_mut().for_each(|member| member.agent.report());
    }

    /// Checks and reports for ever. A problem is logged, and the next try comes after a pause.
    pub fn run(&mut self) -> ! {
        self.go_on()
    }

    /// Whether the application has all kernels, and each has the bytes of an accepted manifest.
    #[must_use]
    pub fn has_whole_set(&self) -> bool {
        self.in_use.as_ref().is_some_and(|(slot, manifests)| {
            let are_whole = || {
                self.members
                    .iter()
                    .zip(manifests)
                    .all(|(member, manifest)| member.slots.check_kernel(*slot, manifest).is_ok())
            };
            self.slots.current() == Some(*slot) && are_whole()
        })
    }

    /// Asks for each kernel.
    fn ask(&mut self, wait: Duration) -> Result<Asked, Problem> {
        let (mut problem, mut poll_after) = (None, Duration::MAX);
        let mut wait = Some(wait);
        for member in &mut self.members {
            match member.agent.check(wait.take().unwrap_or_default()) {
                Ok(checked) => {
                    member.gave_up = !checked.is_offered;
                    poll_after = poll_after.min(checked.poll_after);
                }
                // The others go on, so that they are ready when this one is.
                Err(found) => problem = problem.or(Some(found)),
            }
        }
        if let Some(problem) = problem {
            return Err(problem);
        }
        let generations: Vec<u64> = self.members.iter().map(|member| member.agent.generation()).collect();
        match generations.as_slice() {
            [first, rest @ ..] if rest.iter().all(|other| other == first) => {
                Ok(Asked { generation: Some(*first), poll_after })
            }
            // A kernel moved between two questions: they are asked again soon.
            _ => Ok(Asked { generation: None, poll_after: poll_after.min(AGAIN) }),
        }
    }
}

impl Rounds for KernelSet {
    fn pace(&self) -> Pace {
        self.members.first().map_or_else(Pace::default, |member| member.settings.pace)
    }

    fn round(&mut self, wait: Duration) -> Result<Duration, Problem> {
        Ok(self.check(wait)?.poll_after)
    }

    fn report_due(&mut self) {
        self.report();
    }

    fn report_due_in(&self) -> Duration {
        self.members.iter().map(|member| member.agent.report_due_in()).min().unwrap_or(Duration::MAX)
    }

    fn until_expiry(&self) -> Duration {
        self.members.iter().map(|member| member.agent.until_expiry()).min().unwrap_or(Duration::MAX)
    }
}

/// What the server said about all kernels.
struct Asked {
    /// That of all kernels; `None`: a kernel moved between two questions.
    generation: Option<u64>,
    poll_after: Duration,
}
