//! Colour maps with even steps. They are composed in OKLab (Ottosson 2020), in which equal distances look equal.

use std::f32::consts::{PI, TAU};

/// A map from numbers to colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColourMap {
    /// From dark violet through blue-green to bright yellow. The lightness grows evenly.
    Sequential,
    /// From blue through near white to red, for the size and the sign of a value.
    Diverging,
    /// Once around the hues, for phases: both ends have the same colour.
    Cyclic,
}

impl ColourMap {
    /// The colour (sRGB) at `t`, from 0 to 1. Values outside take the colour of the nearest end; NaN, where there is no
    /// value, is grey.
    #[must_use]
    pub fn colour(self, t: f32) -> [u8; 3] {
        if t.is_nan() {
            return [0x80; 3];
        }
        let t = t.clamp(0.0, 1.0);
        let (lightness, chroma, hue) = match self {
            Self::Sequential => {
                let hue = 5.25 - 3.45 * t.powf(0.9);
                (0.24 + 0.68 * t, 0.1 + 0.015 * (PI * t).sin() + 0.06 * t * t, hue)
            }
            Self::Diverging => {
                let side = 2.0 * t - 1.0;
                let hue = if side < 0.0 { 4.45 } else { 0.55 };
                (0.95 - 0.5 * side.abs(), 0.16 * side.abs().powf(0.8), hue)
            }
            // The darkest and the brightest colour are at opposite phases, so that grey prints show the direction too.
            Self::Cyclic => (0.62 - 0.13 * (TAU * t).cos(), 0.095, TAU * (t + 0.72)),
        };
        srgb(lightness, chroma * hue.cos(), chroma * hue.sin())
    }
}

fn srgb(lightness: f32, a: f32, b: f32) -> [u8; 3] {
    let long = (lightness + 0.396_337_78 * a + 0.215_803_76 * b).powi(3);
    let medium = (lightness - 0.105_561_346 * a - 0.063_854_17 * b).powi(3);
    let short = (lightness - 0.089_484_18 * a - 1.291_485_5 * b).powi(3);
    [
        4.076_741_7 * long - 3.307_711_6 * medium + 0.230_969_94 * short,
        -1.268_438 * long + 2.609_757_4 * medium - 0.341_319_38 * short,
        -0.004_196_086_3 * long - 0.703_418_6 * medium + 1.707_614_7 * short,
    ]
    .map(|light| (crate::pictures::linear_to_srgb(light.clamp(0.0, 1.0)) * 255.0).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn luma(colour: [u8; 3]) -> f32 {
        let [r, g, b] = colour.map(f32::from);
        0.3 * r + 0.59 * g + 0.11 * b
    }

    #[test]
    fn sequential_lightness_grows_cyclic_ends_match_and_missing_values_are_grey() {
        for i in 0..40 {
            let (a, b) = (i as f32 / 40.0, (i + 1) as f32 / 40.0);
            assert!(luma(ColourMap::Sequential.colour(b)) > luma(ColourMap::Sequential.colour(a)), "{a}");
        }
        let (start, end) = (ColourMap::Cyclic.colour(0.0), ColourMap::Cyclic.colour(1.0));
        assert!(start.iter().zip(end).all(|(&a, b)| a.abs_diff(b) <= 1));
        assert_eq!(ColourMap::Sequential.colour(f32::NAN), [0x80; 3], "no value");
    }
}
