//! The metadata of a kernel file.

use super::{FORMAT, FORMAT_VERSION, KernelFileError, Origin};
use lightpath_optics::{ConvolutionMethod, Grid, KernelModel, OpticalSetup, Orders};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The kernel's metadata.
#[derive(Serialize, Deserialize)]
pub(crate) struct Header {
    pub(super) format: String,
    pub(super) format_version: u32,
    pub(crate) model: KernelModel,
    pub(super) height_px: usize,
    pub(super) width_px: usize,
    pub(super) pixel_pitch_m: f64,
    pub(super) wavelength_m: f64,
    pub(super) distance_m: f64,
    pub(super) kernel_order: usize,
    pub(super) source_order: usize,
    #[serde(default, skip_serializing_if = "is_zero")]
    pub(super) beyond_order: usize,
    #[serde(default, skip_serializing_if = "is_zero")]
    pub(super) variation_order: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) response_variation_order: Option<usize>,
    #[serde(default, skip_serializing_if = "is_false")]
    pub(super) has_crosstalk: bool,
    #[serde(default, skip_serializing_if = "is_false")]
    pub(super) has_light_blur: bool,
    #[serde(default, skip_serializing_if = "is_false")]
    pub(super) has_ghost: bool,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) mode_orders: Vec<usize>,
    #[serde(default, skip_serializing_if = "is_false")]
    pub(super) has_dust: bool,
    pub(super) propagation: ConvolutionMethod,
    #[serde(default, skip_serializing_if = "is_first")]
    pub(super) orders: Orders,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) interpolated_from_m: Vec<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) display: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) record: Option<Value>,
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

fn is_false(value: &bool) -> bool {
    !value
}

fn is_zero(order: &usize) -> bool {
    *order == 0
}
