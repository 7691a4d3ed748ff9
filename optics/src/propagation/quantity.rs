//! Numbers with units, written for messages.

/// A length with three digits and a fitting unit: `150 mm`, `8 µm`, `1.2 m`.
pub(super) fn length(value_m: f64) -> String {
    let size_m = value_m.abs();
    let (unit, unit_m) = match size_m {
        s if s >= 1.0 => ("m", 1.0),
        s if s >= 1e-3 => ("mm", 1e-3),
        s if s >= 1e-6 => ("µm", 1e-6),
        _ => ("nm", 1e-9),
    };
    format!("{} {unit}", digits(value_m / unit_m))
}

/// A fraction in percent, for example `53.7 %`.
pub(super) fn percent(fraction: f64) -> String {
    format!("{} %", digits(100.0 * fraction))
}

/// A number with three significant digits, or with all digits before the decimal point if they are more.
pub(super) fn digits(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let before_point = value.abs().log10().floor() as i32 + 1;
    if before_point < -3 {
        return format!("{value:.1e}");
    }
    let text = format!("{value:.*}", (3 - before_point).max(0) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_three_digits_and_unit() {
        for (value_m, text) in [
            (0.15, "150 mm"),
            (0.268_43, "268 mm"),
            (-8e-6, "-8 µm"),
            (1.25, "1.25 m"),
            (515e-9, "515 nm"),
            (1_200.0, "1200 m"),
            (0.0, "0 nm"),
        ] {
            assert_eq!(length(value_m), text);
        }
        assert_eq!(percent(0.537_4), "53.7 %");
        assert_eq!([0.01234, 1e-7, 99.96].map(digits), ["0.0123", "1.0e-7", "100"]);
    }
}
