//! Random schedules of publishers and collectors that share a remote. Each step is one request to the remote or one change
//! of the row. With the three rules of `remote_calls` no blob is lost; without any one of them some schedule loses it.

use super::Remote;
use crate::digest::digest_of;
use crate::inventory::{BlobKind, Inventory};
use crate::remote::RemoteObject;
use object_store::memory::InMemory;
use object_store::path::Path;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};
use std::fs::File;
use std::io::Write as _;
use std::sync::Arc;

const BYTES: &[u8] = b"blob";
const KIND: BlobKind = BlobKind::Artifact;
/// Schedules that are tried. Without a rule, the first loss is among the first ten.
const SCHEDULES: u64 = 3000;
const STEPS: usize = 120;

/// Which rules the processes keep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Broken {
    Nothing,
    /// Collectors remove objects that they listed after their mark.
    ListAfterMark,
    /// Publishers record without looking at marks, and clear them.
    IgnoreMarks,
    /// Publishers answer without a last look into the remote.
    NoLastLook,
}

/// The row of the blob in the store.
#[derive(Clone, Copy, Debug, Default)]
struct Row {
    mark: Option<u64>,
    uses: usize,
}

struct World {
    remote: Remote,
    local: File,
    digest: String,
    row: Option<Row>,
    /// The last mark that was given.
    marks: u64,
    broken: Broken,
}

#[derive(Clone, Debug)]
enum Publisher {
    Idle,
    Listed {
        empty: bool,
    },
    Stored,
    Marked {
        mark: u64,
    },
    StoredAnew {
        mark: u64,
    },
    Recorded,
    Looked {
        empty: bool,
    },
    /// The answer was given: from here on the blob must exist.
    Answered,
}

#[derive(Clone, Debug)]
enum Collector {
    Idle,
    Read { mark: Option<u64> },
    Listed { mark: Option<u64>, objects: Vec<RemoteObject> },
    Marked { mark: u64, objects: Vec<RemoteObject> },
    Removed { mark: u64 },
}

impl World {
    fn put(&mut self) {
        self.remote.put_anew(KIND, &self.digest, &mut self.local).unwrap();
    }

    fn objects(&self) -> Vec<RemoteObject> {
        self.remote.objects(KIND, &self.digest).unwrap()
    }

    /// Records a use; the mark that the row has and `seen` does not clear.
    fn record(&mut self, seen: Option<u64>) -> Option<u64> {
        let broken = self.broken == Broken::IgnoreMarks;
        let row = self.row.get_or_insert_default();
        match row.mark {
            Some(mark) if Some(mark) != seen && !broken => Some(mark),
            _ => {
                *row = Row { mark: None, uses: row.uses + 1 };
                None
            }
        }
    }

    fn publish(&mut self, publisher: Publisher) -> Publisher {
        match publisher {
            Publisher::Idle => Publisher::Listed { empty: self.objects().is_empty() },
            Publisher::Listed { empty } => {
                if empty {
                    self.put();
                }
                Publisher::Stored
            }
            Publisher::Stored => self.record(None).map_or(Publisher::Recorded, |mark| Publisher::Marked { mark }),
            Publisher::Marked { mark } => {
                self.put();
                Publisher::StoredAnew { mark }
            }
            Publisher::StoredAnew { mark } => {
                self.record(Some(mark)).map_or(Publisher::Recorded, |mark| Publisher::Marked { mark })
            }
            Publisher::Recorded if self.broken == Broken::NoLastLook => Publisher::Answered,
            Publisher::Recorded => Publisher::Looked { empty: self.objects().is_empty() },
            Publisher::Looked { empty } => {
                if empty {
                    self.put();
                }
                Publisher::Answered
            }
            // The record that used the blob is removed.
            Publisher::Answered => {
                self.row.as_mut().unwrap().uses -= 1;
                Publisher::Idle
            }
        }
    }

    fn collect(&mut self, collector: Collector) -> Collector {
        match collector {
            Collector::Idle => Collector::Read { mark: self.row.and_then(|row| row.mark) },
            Collector::Read { mark } => Collector::Listed { mark, objects: self.objects() },
            Collector::Listed { mark, objects } => {
                // A blob without a row is removed like one whose row nothing uses.
                let row = self.row.unwrap_or_default();
                if row.uses > 0 || row.mark != mark {
                    return Collector::Idle;
                }
                self.marks += 1;
                self.row = Some(Row { mark: Some(self.marks), ..row });
                Collector::Marked { mark: self.marks, objects }
            }
            Collector::Marked { mark, objects } => {
                let late = self.broken == Broken::ListAfterMark;
                let objects = if late { self.objects() } else { objects };
                self.remote.delete(KIND, &self.digest, &objects).unwrap();
                Collector::Removed { mark }
            }
            Collector::Removed { mark } => {
                if self.row.is_some_and(|row| row.mark == Some(mark)) {
                    self.row = None;
                }
                Collector::Idle
            }
        }
    }
}

/// The first schedule in which an answered publisher's blob is missing.
fn first_loss(broken: Broken) -> Option<u64> {
    let data = tempfile::tempdir().unwrap();
    let mut local = File::create_new(data.path().join("local")).unwrap();
    local.write_all(BYTES).unwrap();
    let local = File::open(data.path().join("local")).unwrap();
    Inventory::create(data.path()).unwrap();
    let remote = Remote::on(Arc::new(InMemory::new()), Path::from("model"), data.path()).unwrap();
    let mut world = World { remote, local, digest: digest_of(BYTES), row: None, marks: 0, broken };
    (0..SCHEDULES).find(|seed| {
        let all = world.objects();
        world.remote.delete(KIND, &world.digest, &all).unwrap();
        world.row = None;
        loses(&mut world, *seed)
    })
}

fn loses(world: &mut World, seed: u64) -> bool {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut publishers = vec![Publisher::Idle; 3];
    let mut collectors = vec![Collector::Idle; 2];
    for _ in 0..STEPS {
        match random.next_u32() as usize % 5 {
            n @ 0..3 => publishers[n] = world.publish(publishers[n].clone()),
            n => collectors[n - 3] = world.collect(collectors[n - 3].clone()),
        }
        let answered = publishers.iter().any(|publisher| matches!(publisher, Publisher::Answered));
        if answered && world.objects().is_empty() {
            return true;
        }
    }
    false
}

#[test]
fn no_schedule_loses_a_blob() {
    assert_eq!(first_loss(Broken::Nothing), None);
}

#[test]
fn each_rule_is_needed() {
    for broken in [Broken::ListAfterMark, Broken::IgnoreMarks, Broken::NoLastLook] {
        let loss = first_loss(broken);
        println!("{broken:?}: the first loss is in schedule {loss:?}");
        assert!(loss.is_some(), "{broken:?}");
    }
}
