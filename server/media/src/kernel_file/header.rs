//! The metadata of a kernel file.

use super::{FORMAT, FORMAT_VERSION, KernelFileError, Origin};
use lightpath_optics::display::parts::stored::{Entry, Stored, StoredError};
use lightpath_optics::{ConvolutionMethod, DisplayModel, Grid, KernelModel, OpticalSetup, Orders};
use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Map, Value};
use std::fmt;

/// The kernel's metadata. `Parts` are the entries of the parts: all other entries of a header that was read.
#[derive(Serialize, Deserialize)]
pub(crate) struct Header<Parts = OtherEntries> {
    format: String,
    format_version: u32,
    pub(crate) model: KernelModel,
    height_px: usize,
    width_px: usize,
    pixel_pitch_m: f64,
    wavelength_m: f64,
    distance_m: f64,
    #[serde(flatten)]
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

/// The entries of a header that was read, beside those of [`Header`].
pub(crate) struct OtherEntries(Map<String, Value>);

/// Refuses a key that stands twice, as the keys of [`Header`] may not either.
impl<'de> Deserialize<'de> for OtherEntries {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct EachOnce;

        impl<'de> Visitor<'de> for EachOnce {
            type Value = OtherEntries;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a JSON object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<OtherEntries, A::Error> {
                let mut entries = Map::new();
                while let Some((key, value)) = map.next_entry::<String, Value>()? {
                    if entries.contains_key(&key) {
                        return Err(A::Error::custom(format_args!("duplicate field `{key}`")));
                    }
                    entries.insert(key, value);
                }
                Ok(OtherEntries(entries))
            }
        }

        deserializer.deserialize_map(EachOnce)
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
    /// Reads the metadata, and refuses another format or a later version.
    pub(crate) fn parse(text: &str) -> Result<Self, KernelFileError> {
        let header: Self = serde_json::from_str(text)?;
        if header.format != FORMAT || header.format_version != FORMAT_VERSION {
            return Err(KernelFileError::Format { format: header.format, version: header.format_version });
        }
        Ok(header)
    }

    /// The entry of a part; `None` if there is none, or `null`.
    pub(crate) fn entry(&self, key: &'static str) -> Result<Option<Entry>, StoredError> {
        let entry = self.parts.0.get(key).map(Option::<Entry>::deserialize).transpose();
        let refused = |_| StoredError::Entry { key, expected: "true or false, a whole number, or whole numbers" };
        Ok(entry.map_err(refused)?.flatten())
    }

    pub(crate) fn origin(&self) -> Origin {
        Origin {
            display: self.display.clone(),
            interpolated_from_m: self.interpolated_from_m.clone(),
            record: self.record.clone(),
        }
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
