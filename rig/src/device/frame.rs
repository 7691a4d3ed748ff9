//! Frames of a camera, and the place of their bits.

use super::{CameraFacts, DeviceError, Result};
use serde::Deserialize;
use std::time::Instant;

/// Where the bits of a value are in its 16 bits. Drivers put 12 bits into the upper or the lower part of 16, and a
/// photograph read the wrong way is 16 times too dark or not a photograph at all.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Justified {
    /// In the lower bits: white of 12 bits is 4095.
    Right,
    /// In the upper bits: white of 12 bits is 65520.
    Left,
}

/// A frame as the camera gives it.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Number of the frame, as the camera counts. `None`: it does not count.
    pub number: Option<u64>,
    /// Begin of the exposure. `None`: not known.
    pub begun: Option<Instant>,
    /// Exposure that the camera says the frame had \[s\]. `None`: it does not say.
    pub exposure_s: Option<f64>,
    /// Values, row by row, justified as [`CameraFacts`] says.
    pub values: Vec<u16>,
}

impl Frame {
    /// The frame with its values in the lower bits.
    ///
    /// # Errors
    ///
    /// The frame has another size than the camera, or values that contradict how its bits are said to be justified.
    pub fn turned_right(mut self, camera: &CameraFacts) -> Result<Self> {
        let (bits, white) = (camera.bit_depth, camera.white());
        let pixels = camera.width_px as usize * camera.height_px as usize;
        if self.values.len() != pixels {
            let (found, width_px, height_px) = (self.values.len(), camera.width_px, camera.height_px);
            return Err(DeviceError(format!("a frame has {found} values, but the camera {width_px}×{height_px} px")));
        }
        match camera.justified {
            Justified::Right => {
                if let Some(high) = self.values.iter().find(|&&value| value > white) {
                    return Err(DeviceError(format!(
                        "the camera gave the value {high}, but {bits} bits hold at most {white}: set camera.bit_depth, \
                         or camera.justified = \"left\" if the bits are in the upper part of 16"
                    )));
                }
            }
            Justified::Left => {
                let shift = 16 - bits.clamp(1, 16);
                let below = u16::MAX.checked_shr(bits).unwrap_or(0);
                if let Some(low) = self.values.iter().find(|&&value| value & below != 0) {
                    return Err(DeviceError(format!(
                        "the camera gave the value {low}, which {bits} bits in the upper part of 16 cannot be: set \
                         camera.bit_depth, or camera.justified = \"right\""
                    )));
                }
                self.values.iter_mut().for_each(|value| *value >>= shift);
            }
        }
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn turned(justified: Justified, bit_depth: u32, values: [u16; 2]) -> Result<Vec<u16>> {
        let camera = CameraFacts {
            width_px: 2,
            height_px: 1,
            bit_depth,
            justified,
            exposure_min_s: 0.0,
            exposure_max_s: 1.0,
            exposure_delay_frames: 0,
            held_frames: 0,
            limit: Duration::ZERO,
        };
        let frame = Frame { number: None, begun: None, exposure_s: None, values: values.to_vec() };
        frame.turned_right(&camera).map(|frame| frame.values)
    }

    #[test]
    fn bits_come_to_the_right_and_contradictions_are_named() {
        assert_eq!(turned(Justified::Right, 12, [0, 4095]), Ok(vec![0, 4095]));
        assert_eq!(turned(Justified::Left, 12, [16, 65520]), Ok(vec![1, 4095]));
        assert_eq!(turned(Justified::Left, 16, [1, 65535]), Ok(vec![1, 65535]));
        assert!(turned(Justified::Right, 12, [0, 65520]).unwrap_err().0.contains("camera.justified = \"left\""));
        assert!(turned(Justified::Left, 12, [0, 4095]).unwrap_err().0.contains("camera.justified = \"right\""));
    }
}
