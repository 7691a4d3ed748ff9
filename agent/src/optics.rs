//! Wavelength and place: of the settings, and in words.

use lightpath_manifest::Optics;
use lightpath_units::{Length, show_m};

/// Reads a wavelength such as `515nm`, and returns picometres.
pub(crate) fn wavelength_pm(text: &str) -> Result<i64, String> {
    whole(Length::Wavelength, text, 1e12, 1..=i64::MAX)
}

/// Reads a distance such as `150mm` or `-12.5mm`, and returns nanometres.
pub(crate) fn distance_nm(text: &str) -> Result<i64, String> {
    let nm = whole(Length::Distance, text, 1e9, i64::MIN..=i64::MAX)?;
    if nm == 0 { Err("must not be 0".to_owned()) } else { Ok(nm) }
}

fn whole(length: Length, text: &str, per_metre: f64, allowed: std::ops::RangeInclusive<i64>) -> Result<i64, String> {
    let metres = length.parse_m(text).map_err(|error| error.to_string())?;
    // Beyond its range the number would become another one without a word. The server checks the physical limits.
    let scaled = (metres * per_metre).round();
    if scaled.abs() > 9e15 {
        return Err("is too large".to_owned());
    }
    let number = scaled as i64;
    if allowed.contains(&number) { Ok(number) } else { Err(format!("must be above 0, but is {text}")) }
}

/// A wavelength as the name of a folder, such as `515nm` or `632.8nm`.
pub(crate) fn wavelength_name(wavelength_pm: i64) -> String {
    let (nm, pm) = (wavelength_pm / 1000, wavelength_pm % 1000);
    match format!("{pm:03}").trim_end_matches('0') {
        "" => format!("{nm}nm"),
        digits => format!("{nm}.{digits}nm"),
    }
}

/// Optics for people, such as `515 nm, 150 mm`. A place of a kind that this program does not know stays as it is.
pub(crate) fn in_words(optics: &Optics) -> String {
    // Picometres and nanometres are whole numbers far below the precision of f64.
    let wavelength = show_m(optics.wavelength_pm as f64 / 1e12);
    let place = optics.distance_nm().map_or_else(|| optics.place.clone(), |nm| show_m(nm as f64 / 1e9));
    format!("{wavelength}, {place}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_become_whole_numbers_and_others_are_refused() {
        assert_eq!((wavelength_pm("632.8nm"), distance_nm("-12.5mm")), (Ok(632_800), Ok(-12_500_000)));
        assert_eq!((wavelength_pm("515nm"), distance_nm("0.15m")), (Ok(515_000), Ok(150_000_000)));
        assert!(wavelength_pm("-515nm").unwrap_err().contains("above 0"));
        assert!(wavelength_pm("515").unwrap_err().contains("write 515nm"));
        assert!(distance_nm("0mm").unwrap_err().contains("not be 0"));
        assert_eq!(
            distance_nm("1e9").unwrap_err(),
            "distance 1e9 has no unit and would be 1000000000 m: write 1000000000mm"
        );
        assert_eq!(distance_nm("99999999999m"), Err("is too large".to_owned()));
    }

    #[test]
    fn names_of_wavelengths_are_unique() {
        for (pm, name) in [(515_000, "515nm"), (632_800, "632.8nm"), (515_001, "515.001nm"), (515_010, "515.01nm")] {
            assert_eq!(wavelength_name(pm), name);
        }
    }

    #[test]
    fn places_of_unknown_kinds_are_shown_as_they_are() {
        assert_eq!(in_words(&Optics::at_distance(515_000, -20_000_000)), "515 nm, -20 mm");
        let focus = Optics { wavelength_pm: 515_000, place: "focal_plane 1".to_owned() };
        assert_eq!(in_words(&focus), "515 nm, focal_plane 1");
    }
}
