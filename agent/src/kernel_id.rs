//! Ids of kernels, such as `515nm-150mm`.

use std::fmt;
use std::str::FromStr;

/// The wavelength and the distance of a kernel, with the id that the server gives them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KernelId {
    text: String,
    /// Wavelength in vacuum \[pm\].
    pub wavelength_pm: i64,
    /// Distance from the SLM to the image plane \[nm\]; negative: behind the SLM.
    pub distance_nm: i64,
}

/// A text is not the id of a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "a kernel's id is its wavelength in nm and its distance in mm without superfluous zeros, such as 515nm-150mm, \
     632.8nm-12.5mm or 515nm--20mm"
)]
pub struct NoKernelId;

impl FromStr for KernelId {
    type Err = NoKernelId;

    fn from_str(text: &str) -> Result<Self, NoKernelId> {
        let (wavelength, distance) = text.split_once('-').ok_or(NoKernelId)?;
        let wavelength_pm = wavelength.strip_suffix("nm").and_then(|number| scaled(number, 3)).ok_or(NoKernelId)?;
        let distance = distance.strip_suffix("mm").ok_or(NoKernelId)?;
        let (sign, distance) = distance.strip_prefix('-').map_or((1, distance), |rest| (-1, rest));
        let distance_nm = sign * scaled(distance, 6).ok_or(NoKernelId)?;
        if wavelength_pm == 0 || distance_nm == 0 {
            return Err(NoKernelId);
        }
        Ok(Self { text: text.to_owned(), wavelength_pm, distance_nm })
    }
}

impl fmt::Display for KernelId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// A decimal number times a power of ten. Every number has one form alone, as every kernel has one id.
fn scaled(number: &str, digits: usize) -> Option<i64> {
    /// Digits before the point: enough for each length of the service, and few enough not to overflow.
    const WHOLE_DIGITS_MAX: usize = 9;
    let (whole, fraction) = match number.split_once('.') {
        Some((whole, fraction)) if !fraction.is_empty() && !fraction.ends_with('0') => (whole, fraction),
        Some(_) => return None,
        None => (number, ""),
    };
    let are_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let is_plain = (1..=WHOLE_DIGITS_MAX).contains(&whole.len()) && (whole == "0" || !whole.starts_with('0'));
    if !is_plain || fraction.len() > digits || !are_digits(whole) || !are_digits(fraction) {
        return None;
    }
    format!("{whole}{fraction:0<digits$}").parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_of_the_server_are_read_and_other_texts_are_not() {
        for (text, wavelength_pm, distance_nm) in [
            ("515nm-150mm", 515_000, 150_000_000),
            ("632.8nm--12.5mm", 632_800, -12_500_000),
            ("515nm-0.000001mm", 515_000, 1),
        ] {
            let id: KernelId = text.parse().unwrap();
            assert_eq!((id.wavelength_pm, id.distance_nm, &*id.to_string()), (wavelength_pm, distance_nm, text));
        }
        for text in [
            "",
            "515nm",
            "515nm-",
            "515-150",
            "515nm-150",
            "515.0nm-150mm",
            "0515nm-150mm",
            "515nm-0mm",
            "0nm-1mm",
            "515nm---1mm",
            "515nm-1.mm",
            "515nm-.5mm",
            "515.1234nm-1mm",
            "515nm-1e3mm",
            "+515nm-1mm",
            "515nm-1mm/..",
            "1234567890nm-1mm",
        ] {
            assert_eq!(text.parse::<KernelId>(), Err(NoKernelId), "{text}");
        }
    }
}
