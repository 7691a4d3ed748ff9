//! Questions about documents, and what `Trust` answers.

use crate::documents::{digest, pinned_roots};
use lightpath_manifest::{
    Distrust, DocumentError, Keyring, Manifest, Now, PublicKey, Signature, SignedKeyring, Time, Trust, Wanted,
};
use sha2::{Digest as _, Sha256};
use std::fmt;

/// The last time that a document can have.
const TIME_MAX: i64 = 253_402_300_799;

/// The keyring of a device.
#[derive(Clone, Debug)]
pub(crate) struct Known {
    /// Name of its file; `pinned`: none, only the root keys.
    pub(crate) name: String,
    /// Its document; nothing for the root keys.
    pub(crate) document: Vec<u8>,
}

/// What a device knows of the present time, in seconds since 1970.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Clock {
    At(i64),
    AtLeast(i64),
    None,
}

/// What is asked.
#[derive(Clone, Debug)]
pub(crate) enum Question {
    Keyring { known: Known, now: Clock },
    Manifest { known: Known, now: Clock, wanted: Wanted },
    Body { size_bytes: u64, digest: String },
}

/// A document and a question about it.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    pub(crate) file: String,
    pub(crate) document: Vec<u8>,
    pub(crate) question: Question,
}

/// An answer: the verdict's name, the wrong line of a document, and what an accepted document says.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Verdict {
    pub(crate) name: &'static str,
    pub(crate) line: usize,
    pub(crate) says: String,
}

impl Known {
    /// A device that has only the root keys of its manufacture.
    pub(crate) fn pinned() -> Self {
        Self { name: "pinned".to_owned(), document: Vec::new() }
    }

    fn trust(&self) -> Trust {
        if self.document.is_empty() {
            return Trust::Roots(pinned_roots());
        }
        Trust::Keyring(SignedKeyring::parse(&self.document).unwrap().unchecked().clone())
    }

    /// The keys that may have signed.
    fn keys(&self) -> Vec<PublicKey> {
        match self.trust() {
            Trust::Roots(_) => Vec::new(),
            Trust::Keyring(keyring) => keyring.keys.iter().map(|listed| listed.key).collect(),
        }
    }
}

impl Case {
    /// The case in a line of `cases.txt`, without its verdict.
    pub(crate) fn line(&self) -> String {
        let file = &self.file;
        match &self.question {
            Question::Keyring { known, now } => format!("keyring {file} {} {now}", known.name),
            Question::Manifest { known, now, wanted } => {
                let Wanted { display, optics, format, generation } = wanted;
                let wanted = format!("{display} {} {format} {generation}", optics.digest());
                format!("manifest {file} {} {now} {wanted}", known.name)
            }
            Question::Body { size_bytes, digest } => format!("body {file} {size_bytes} {digest}"),
        }
    }

    /// The answer of `Trust`.
    pub(crate) fn verdict(&self) -> Verdict {
        match &self.question {
            Question::Body { size_bytes, digest } => of_body(&self.document, *size_bytes, digest),
            Question::Keyring { known, now } => of_result(known.trust().renew(&self.document, now.now()), keyring_says),
            Question::Manifest { known, now, wanted } => {
                of_result(known.trust().manifest(&self.document, wanted, now.now()), manifest_says)
            }
        }
    }

    /// Each right signature of the document: the key, the SHA-256 of what it signed, the signature.
    pub(crate) fn signatures(&self) -> Vec<u8> {
        const LINE: &[u8] = b"\nsignature ";
        let Some(at) = self.document.windows(LINE.len()).position(|window| window == LINE) else { return Vec::new() };
        let (body, rest) = self.document.split_at(at + 1);
        let Ok(rest) = std::str::from_utf8(rest) else { return Vec::new() };
        let keys = match &self.question {
            Question::Manifest { known, .. } => known.keys(),
            Question::Keyring { .. } | Question::Body { .. } => Vec::new(),
        };
        let signatures = rest.lines().filter_map(|line| line.strip_prefix("signature ")).flat_map(|text| {
            let signed = text.split_once(' ').and_then(|(key, text)| Some((PublicKey::parse(key)?, text)));
            let (keys, text) = signed.map_or((keys.clone(), text), |(key, text)| (vec![key], text));
            Signature::parse(text).into_iter().flat_map(move |signature| {
                let right = keys.clone().into_iter().filter(move |key| key.verifies(body, &signature));
                let bytes = hex_bytes(&signature.to_string());
                right.flat_map(move |key| [key.as_bytes().as_slice(), &Sha256::digest(body), &bytes].concat())
            })
        });
        signatures.collect()
    }
}

impl Clock {
    fn now(self) -> Now {
        // The nearest time that a document can have.
        let time = |unix_s: i64| Time::from_unix_s(unix_s.clamp(0, TIME_MAX)).unwrap();
        match self {
            Self::At(unix_s) => Now::At(time(unix_s)),
            Self::AtLeast(unix_s) => Now::AtLeast(time(unix_s)),
            Self::None => Now::AtLeast(time(0)),
        }
    }
}

impl fmt::Display for Clock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::At(unix_s) => write!(f, "{unix_s}"),
            Self::AtLeast(unix_s) => write!(f, "{unix_s}+"),
            Self::None => f.write_str("none"),
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}{}", self.name, self.line, self.says)
    }
}

