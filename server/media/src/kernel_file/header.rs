//! The metadata of a kernel file.

use super::{FORMAT, FORMAT_VERSION, KernelFileError, Origin, require_small};
use crate::shortened::shortened;
use lightpath_optics::display::parts::stored::{Entry, Stored, StoredError};
use lightpath_optics::{ConvolutionMethod, DisplayModel, Grid, KernelModel, OpticalSetup, Orders};
use serde::de::{Deserializer as _, Error as _, IgnoredAny, MapAccess, Visitor};
use serde::{Deserialize, Serialize, Serializer};
use serde_json::Value;
use std::fmt;

/// The kernel's metadata. `Parts` are the entries of the parts.
#[derive(Serialize, Deserialize)]
pub(crate) struct Header<Parts = Text> {
    format: String,
    format_version: u32,
    pub(crate) model: KernelModel,
    height_px: usize,
    width_px: usize,
    pixel_pitch_m: f64,
    wavelength_m: f64,
    distance_m: f64,
    #[serde(flatten, skip_deserializing)]
    parts: Parts,
    propagation: ConvolutionMethod,
    #[serde(default, skip_serializing_if = "is_first")]
    orders: Orders,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    interpolated_from_m: Vec<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    display: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    record: Option<Value>,
}

/// The text of a header that was read. A part reads its entries from it, so that nothing of other entries is kept.
#[derive(Default)]
pub(crate) struct Text(String);

/// Reads the entry with a key, and passes over all others.
struct EntryOf(&'static str);

impl<'de> Visitor<'de> for EntryOf {
    type Value = Option<Entry>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Option<Entry>, A::Error> {
        let mut found = None;
        while let Some(key) = map.next_key::<String>()? {
            if key != self.0 {
                map.next_value::<IgnoredAny>()?;
                continue;
            }
            let named = |error| A::Error::custom(format_args!("`{}`: {error}", self.0));
            if found.replace(map.next_value::<Option<Entry>>().map_err(named)?).is_some() {
                return Err(A::Error::duplicate_field(self.0));
            }
        }
        Ok(found.flatten())
    }
}

/// The entries of the parts, in their order.
pub(super) struct Entries<'a>(&'a Stored);

impl Serialize for Entries<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.entries().map(|(key, value)| (key, value)))
    }
}

impl<'a> Header<Entries<'a>> {
    /// The metadata of a model.
    pub(super) fn of(model: &DisplayModel, kind: KernelModel, stored: &'a Stored, origin: &Origin) -> Self {
        let grid = model.setup.grid();
        Self {
            format: FORMAT.to_owned(),
            format_version: FORMAT_VERSION,
            model: kind,
            height_px: grid.height_px(),
            width_px: grid.width_px(),
            pixel_pitch_m: grid.pixel_pitch_m(),
            wavelength_m: model.setup.wavelength_m(),
            distance_m: model.setup.distance_m(),
            parts: Entries(stored),
            propagation: model.setup.method(),
            orders: model.setup.orders(),
            interpolated_from_m: origin.interpolated_from_m.clone(),
            display: origin.display.clone(),
            record: origin.record.clone(),
        }
    }
}

impl Header {
    /// Reads the metadata. Refuses a large one, one with a key that stands twice, another format and a later version.
    pub(crate) fn parse(text: &str) -> Result<Self, KernelFileError> {
        require_small(text)?;
        let header = Self { parts: Text(text.to_owned()), ..serde_json::from_str(text)? };
        if header.format != FORMAT || header.format_version != FORMAT_VERSION {
            return Err(KernelFileError::Format { format: shortened(header.format), version: header.format_version });
        }
        Ok(header)
    }

    /// The entry of a part; `None` if there is none, or `null`.
    pub(crate) fn entry(&self, key: &'static str) -> Result<Option<Entry>, StoredError> {
        let mut json = serde_json::Deserializer::from_str(&self.parts.0);
        json.deserialize_map(EntryOf(key)).map_err(|error| StoredError::Form(Box::new(KernelFileError::Header(error))))
    }

    pub(crate) fn into_origin(self) -> Origin {
        Origin { display: self.display, interpolated_from_m: self.interpolated_from_m, record: self.record }
    }

    pub(super) fn setup(&self) -> Result<OpticalSetup, KernelFileError> {
        let grid = Grid::try_new(self.height_px, self.width_px, self.pixel_pitch_m)?;
        let setup = OpticalSetup::try_new(grid, self.wavelength_m, self.distance_m)?;
        Ok(setup.with_method_regardless(self.propagation).with_orders(self.orders)?)
    }
}

fn is_first(orders: &Orders) -> bool {
    *orders == Orders::First
}
