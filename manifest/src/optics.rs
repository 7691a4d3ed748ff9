//! For which light and which place a kernel is: two readable lines, and their digest.
//!
//! ```text
//! optics c7b8…                     SHA-256 over the bytes of the next two lines, their line feeds included
//! wavelength_pm 515000
//! place distance_nm 150000000
//! ```
//!
//! A device compares the digest with the one that it wants. It reads no place, so that it also refuses or accepts places
//! of kinds that came after it.

use crate::DocumentError;
use crate::lines::{Reader, Writer, is_hex, is_word};
use sha2::{Digest as _, Sha256};
use std::fmt::{self, Write as _};

/// Limit on the length of a place after its kind \[bytes\].
const PLACE_TEXT_MAX: usize = 128;
/// Kind of the places that are a distance from the SLM, in nanometres.
const DISTANCE: &str = "distance_nm";

/// Wavelength and place of a kernel. Two of them are the same if their lines have the same bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Optics {
    /// Wavelength in vacuum \[pm\].
    pub wavelength_pm: i64,
    /// Where light is looked at: the kind of the place, a space, and what the kind needs, such as `distance_nm 150000000`.
    pub place: String,
}

impl Optics {
    /// The optics of a distance from the SLM: wavelength in vacuum \[pm\], distance \[nm\]; negative: behind the SLM.
    #[must_use]
    pub fn at_distance(wavelength_pm: i64, distance_nm: i64) -> Self {
        Self { wavelength_pm, place: format!("{DISTANCE} {distance_nm}") }
    }

    /// SHA-256 over the two lines, as 64 hexadecimal digits.
    #[must_use]
    pub fn digest(&self) -> String {
        let lines = self.write(Writer::default()).finish();
        Sha256::digest(lines).iter().fold(String::new(), |mut hex, byte| {
            // Writing to a string cannot fail.
            let _ = write!(hex, "{byte:02x}");
            hex
        })
    }

    /// Distance from the SLM \[nm\]; `None` for places of other kinds.
    #[must_use]
    pub fn distance_nm(&self) -> Option<i64> {
        let (kind, text) = self.place.split_once(' ')?;
        if kind == DISTANCE { text.parse().ok() } else { None }
    }

    /// Writes the readable lines.
    fn write(&self, writer: Writer) -> Writer {
        writer.line("wavelength_pm", self.wavelength_pm).line("place", &self.place)
    }

    /// Writes the digest and the readable lines.
    pub(crate) fn write_with_digest(&self, writer: Writer) -> Writer {
        self.write(writer.line("optics", self.digest()))
    }

    /// Reads the digest and the readable lines, which must belong together.
    pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, DocumentError> {
        const PLACE: &str = "a kind, a space and 1 to 128 characters";
        const BOTH: &str = "the place of which, with the wavelength, the line optics is the SHA-256";
        let hex = reader.text("optics")?;
        if !is_hex(hex, 64) {
            return Err(reader.wrong_value("optics", "64 hexadecimal digits"));
        }
        let wavelength_pm = reader.number("wavelength_pm")?;
        let place = reader.value("place", PLACE, |text| is_place(text).then(|| text.to_owned()))?;
        let optics = Self { wavelength_pm, place };
        if optics.digest() == hex { Ok(optics) } else { Err(reader.wrong_value("place", BOTH)) }
    }
}

/// Displays both lines in one: `wavelength_pm 515000, place distance_nm 150000000`.
impl fmt::Display for Optics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "wavelength_pm {}, place {}", self.wavelength_pm, self.place)
    }
}

/// Whether a text has the form of a place. The characters of a document were checked before.
fn is_place(text: &str) -> bool {
    text.split_once(' ').is_some_and(|(kind, rest)| is_word(kind) && (1..=PLACE_TEXT_MAX).contains(&rest.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digest_is_that_of_the_two_lines() {
        let optics = Optics::at_distance(515_000, 150_000_000);
        // printf 'wavelength_pm 515000\nplace distance_nm 150000000\n' | sha256sum
        assert_eq!(optics.digest(), "c7b87820e82fabe9e499498f75af3807e24511bd5fe02b7d34540b7628a86fc9");
        assert_eq!(optics.to_string(), "wavelength_pm 515000, place distance_nm 150000000");
        assert_eq!(optics.distance_nm(), Some(150_000_000));
        let focus = Optics { place: "focal_plane 1".to_owned(), ..optics };
        assert_eq!(focus.distance_nm(), None);
    }
}
