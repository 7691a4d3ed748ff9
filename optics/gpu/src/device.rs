//! What computes the holograms of a process: a card or the processor.

use crate::backend::{CardOrProcessor, GpuBackend};
use crate::card::{Card, CardInfo, cards};
use crate::fault::Fault;
use crate::speed::evaluation_time;
use lightpath_optics::engine::EngineCache;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::fmt;
use std::path::Path;
use std::str::FromStr;
use std::sync::{Arc, Mutex, PoisonError};

/// Size of the test at the start \[px\]: rows, columns.
const TESTED_PX: (usize, usize) = (48, 80);

/// What shall compute.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum DeviceChoice {
    /// The first card where it is faster than the processor. Never a driver that computes on the processor itself.
    #[default]
    Auto,
    /// The processor.
    Cpu,
    /// The card with this number in the list of [`cards`], even if it is slower, or no card but a driver that computes on
    /// the processor.
    Gpu(usize),
}

impl FromStr for DeviceChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |number: &str| number.parse().ok().map(Self::Gpu);
        match text {
            "auto" => Some(Self::Auto),
            "cpu" => Some(Self::Cpu),
            "gpu" => Some(Self::Gpu(0)),
            text => text.strip_prefix("gpu:").and_then(number),
        }
        .ok_or_else(|| {
            format!("the device is {text:?}, but must be auto, cpu, gpu, or gpu: and a number, such as gpu:1")
        })
    }
}

impl TryFrom<String> for DeviceChoice {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl fmt::Display for DeviceChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => write!(f, "auto"),
            Self::Cpu => write!(f, "cpu"),
            Self::Gpu(number) => write!(f, "gpu:{number}"),
        }
    }
}

impl From<DeviceChoice> for String {
    fn from(choice: DeviceChoice) -> Self {
        choice.to_string()
    }
}

/// What computes: the processor, and maybe a card.
#[derive(Debug, Default)]
pub struct Device {
    choice: DeviceChoice,
    card: Option<Arc<Card>>,
    /// Whether the card is faster, by class of size: the number of pixels within a factor of two.
    faster: Mutex<HashMap<u32, bool>>,
}

impl Device {
    /// The processor alone.
    #[must_use]
    pub fn processor() -> Self {
        Self { choice: DeviceChoice::Cpu, ..Self::default() }
    }

    /// Opens what was chosen, and tests a card before it computes anything. With [`DeviceChoice::Auto`] a machine without a
    /// card has the processor, and no driver is loaded.
    ///
    /// # Errors
    ///
    /// [`Fault`] if the card that was named is not there, cannot be opened, or fails its test; with
    /// [`DeviceChoice::Auto`] if there is a card, but it fails.
    pub fn open(choice: DeviceChoice) -> Result<Self, Fault> {
        let number = match choice {
            DeviceChoice::Cpu => None,
            DeviceChoice::Gpu(number) => Some(number),
            DeviceChoice::Auto if may_have_card() => cards().iter().position(|card| !card.is_software),
            DeviceChoice::Auto => None,
        };
        let card: Option<Result<_, Fault>> = number.map(|number| {
            let card = Card::open(number)?;
            card.test()?;
            Ok(card)
        });
        Ok(Self { choice, card: card.transpose()?, faster: Mutex::default() })
    }

    /// The card, while it works; `None`: the processor computes everything.
    #[must_use]
    pub fn card(&self) -> Option<&CardInfo> {
        self.card.as_ref().filter(|card| card.fault().is_none()).map(|card| card.info())
    }

    /// The card for holograms of a size, with the processor for what it does not compute; `None`: the processor is the
    /// better choice. [`DeviceChoice::Auto`] measures both, once for each class of size.
    #[must_use]
    pub fn backend(&self, processor: &Arc<EngineCache>, height_px: usize, width_px: usize) -> Option<CardOrProcessor> {
        let backend = self.any_size(processor)?;
        if self.choice != DeviceChoice::Auto {
            return Some(backend);
        }
        let class = (height_px * width_px).max(1).ilog2();
        // The lock lasts as long as the measurement, so that two do not slow down each other.
        let mut faster = self.faster.lock().unwrap_or_else(PoisonError::into_inner);
        let is_faster = *faster.entry(class).or_insert_with(|| {
            let on_card = self.any_size(processor).map(|card| evaluation_time(&card.0, height_px, width_px));
            match (on_card, evaluation_time(&**processor, height_px, width_px)) {
                (Some(Ok(on_card)), Ok(on_processor)) => on_card < on_processor,
                _ => false,
            }
        });
        is_faster.then_some(backend)
    }

    /// The card, whatever is faster; `None`: there is none.
    #[must_use]
    pub fn any_size(&self, processor: &Arc<EngineCache>) -> Option<CardOrProcessor> {
        let card = self.card.as_ref().filter(|card| card.fault().is_none())?;
        Some(CardOrProcessor(GpuBackend::new(Arc::clone(card), Arc::clone(processor))))
    }
}

impl Card {
    /// Compares a small hologram with the processor's. The shaders of every other problem are compared when it is
    /// made.
    ///
    /// # Errors
    ///
    /// [`Fault`] if they differ, or the card fails.
    pub fn test(self: &Arc<Self>) -> Result<(), Fault> {
        let processor = Arc::new(EngineCache::new(1 << 20));
        let backend = GpuBackend::new(Arc::clone(self), processor);
        let (height_px, width_px) = TESTED_PX;
        let tested = evaluation_time(&backend, height_px, width_px);
        match (self.fault(), tested, backend.computed().processor_because) {
            (Some(fault), ..) => Err(fault),
            (None, Err(error), _) => Err(Fault::Refused(error.to_string())),
            (None, Ok(_), Some(because)) => Err(Fault::Wrong(because)),
            (None, Ok(_), None) => Ok(()),
        }
    }
}

/// Whether this machine may have a card: loading a driver takes time, and some write to the error output. On Linux each
/// card has a device file.
fn may_have_card() -> bool {
    let named = |folder: &str, begin: &str| {
        let entries = Path::new(folder).read_dir().into_iter().flatten().flatten();
        entries.map(|entry| entry.file_name()).any(|name| name.to_string_lossy().starts_with(begin))
    };
    !cfg!(target_os = "linux") || named("/dev/dri", "render") || named("/dev", "nvidia0") || named("/dev", "dxg")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_are_read_as_they_are_written() {
        for (text, choice) in
            [("auto", DeviceChoice::Auto), ("cpu", DeviceChoice::Cpu), ("gpu:3", DeviceChoice::Gpu(3))]
        {
            assert_eq!((text.parse(), choice.to_string()), (Ok(choice), text.to_owned()));
        }
        assert_eq!("gpu".parse(), Ok(DeviceChoice::Gpu(0)));
        for text in ["", "GPU", "gpu:", "gpu:-1", "cuda", "gpu0"] {
            assert!(text.parse::<DeviceChoice>().unwrap_err().contains("gpu:1"), "{text}");
        }
    }

    #[test]
    fn cards_that_are_not_there_are_named() {
        let fault = Device::open(DeviceChoice::Gpu(99)).unwrap_err();
        assert!(fault.to_string().contains("no graphics card number 99"), "{fault}");
        assert_eq!(Device::open(DeviceChoice::Cpu).unwrap().card(), None);
    }
}
