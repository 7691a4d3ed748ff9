//! 16-bit floats (IEEE 754 binary16): one sign, five exponent and ten fraction bits.

/// Rounds to the nearest 16-bit float, ties to even. Values that round beyond 65504 become infinite.
pub(super) fn from_f32(value: f32) -> u16 {
    let bits = value.to_bits();
    let sign = ((bits >> 16) & 0x8000) as u16;
    let magnitude = bits & 0x7fff_ffff;
    if magnitude > 0x7f80_0000 {
        return sign | 0x7e00;
    }
    // 65520 lies halfway between the largest 16-bit float, 65504, and its would-be successor.
    if magnitude >= 0x477f_f000 {
        return sign | 0x7c00;
    }
    if magnitude < 0x3880_0000 {
        // Below 2⁻¹⁴ steps are 2⁻²⁴; adding 0.5 in f32 rounds to exactly those steps.
        return sign | (f32::from_bits(magnitude) + 0.5).to_bits().wrapping_sub(0x3f00_0000) as u16;
    }
    let odd = (magnitude >> 13) & 1;
    sign | ((magnitude - 0x3800_0000 + 0x0fff + odd) >> 13) as u16
}

/// Converts a 16-bit float exactly.
pub(super) fn to_f32(bits: u16) -> f32 {
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f32::from(bits & 0x3ff));
    sign * match exponent {
        0 => fraction * 2.0_f32.powi(-24),
        31 if fraction == 0.0 => f32::INFINITY,
        31 => f32::NAN,
        exponent => (1.0 + fraction / 1024.0) * 2.0_f32.powi(exponent - 15),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_16_bit_float_is_converted_back_exactly() {
        for bits in 0..=u16::MAX {
            let value = to_f32(bits);
            if value.is_nan() {
                assert!(to_f32(from_f32(value)).is_nan());
            } else {
                assert_eq!(from_f32(value), bits, "{value}");
            }
        }
    }

    #[test]
    fn other_values_are_rounded_to_the_nearest() {
        for value in [0.1_f32, 1.0 / 3.0, 1.0005, 3e-6, 60000.0, -0.7, 6.2e-5] {
            let near = to_f32(from_f32(value));
            assert!((near - value).abs() <= value.abs() * 2.0_f32.powi(-11) + 2.0_f32.powi(-25), "{value} {near}");
        }
        assert_eq!(from_f32(65519.0), 0x7bff);
        assert_eq!(from_f32(1e6), 0x7c00);
        // Halfway values round to the even neighbour.
        assert_eq!((from_f32(1.0 + 1.0 / 2048.0), from_f32(1.0 + 3.0 / 2048.0)), (0x3c00, 0x3c02));
    }
}
