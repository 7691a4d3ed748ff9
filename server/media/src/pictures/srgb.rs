//! The sRGB transfer function (IEC 61966-2-1).
//!
//! ```text
//! linear = v / 12.92                      v ≤ 0.04045
//!          ((v + 0.055) / 1.055)^2.4      otherwise
//! ```

/// Linear light of an sRGB value, both 0 to 1.
#[must_use]
pub fn srgb_to_linear(value: f32) -> f32 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// sRGB value of linear light, both 0 to 1.
#[must_use]
pub fn linear_to_srgb(light: f32) -> f32 {
    if light <= 0.003_130_8 { light * 12.92 } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conversions_are_inverse_and_keep_0_and_1() {
        for value in (0..=255).map(|v| v as f32 / 255.0) {
            assert!((linear_to_srgb(srgb_to_linear(value)) - value).abs() < 1e-6, "{value}");
        }
        assert_eq!(srgb_to_linear(0.0), 0.0);
        assert_eq!(srgb_to_linear(1.0), 1.0);
        // Linear light of middle grey.
        assert!((srgb_to_linear(0.5) - 0.214_041).abs() < 1e-5);
    }
}
