//! Round numbers for axes and colour bars.

/// About `count` round numbers from `start` to `end`, with their labels.
pub(super) fn linear(start: f64, end: f64, count: usize) -> Vec<(f64, String)> {
    let (low, high) = (start.min(end), start.max(end));
    let rough = (high - low) / count.max(1) as f64;
    if rough <= 0.0 || !rough.is_finite() {
        return vec![(low, format!("{low:.3}"))];
    }
    let power = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|k| k * power).into_iter().find(|step| *step >= rough * 0.999);
    let step = step.unwrap_or(10.0 * power);
    let decimals = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
    let first = (low / step - 1e-6).ceil() as i64;
    let last = (high / step + 1e-6).floor() as i64;
    (first..=last).map(|i| i as f64 * step).map(|value| (value, signed(&format!("{value:.decimals$}")))).collect()
}

/// Multiples of π/2 from −π to π, with their labels.
pub(super) fn phase() -> Vec<(f64, String)> {
    let labels = ["−π", "−π/2", "0", "π/2", "π"];
    (-2..=2).zip(labels).map(|(i, label)| (f64::from(i) * std::f64::consts::FRAC_PI_2, label.to_owned())).collect()
}

/// Powers of ten from `low` to `high`, both above 0. If they are few, also 2 and 5 times the powers.
pub(super) fn logarithmic(low: f64, high: f64) -> Vec<(f64, String)> {
    let few = high / low < 300.0;
    let powers = low.log10().floor() as i32..=high.log10().ceil() as i32;
    let values = powers.flat_map(|power| {
        let factors: &[f64] = if few { &[1.0, 2.0, 5.0] } else { &[1.0] };
        factors.iter().map(move |factor| (*factor, power))
    });
    values
        .map(|(factor, power)| (factor * 10_f64.powi(power), power_of_ten(factor, power)))
        .filter(|(value, _)| (low * 0.999..=high * 1.001).contains(value))
        .collect()
}

fn power_of_ten(factor: f64, power: i32) -> String {
    let raised: String = power
        .to_string()
        .chars()
        .map(|digit| match digit {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            other => char::from_u32('⁰' as u32 + other as u32 - '0' as u32).unwrap_or(other),
        })
        .collect();
    if factor == 1.0 { format!("10{raised}") } else { format!("{factor}·10{raised}") }
}

/// The number with a typographic minus sign (−) in place of a hyphen.
fn signed(number: &str) -> String {
    number.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(ticks: Vec<(f64, String)>) -> Vec<String> {
        ticks.into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn ticks_are_round_numbers_inside_the_range() {
        assert_eq!(labels(linear(-62.5, 62.5, 5)), ["−50", "0", "50"]);
        assert_eq!(labels(linear(0.0, 1.0, 5)), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels(linear(1.0, 1.0, 5)), ["1.000"]);
        assert_eq!(labels(logarithmic(1e-4, 1e-1)), ["10⁻⁴", "10⁻³", "10⁻²", "10⁻¹"]);
        assert_eq!(labels(logarithmic(0.015, 0.06)), ["2·10⁻²", "5·10⁻²"]);
    }
}
