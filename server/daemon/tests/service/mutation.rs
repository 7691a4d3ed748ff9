//! Damaged files and messages for tests: valid ones with a few random changes.

use prost::bytes::Buf as _;
use prost::encoding::{decode_varint, encode_varint};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use std::fs;
use std::path::PathBuf;

/// A random number generator that gives the same numbers in every run.
pub(crate) struct Random(ChaCha8Rng);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// A random number below `end`; 0 if `end` is 0.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        if end == 0 { 0 } else { self.0.random_range(0..end) }
    }
}

/// Writes valid inputs for a target of `fuzz/`, with which libFuzzer begins. They are files below the folder in the
/// environment variable `LIGHTPATH_FUZZ_CORPUS`; without the variable, no file is written.
pub(crate) fn add_to_corpus(target: &str, inputs: &[Vec<u8>]) {
    let Some(corpus) = std::env::var_os("LIGHTPATH_FUZZ_CORPUS").map(PathBuf::from) else { return };
    let folder = corpus.join(target);
    fs::create_dir_all(&folder).unwrap();
    for (n, input) in inputs.iter().enumerate() {
        fs::write(folder.join(format!("valid-{n}")), input).unwrap();
    }
}

/// Numbers at which the handling of sizes, counts and offsets often fails.
const EDGES: [u64; 9] =
    [0, 1, 0x7f, 0xff, 0xffff, 0x7fff_ffff, 0xffff_ffff, 0x7fff_ffff_ffff_ffff, 0xffff_ffff_ffff_ffff];

/// Returns `seed` with one to eight changes. Some changes insert parts of `others`.
pub(crate) fn mutated(seed: &[u8], others: &[Vec<u8>], random: &mut Random) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..=random.below(8) {
        let at = random.below(bytes.len());
        // A third of the changes are in the first 200 bytes, because headers contain sizes.
        let at = if random.below(3) == 0 { at.min(random.below(200)) } else { at };
        let count = random.below(16).min(bytes.len().saturating_sub(at));
        match random.below(8) {
            0 if at < bytes.len() => bytes[at] ^= 1 << random.below(8),
            1 if at < bytes.len() => bytes[at] = random.below(256) as u8,
            2 => bytes.truncate(at),
            3 => drop(bytes.drain(at..at + count)),
            4 => {
                let copy = bytes[at..at + count].to_vec();
                drop(bytes.splice(at..at, copy));
            }
            5 => {
                let edge = EDGES[random.below(EDGES.len())];
                let width = 1 << random.below(4);
                let mut number = edge.to_le_bytes()[..width].to_vec();
                if random.below(2) == 0 {
                    number.reverse();
                }
                let end = (at + width).min(bytes.len());
                drop(bytes.splice(at..end, number));
            }
            6 if !others.is_empty() => {
                let other = &others[random.below(others.len())];
                let from = random.below(other.len());
                let part = other[from..other.len().min(from + random.below(64))].to_vec();
                drop(bytes.splice(at..at, part));
            }
            _ => bytes.insert(at, b"{}[]\",:.0-9e\n"[random.below(13)]),
        }
    }
    bytes
}

/// A valid message with some of its fields changed, removed or repeated. Most results can still be decoded.
pub(crate) fn with_changed_fields(message: &[u8], random: &mut Random) -> Vec<u8> {
    let Some(mut fields) = fields(message).filter(|fields| !fields.is_empty()) else { return text(random) };
    for _ in 0..=random.below(2) {
        let at = random.below(fields.len());
        match random.below(8) {
            0 if fields.len() > 1 => drop(fields.remove(at)),
            1 => fields.push(fields[at].clone()),
            _ => fields[at].1 = fields[at].1.changed(random),
        }
    }
    let mut bytes = Vec::new();
    for (tag, value) in fields {
        encode_varint(tag, &mut bytes);
        match value {
            Value::Varint(number) => encode_varint(number, &mut bytes),
            Value::Double(number) => bytes.extend(number.to_le_bytes()),
            Value::Bytes(part) => {
                encode_varint(part.len() as u64, &mut bytes);
                bytes.extend(part);
            }
        }
    }
    bytes
}

/// Value of a protobuf field. The API uses only these kinds.
#[derive(Clone)]
enum Value {
    Varint(u64),
    Double(f64),
    Bytes(Vec<u8>),
}

impl Value {
    fn changed(&self, random: &mut Random) -> Self {
        const DOUBLES: [f64; 8] = [f64::NAN, f64::INFINITY, -1.0, 0.0, 1e308, 5e-324, 1.0, -0.0];
        match self {
            Self::Varint(_) => Self::Varint(EDGES[random.below(EDGES.len())]),
            Self::Double(_) => Self::Double(DOUBLES[random.below(DOUBLES.len())]),
            Self::Bytes(part) if random.below(3) > 0 => Self::Bytes(with_changed_fields(part, random)),
            Self::Bytes(_) => Self::Bytes(text(random)),
        }
    }
}

fn text(random: &mut Random) -> Vec<u8> {
    const PARTS: [&str; 12] =
        ["displays/", "jobs/", "lab", "..", "/", "sha256-", "0", "é", "\u{0}", "%s", " ", "a-very-long-name-"];
    (0..random.below(9)).map(|_| PARTS[random.below(PARTS.len())]).collect::<String>().into_bytes()
}

/// The fields of a message; `None` if the bytes are not a message.
fn fields(mut message: &[u8]) -> Option<Vec<(u64, Value)>> {
    let mut fields = Vec::new();
    while message.has_remaining() {
        let tag = decode_varint(&mut message).ok()?;
        let value = match tag & 7 {
            0 => Value::Varint(decode_varint(&mut message).ok()?),
            1 => Value::Double(message.try_get_f64_le().ok()?),
            2 => {
                let count = usize::try_from(decode_varint(&mut message).ok()?).ok()?;
                let (part, rest) = message.split_at_checked(count)?;
                message = rest;
                Value::Bytes(part.to_vec())
            }
            _ => return None,
        };
        fields.push((tag, value));
    }
    Some(fields)
}
