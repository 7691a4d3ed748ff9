//! The pairs of a dataset, read when they are needed.

use super::display_setup::DisplaySetup;
use super::stop::{StopFlag, StopReason};
use super::{JobContext, TaskError};
use lightpath_artifacts::Artifacts;
use lightpath_domain::dataset::{self, Dataset, Split};
use lightpath_domain::job::estimate::{OTHER_PAIRS_BYTES_MAX, TRAINING_PAIRS_BYTES_MAX};
use lightpath_media::captures::Captures;
use lightpath_optics::learning::{BoxError, Pair, PairSource};
use std::sync::{Arc, OnceLock};
use tokio::runtime::Handle;

/// The pairs of one split.
pub(super) struct Pairs {
    captures: Captures,
    pairs: Vec<dataset::Pair>,
    /// Names of the pairs for messages, in the same order.
    names: Vec<String>,
    /// Decoded pairs: the first ones, as many as fit into the memory limit.
    kept: Vec<OnceLock<Pair>>,
    artifacts: Artifacts,
    runtime: Handle,
    stop: Arc<StopFlag>,
}

impl Pairs {
    /// The pairs of a dataset that are used for `split`, in the order of their ids.
    pub(super) fn of(
        context: &JobContext,
        display: &DisplaySetup,
        dataset: &Dataset,
        split: Split,
    ) -> Result<Self, TaskError> {
        Self::sharing(1, context, display, dataset, split)
    }

    /// The pairs of one of `datasets` datasets, which share the memory for decoded pairs. With several datasets, names
    /// of pairs contain the id of the dataset.
    fn sharing(
        datasets: usize,
        context: &JobContext,
        display: &DisplaySetup,
        dataset: &Dataset,
        split: Split,
    ) -> Result<Self, TaskError> {
        let pairs: Vec<_> = dataset.pairs.iter().filter(|pair| pair.split == Some(split)).cloned().collect();
        let pair_bytes = 2 * size_of::<f32>() * display.setup.grid().pixels();
        let bytes_max = if split == Split::Train { TRAINING_PAIRS_BYTES_MAX } else { OTHER_PAIRS_BYTES_MAX };
        let room = (bytes_max / datasets / pair_bytes).min(pairs.len());
        let name = |pair: &dataset::Pair| match datasets {
            1 => pair.id.clone(),
            _ => format!("{}/{}", dataset.id, pair.id),
        };
        Ok(Self {
            captures: Captures::of(&display.declared, dataset)?,
            names: pairs.iter().map(name).collect(),
            pairs,
            kept: (0..room).map(|_| OnceLock::new()).collect(),
            artifacts: context.artifacts.clone(),
            runtime: context.runtime.clone(),
            stop: Arc::clone(&context.stop),
        })
    }

    /// Id of a pair.
    pub(super) fn id(&self, index: usize) -> &str {
        &self.pairs[index].id
    }

    /// Name of a pair for messages: its id. With several datasets, the dataset's id comes before it.
    pub(super) fn name(&self, index: usize) -> &str {
        &self.names[index]
    }

    fn read(&self, index: usize) -> Result<Pair, TaskError> {
        let pair = &self.pairs[index];
        let read = || -> Result<Pair, TaskError> {
            let phase = self.captures.phase(&self.bytes(&pair.pattern)?)?;
            let photo = self.captures.photo(pair, &self.bytes(&pair.photo)?)?;
            Ok(Pair { phase, photo })
        };
        read().map_err(|error| self.named(index, error))
    }

    /// Adds the name of a pair to the error that it caused.
    pub(super) fn named(&self, index: usize, error: TaskError) -> TaskError {
        match error {
            TaskError::Failed(mut error) => {
                error.message = format!("pair \"{}\": {}", self.name(index), error.message);
                TaskError::Failed(error)
            }
            TaskError::Stopped => TaskError::Stopped,
        }
    }

    fn bytes(&self, digest: &str) -> Result<Vec<u8>, TaskError> {
        let read = self.stop.unless_interrupted(self.artifacts.read_all(digest));
        Ok(self.runtime.block_on(read).ok_or(TaskError::Stopped)??)
    }
}

impl PairSource for Pairs {
    fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Returns a pair, or an error if the attempt must stop and its work would not count: a line search uses all pairs
    /// several times. A drain waits for the end of the step, when the state is complete.
    fn pair(&self, index: usize) -> Result<Pair, BoxError> {
        if self.stop.reason() > Some(StopReason::Drain) {
            return Err(TaskError::Stopped.into());
        }
        let Some(kept) = self.kept.get(index) else { return Ok(self.read(index)?) };
        if let Some(pair) = kept.get() {
            return Ok(pair.clone());
        }
        let pair = self.read(index)?;
        Ok(kept.get_or_init(|| pair).clone())
    }
}

/// Pairs of one split of several datasets of a display, dataset after dataset. Each dataset has another distance.
pub(super) struct JointPairs(Vec<Pairs>);

impl JointPairs {
    pub(super) fn of(
        context: &JobContext,
        planes: &[(DisplaySetup, Dataset)],
        split: Split,
    ) -> Result<Self, TaskError> {
        let pairs_of = |(display, dataset): &(DisplaySetup, Dataset)| {
            Pairs::sharing(planes.len(), context, display, dataset, split)
        };
        Ok(Self(planes.iter().map(pairs_of).collect::<Result<_, _>>()?))
    }

    /// The pairs of each dataset.
    pub(super) fn parts(&self) -> &[Pairs] {
        &self.0
    }

    /// Index of the dataset of a pair, and index of the pair within it.
    pub(super) fn locate(&self, mut index: usize) -> (usize, usize) {
        let mut plane = 0;
        while index >= self.0[plane].len() {
            index -= self.0[plane].len();
            plane += 1;
        }
        (plane, index)
    }
}

impl PairSource for JointPairs {
    fn len(&self) -> usize {
        self.0.iter().map(Pairs::len).sum()
    }

    fn plane(&self, index: usize) -> usize {
        self.locate(index).0
    }

    fn pair(&self, index: usize) -> Result<Pair, BoxError> {
        let (plane, index) = self.locate(index);
        self.0[plane].pair(index)
    }
}
