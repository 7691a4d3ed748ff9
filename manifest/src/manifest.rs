//! Which file holds the active version of a kernel.

use crate::lines::{Reader, Writer, is_hex, is_word};
use crate::{DocumentError, Optics, PublicKey, Signature, SigningKey, Time};

const HEAD: &str = "lightpath manifest";
const FORMAT_VERSION: u32 = 2;

/// What a manifest says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Manifest {
    /// Id of the display.
    pub display: String,
    /// For which light and which place.
    pub optics: Optics,
    /// Number of moves of `active` on the display's kernels so far, rollbacks too. All kernels of a display have the
    /// same generation at the same time.
    pub generation: u64,
    /// Number of the active version.
    pub version: u32,
    /// Format of the file, such as `compact`.
    pub format: String,
    /// SHA-256 of the file, `sha256-` and 64 hexadecimal digits.
    pub digest: String,
    /// Size of the file \[bytes\].
    pub size_bytes: u64,
    /// Columns of the display \[px\].
    pub width_px: u32,
    /// Rows of the display \[px\].
    pub height_px: u32,
    /// Pixel pitch \[pm\].
    pub pixel_pitch_pm: u64,
    /// Diffraction orders with which the kernel was learned: `first`, `filtered …` or `all …`.
    pub orders: String,
    /// Whether the kernel was interpolated between photographed distances.
    pub interpolated: bool,
    /// Time from which the manifest counts.
    pub issued: Time,
    /// Time from which the manifest counts no more.
    pub expires: Time,
}

impl Manifest {
    /// The bytes that a key signs.
    #[must_use]
    pub fn body(&self, key: &PublicKey) -> String {
        let writer = Writer::default().line(HEAD, FORMAT_VERSION).line("display", &self.display);
        self.optics
            .write_with_digest(writer)
            .line("generation", self.generation)
            .line("version", self.version)
            .line("format", &self.format)
            .line("digest", &self.digest)
            .line("size_bytes", self.size_bytes)
            .line("width_px", self.width_px)
            .line("height_px", self.height_px)
            .line("pixel_pitch_pm", self.pixel_pitch_pm)
            .line("orders", &self.orders)
            .line("interpolated", if self.interpolated { "yes" } else { "no" })
            .line("issued", self.issued)
            .line("expires", self.expires)
            .line("key", key.id())
            .finish()
    }

    /// The signed document.
    #[must_use]
    pub fn signed(&self, key: &SigningKey) -> String {
        let body = self.body(&key.public());
        let signature = key.sign(body.as_bytes());
        body + &Writer::default().line("signature", signature).finish()
    }
}

/// A manifest whose signature was not checked yet: [`Trust::manifest`](crate::Trust::manifest) checks it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SignedManifest {
    manifest: Manifest,
    key_id: String,
    body: String,
    signature: Signature,
}

impl SignedManifest {
    /// Reads a document.
    ///
    /// # Errors
    ///
    /// [`DocumentError`] with the first line that is wrong.
    pub fn parse(bytes: &[u8]) -> Result<Self, DocumentError> {
        let mut reader = Reader::new(bytes)?;
        reader.head(HEAD, FORMAT_VERSION)?;
        let manifest = Manifest {
            display: reader.value("display", "the id of a display", |text| is_word(text).then(|| text.to_owned()))?,
            optics: Optics::read(&mut reader)?,
            generation: reader.number("generation")?,
            version: reader.number("version")?,
            format: reader.value("format", "the name of a format", |text| is_word(text).then(|| text.to_owned()))?,
            digest: reader.value("digest", "sha256- and 64 hexadecimal digits", digest)?,
            size_bytes: reader.number("size_bytes")?,
            width_px: reader.number("width_px")?,
            height_px: reader.number("height_px")?,
            pixel_pitch_pm: reader.number("pixel_pitch_pm")?,
            orders: reader.text("orders")?.to_owned(),
            interpolated: match reader.text("interpolated")? {
                "yes" => true,
                "no" => false,
                _ => return Err(reader.wrong_value("interpolated", "yes or no")),
            },
            issued: reader.time("issued")?,
            expires: reader.time("expires")?,
        };
        let key_id = reader.value("key", "16 hexadecimal digits", |text| is_hex(text, 16).then(|| text.to_owned()))?;
        let body = reader.before().to_owned();
        let signature = reader.value("signature", "128 hexadecimal digits", Signature::parse)?;
        reader.end()?;
        Ok(Self { manifest, key_id, body, signature })
    }

