//! Damaged documents. `Trust` and the C code must give each the same verdict, and read the same in what they accept.

use crate::cases::{Case, Clock, Known, Question};
use crate::documents::{EARLY, LATE, NEW_ROOT, REVOKED, ROOT, SIGNER, unix_s};
use crate::{answers_in_c, malformed, vectors};
use std::collections::BTreeMap;

/// Documents that one run of the C program gets.
const BATCH: usize = 20_000;
/// Values at the ends of allowed ranges, or beyond, or of another kind.
const VALUES: [&str; 38] = [
    "",
    " ",
    "-",
    "0",
    "00",
    "-0",
    "+1",
    "01",
    "1",
    "2",
    "-1",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "9223372036854775808",
    "-9223372036854775808",
    "-9223372036854775809",
    "18446744073709551615",
    "18446744073709551616",
    "18446744073709551625",
    "100000000000000000000",
    "1970-01-01T00:00:00Z",
    "1969-12-31T23:59:59Z",
    "9999-12-31T23:59:59Z",
    "2024-02-29T12:00:00Z",
    "2026-02-29T12:00:00Z",
    "2100-02-29T12:00:00Z",
    "2400-02-29T12:00:00Z",
    "2026-04-31T12:00:00Z",
    "2026-11-24T23:59:60Z",
    "2026-11-24T24:00:00Z",
    "2026-11-24T12:60:00Z",
    "yes",
    "no",
    "first",
    "distance_nm",
    "focal_plane",
    "f16",
];

/// Numbers that look random, the same in every run.
struct Numbers(u64);

impl Numbers {
    /// A number below `end`.
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % end
    }

    fn of<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        &all[self.below(all.len())]
    }

    fn byte(&mut self) -> u8 {
        // Mostly such that the document stays a text.
        match self.below(8) {
            0 => self.below(256) as u8,
            1 => b'\n',
            _ => b' ' + self.below(95) as u8,
        }
    }
}

/// Changes bytes.
fn damage_bytes(numbers: &mut Numbers, document: &mut Vec<u8>, other: &[u8]) {
    let at = numbers.below(document.len());
    match numbers.below(7) {
        0 => document[at] = numbers.byte(),
        1 => document[at] ^= 1 << numbers.below(8),
        2 => document.insert(at, numbers.byte()),
        3 => drop(document.remove(at)),
        // Digits in digits stay digits.
        4 => document[at] = if document[at].is_ascii_digit() { b'0' + numbers.below(10) as u8 } else { document[at] },
        5 => document.truncate(at + 1),
        _ => {
            let (from, length) = (numbers.below(other.len()), numbers.below(80));
            let part = &other[from..(from + length).min(other.len())];
            let end = if numbers.below(2) == 0 { at } else { (at + part.len()).min(document.len()) };
            document.splice(at..end, part.iter().copied());
        }
    }
}

/// Changes lines and values.
fn damage_lines(numbers: &mut Numbers, document: &mut Vec<u8>, other: &[u8]) {
    let mut lines: Vec<Vec<u8>> = document.split_inclusive(|&byte| byte == b'\n').map(<[u8]>::to_vec).collect();
    let others: Vec<&[u8]> = other.split_inclusive(|&byte| byte == b'\n').collect();
    let at = numbers.below(lines.len());
    let to = numbers.below(lines.len());
    match numbers.below(8) {
        0 => drop(lines.remove(at)),
        1 => lines.insert(to, lines[at].clone()),
        2 => lines.swap(at, to),
        3 => lines[at] = others.get(at).unwrap_or(&others[0]).to_vec(),
        4 => lines.insert(at, numbers.of(&others).to_vec()),
        // A long line, about as long as a document may be.
        5 if numbers.below(8) == 0 => lines[at].splice(1..1, vec![b'x'; 3300 + numbers.below(200)]).for_each(drop),
        _ => {
            let mut words: Vec<&[u8]> = lines[at].trim_ascii_end().split(|&byte| byte == b' ').collect();
            let word = numbers.below(words.len());
            words[word] = numbers.of(&VALUES).as_bytes();
            let changed = [&words.join(&b' ')[..], b"\n"].concat();
            lines[at] = changed;
        }
    }
    *document = lines.concat();
}

/// What damaged cases are made of.
struct Sources {
    /// Well-formed documents, then others.
    cases: Vec<Case>,
    well_formed: usize,
    known: Vec<Known>,
    times: Vec<Clock>,
    /// Documents of the cases, each once, so that those with many cases are not taken more often.
    documents: Vec<Vec<u8>>,
}