/// Cases in the form that `manifest_verdicts.c` reads.
pub(crate) fn pack(cases: &[Case]) -> Vec<u8> {
    let mut packed = Vec::new();
    let mut part = |bytes: &[u8]| {
        packed.extend((bytes.len() as u32).to_le_bytes());
        packed.extend(bytes);
    };
    part(&pinned_roots().iter().flat_map(|root| *root.as_bytes()).collect::<Vec<_>>());
    for case in cases {
        let known: &[u8] = match &case.question {
            Question::Keyring { known, .. } | Question::Manifest { known, .. } => &known.document,
            Question::Body { .. } => &[],
        };
        let verdict = if matches!(case.question, Question::Body { .. }) { "-" } else { "- -" };
        part(format!("{} {verdict}", case.line()).as_bytes());
        part(known);
        part(&case.document);
        let known_case = Case {
            document: known.to_vec(),
            question: Question::Keyring { known: Known::pinned(), now: Clock::None },
            ..case.clone()
        };
        part(&[known_case.signatures(), case.signatures()].concat());
    }
    packed
}

pub(crate) fn hex_bytes(text: &str) -> Vec<u8> {
    (0..text.len()).step_by(2).map(|at| u8::from_str_radix(&text[at..at + 2], 16).unwrap()).collect()
}

fn refused(name: &'static str, line: usize) -> Verdict {
    Verdict { name, line, says: String::new() }
}

fn of_result<T>(result: Result<T, Distrust>, says: impl FnOnce(&T) -> String) -> Verdict {
    match result {
        Ok(accepted) => Verdict { name: "trusted", line: 0, says: says(&accepted) },
        Err(distrust) => of_distrust(&distrust),
    }
}

/// The C code has a verdict for each reason, and two for each time: not yet, and no more.
fn of_distrust(distrust: &Distrust) -> Verdict {
    let either = |from: &Time, now: &Now, not_yet, expired| if now.is_before(*from) { not_yet } else { expired };
    let name = match distrust {
        Distrust::Document(error) => return of_document(error),
        Distrust::KeyringSignature => "keyring_wrong_signature",
        Distrust::OlderKeyring { .. } => "keyring_older",
        Distrust::OtherKeyring { .. } => "keyring_different",
        Distrust::KeyringTime { from, now, .. } => either(from, now, "keyring_not_yet", "keyring_expired"),
        Distrust::UnknownKey { .. } => "key_unknown",
        Distrust::RevokedKey { .. } => "key_revoked",
        Distrust::KeyTime { from, now, .. } => either(from, now, "key_not_yet", "key_expired"),
        Distrust::Signature => "manifest_wrong_signature",
        Distrust::Time { from, now, .. } => either(from, now, "manifest_not_yet", "manifest_expired"),
        Distrust::Other { name: "display", .. } => "other_display",
        Distrust::OtherOptics { .. } => "other_optics",
        Distrust::Other { name: "format", .. } => "other_format",
        Distrust::Other { name, .. } => panic!("the line {name} has no verdict"),
        Distrust::LowerGeneration { .. } => "lower_generation",
    };
    refused(name, 0)
}

fn of_document(error: &DocumentError) -> Verdict {
    match *error {
        DocumentError::TooLarge { .. } => refused("document_too_large", 0),
        DocumentError::NotText => refused("document_not_text", 0),
        DocumentError::Name { line, .. } => refused("document_other_line", line),
        DocumentError::Version { .. } => refused("document_other_version", 1),
        DocumentError::Value { line, .. } => refused("document_wrong_value", line),
        DocumentError::TooLong { line } => refused("document_too_long", line),
    }
}

fn of_body(bytes: &[u8], size_bytes: u64, wanted: &str) -> Verdict {
    let name = match (bytes.len() as u64).cmp(&size_bytes) {
        std::cmp::Ordering::Greater => "body_longer",
        std::cmp::Ordering::Less => "body_shorter",
        std::cmp::Ordering::Equal if digest(bytes) != wanted => "body_corrupt",
        std::cmp::Ordering::Equal => "trusted",
    };
    refused(name, 0)
}

/// The words that `manifest_verdicts.c` prints of a keyring.
fn keyring_says(keyring: &Keyring) -> String {
    let mut says = format!(" {} {} {}", keyring.version, keyring.issued.unix_s(), keyring.expires.unix_s());
    says.extend(keyring.roots.iter().map(|root| format!(" root {root}")));
    let listed = keyring.keys.iter();
    says.extend(listed.map(|key| format!(" key {} {} {}", key.key, key.from.unix_s(), key.until.unix_s())));
    says.extend(keyring.revoked.iter().map(|key| format!(" revoked {key}")));
    says
}

/// The words that `manifest_verdicts.c` prints of a manifest.
fn manifest_says(manifest: &Manifest) -> String {
    let Manifest { optics, generation, version, digest, size_bytes, .. } = manifest;
    let Manifest { width_px, height_px, pixel_pitch_pm, orders, interpolated, issued, expires, .. } = manifest;
    let hex = digest.strip_prefix("sha256-").unwrap();
    let (interpolated, issued, expires) = (u8::from(*interpolated), issued.unix_s(), expires.unix_s());
    format!(
        " {} {} {} {generation} {version} {digest} {hex} {size_bytes} {width_px} {height_px} {pixel_pitch_pm} \
         {interpolated} {issued} {expires} {orders}",
        optics.digest(),
        optics.wavelength_pm,
        optics.place,
    )
}