    /// What the document says, whoever wrote it.
    #[must_use]
    pub fn unchecked(&self) -> &Manifest {
        &self.manifest
    }

    /// Id of the key that the document names.
    #[must_use]
    pub fn key_id(&self) -> &str {
        &self.key_id
    }

    /// What the document says, if the key signed it.
    pub(crate) fn verified_by(self, key: &PublicKey) -> Option<Manifest> {
        key.verifies(self.body.as_bytes(), &self.signature).then_some(self.manifest)
    }
}

fn digest(text: &str) -> Option<String> {
    let hex = text.strip_prefix("sha256-")?;
    is_hex(hex, 64).then(|| text.to_owned())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn manifest() -> Manifest {
        Manifest {
            display: "pluto".to_owned(),
            optics: Optics::at_distance(515_000, 150_000_000),
            generation: 7,
            version: 12,
            format: "compact".to_owned(),
            digest: format!("sha256-{}", "0f".repeat(32)),
            size_bytes: 812,
            width_px: 1920,
            height_px: 1080,
            pixel_pitch_pm: 8_000_000,
            orders: "first".to_owned(),
            interpolated: false,
            issued: Time::parse("2026-11-23T18:00:00Z").unwrap(),
            expires: Time::parse("2026-11-30T18:00:00Z").unwrap(),
        }
    }

    #[test]
    fn manifest_is_read_back_and_no_other_text_is_taken_for_one() {
        let key = SigningKey::from_seed([7; 32]);
        let text = manifest().signed(&key);
        let read = SignedManifest::parse(text.as_bytes()).unwrap();
        assert_eq!((read.unchecked(), read.key_id()), (&manifest(), &*key.public().id()));
        assert_eq!(read.verified_by(&key.public()), Some(manifest()));
        for (from, to, reason) in [
            (
                "lightpath manifest 2",
                "lightpath manifest 1",
                "the manifest has another version of the format than 2, the one that this program reads",
            ),
            ("lightpath manifest 2", "lightpath keyring 1", "line 1 must begin with \"lightpath manifest\""),
            ("generation 7", "generation 07", "line 6: generation must be a whole number without leading zeros"),
            ("generation 7", "generation -7", "line 6: generation must be a whole number without leading zeros"),
            (
                "optics c7",
                "optics c8",
                "line 5: place must be the place of which, with the wavelength, the line optics is the SHA-256",
            ),
            (
                "place distance_nm 150000000",
                "place distance_nm",
                "line 5: place must be a kind, a space and 1 to 128 characters",
            ),
            ("display pluto\n", "", "line 2 must begin with \"display\""),
            ("pluto", "pl uto", "line 2: display must be the id of a display"),
            ("format compact\n", "format compact\nformat compact\n", "line 9 must begin with \"digest\""),
            (
                "\nissued 2026-11-23T18",
                "\nissued 2026-11-23t18",
                "line 16: issued must be a time, such as 2026-11-23T18:30:00Z",
            ),
            ("sha256-0f", "sha256-0F", "line 9: digest must be sha256- and 64 hexadecimal digits"),
            ("compact", "compäct", "the document must be lines of printable ASCII, each with a line feed at its end"),
        ] {
            let changed = text.replacen(from, to, 1);
            assert_eq!(SignedManifest::parse(changed.as_bytes()).unwrap_err().to_string(), reason);
        }
        let longer = format!("{text}more 1\n");
        assert_eq!(
            SignedManifest::parse(longer.as_bytes()).unwrap_err().to_string(),
            "line 20: the document must end before it"
        );
        let huge = "x".repeat(5000);
        assert!(SignedManifest::parse(huge.as_bytes()).unwrap_err().to_string().contains("5000 bytes"));
    }

    proptest::proptest! {
        #[test]
        fn no_changed_byte_is_verified(at in 0_usize..900, byte: u8) {
            let key = SigningKey::from_seed([7; 32]);
            let mut bytes = manifest().signed(&key).into_bytes();
            let at = at % bytes.len();
            proptest::prop_assume!(bytes[at] != byte);
            bytes[at] = byte;
            let verified = SignedManifest::parse(&bytes).ok().and_then(|read| read.verified_by(&key.public()));
            proptest::prop_assert_eq!(verified, None);
        }

        #[test]
        fn no_bytes_make_the_reader_fail(bytes: Vec<u8>) {
            drop(SignedManifest::parse(&bytes));
        }
    }
}