impl Sources {
    fn new() -> Self {
        let cases: Vec<Case> = vectors::all().cases.into_iter().map(|(case, _)| case).collect();
        let (cases, malformed): (Vec<_>, Vec<_>) = cases
            .into_iter()
            .filter(|case| !matches!(case.question, Question::Body { .. }))
            .partition(|case| !case.file.starts_with("malformed/"));
        let (well_formed, cases) = (cases.len(), [cases, malformed].concat());
        let documents: BTreeMap<_, _> = cases.iter().map(|case| (case.file.clone(), case.document.clone())).collect();
        let trusted = ["first", "moved", "largest", "bare", "leap-years", "older"].map(|name| {
            let name = format!("{name}.keyring");
            Known { document: documents[&name].clone(), name }
        });
        let times = ["2026-11-23T18:00:00Z", "2026-11-30T18:00:00Z", "2026-12-05T00:00:00Z", "2027-05-01T00:00:00Z"];
        let mut times: Vec<_> =
            times.iter().flat_map(|text| [Clock::At(unix_s(text)), Clock::AtLeast(unix_s(text))]).collect();
        times.extend([Clock::None, Clock::At(0)]);
        let known = [Known::pinned()].into_iter().chain(trusted).collect();
        let documents = documents.into_values().filter(|document| !document.is_empty()).collect();
        Self { cases, well_formed, known, times, documents }
    }

    fn damaged(&self, numbers: &mut Numbers) -> Case {
        // Most begin well-formed: those that are not are refused before anything else is asked.
        let cases = if numbers.below(8) > 0 { &self.cases[..self.well_formed] } else { &self.cases[..] };
        let mut case = numbers.of(cases).clone();
        if case.document.is_empty() || case.document.len() > 1_500 || numbers.below(16) == 0 {
            case.document = numbers.of(&self.documents).clone();
        }
        for _ in 0..numbers.below(4) {
            let other = numbers.of(&self.documents);
            if case.document.is_empty() {
                break;
            }
            if numbers.below(2) == 0 {
                damage_bytes(numbers, &mut case.document, other);
            } else {
                damage_lines(numbers, &mut case.document, other);
            }
        }
        self.change_question(numbers, &mut case.question);
        if numbers.below(2) == 0 {
            case.document = malformed::digested_again(&case.document);
        }
        if numbers.below(4) > 0 {
            case.document = match case.question {
                Question::Keyring { .. } => {
                    malformed::keyring_signed_again(&case.document, *numbers.of(&[ROOT, ROOT, NEW_ROOT]))
                }
                _ => malformed::signed_again(
                    &case.document,
                    *numbers.of(&[SIGNER, SIGNER, SIGNER, EARLY, LATE, REVOKED]),
                ),
            };
        }
        case
    }

    /// Mostly keeps what the device has and wants, so that documents are not refused for it alone.
    fn change_question(&self, numbers: &mut Numbers, question: &mut Question) {
        let (known, now) = match question {
            Question::Keyring { known, now } => (known, now),
            Question::Manifest { known, now, wanted } => {
                match numbers.below(16) {
                    0 => wanted.generation = numbers.below(9) as u64,
                    1 => wanted.format = "f16".to_owned(),
                    2 => wanted.optics.wavelength_pm = 1,
                    _ => {}
                }
                (known, now)
            }
            Question::Body { .. } => return,
        };
        if numbers.below(6) == 0 {
            *known = numbers.of(&self.known).clone();
        }
        if numbers.below(6) == 0 {
            *now = *numbers.of(&self.times);
        }
    }
}

/// Gives both the same damaged documents, and returns a sentence about them.
pub(crate) fn compare(count: usize) -> String {
    let sources = Sources::new();
    let mut numbers = Numbers(0x6d61_6e69_6665_7374);
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    for batch in 0..count.div_ceil(BATCH) {
        let cases = (0..BATCH.min(count - batch * BATCH)).map(|_| sources.damaged(&mut numbers));
        let (cases, verdicts): (Vec<Case>, Vec<_>) = cases.map(|case| (case.clone(), case.verdict())).unzip();
        for ((case, verdict), answer) in cases.iter().zip(&verdicts).zip(answers_in_c("damaged_manifests", &cases)) {
            let document = String::from_utf8_lossy(&case.document);
            assert_eq!(answer, verdict.to_string(), "{}\n{document}", case.line());
            *seen.entry(verdict.name).or_default() += 1;
        }
    }
    let total: usize = seen.values().sum();
    let accepted = seen["trusted"];
    assert!((total / 50..total / 2).contains(&accepted), "{accepted} of {total} documents were accepted");
    format!("{total} damaged documents have the same verdicts: {seen:?}")
}
