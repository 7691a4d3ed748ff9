//! Kernel files that were made to take much memory or time.

use super::{alone, import_within};
use flate2::Compression;
use flate2::write::DeflateEncoder;
use std::io::Write as _;

/// What a server could count for such a file \[bytes\].
const BUDGET_BYTES: u64 = 64 << 20;

/// Entry of an archive: its name, its size unpacked, and its deflated content.
struct Entry {
    name: String,
    size: u32,
    crc: u32,
    packed: Vec<u8>,
}

impl Entry {
    /// An array of zeros that is `mib` large, in a few kilobytes.
    fn zeros(name: &str, mib: u32) -> Self {
        let mut content = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
        let header = format!("{{'descr': '<c8', 'fortran_order': False, 'shape': ({}, 1024), }}", mib * 128);
        content.extend(format!("{header:<117}\n").bytes());
        content.resize(content.len() + ((mib as usize) << 20), 0);
        Self::of(name, &content)
    }

    fn of(name: &str, content: &[u8]) -> Self {
        let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(content).unwrap();
        let mut crc = flate2::Crc::new();
        crc.update(content);
        Self { name: name.to_owned(), size: content.len() as u32, crc: crc.sum(), packed: encoder.finish().unwrap() }
    }
}

/// An archive of `entries`; all of them name the content of the first one if `is_shared`.
fn archive(entries: &[Entry], is_shared: bool) -> Vec<u8> {
    let (mut file, mut directory) = (Vec::new(), Vec::new());
    for (i, entry) in entries.iter().enumerate() {
        let place = if is_shared { 0 } else { file.len() as u32 };
        let mut common = vec![20, 0, 0, 0, 8, 0, 0, 0, 0x21, 0];
        [entry.crc, entry.packed.len() as u32, entry.size].iter().for_each(|n| common.extend(n.to_le_bytes()));
        common.extend((entry.name.len() as u16).to_le_bytes());
        common.extend([0, 0]);
        if i == 0 || !is_shared {
            file.extend([b"PK\x03\x04", &common[..], entry.name.as_bytes(), &entry.packed].concat());
        }
        directory.extend([b"PK\x01\x02\x14\x00", &common[..], &[0; 10]].concat());
        directory.extend(place.to_le_bytes());
        directory.extend(entry.name.as_bytes());
    }
    let (start, count) = (file.len() as u32, (entries.len() as u16).to_le_bytes());
    file.extend(&directory);
    file.extend([b"PK\x05\x06\0\0\0\0", &count[..], &count].concat());
    file.extend((directory.len() as u32).to_le_bytes());
    file.extend(start.to_le_bytes());
    file.extend([0, 0]);
    file
}

fn require_refused(name: &str, file: &[u8], reason: &str) {
    let message = import_within(name, file, BUDGET_BYTES);
    assert!(message.contains(reason), "{name}: {message}");
}

/// Names of arrays that an import reads.
const ARRAYS: [&str; 4] = ["kernel", "transfer", "source", "lightpath"];

#[test]
fn archives_that_unpack_to_much_are_refused_before_they_are_unpacked() {
    let _alone = alone();
    let names = || ARRAYS.into_iter().map(str::to_owned).chain((0..56).map(|n| format!("x{n}")));
    let shared: Vec<Entry> = names().map(|name| Entry::zeros(&format!("{name}.npy"), 1)).collect();
    require_refused("a shared content", &archive(&shared, true), "stands twice in the directory");
    for name in ARRAYS {
        let large = [Entry::zeros(&format!("{name}.npy"), 80)];
        assert!(large[0].packed.len() < 200_000);
        require_refused(name, &archive(&large, false), "bytes of memory, but 67108864 are counted");
    }
    let pickle = b"\x80\x02ctorch._utils\n_rebuild_tensor_v2\n((X\x07\0\0\0storagectorch\nFloatStorage\nX\x01\0\0\x000X\x03\0\0\0cpuJ\0\0\0\x01tQK\0(J\0\0\0\x01t(K\x01t\x89ccollections\nOrderedDict\n)RtR.";
    let pt = [Entry::of("k/data.pkl", pickle), Entry::zeros("k/data/0", 80)];
    require_refused("pt", &archive(&pt, false), "bytes of memory, but 67108864 are counted");
    let pt = [Entry::of("k/data.pkl", &vec![b'('; 80 << 20])];
    require_refused("a large pickle", &archive(&pt, false), "bytes of memory, but 67108864 are counted");
}

#[test]
fn entries_that_nothing_reads_are_not_unpacked() {
    let _alone = alone();
    let mut small = vec![Entry::zeros("kernel.npy", 1)];
    small.extend((0..20).map(|n| Entry::zeros(&format!("x{n}.npy"), 8)));
    require_refused("much that is not read", &archive(&small, false), "the display's");
}

#[test]
fn directories_with_many_or_long_names_are_refused() {
    let _alone = alone();
    let entry = |name: String| Entry { name, size: 0, crc: 0, packed: vec![3, 0] };
    let many: Vec<Entry> = (0..u16::MAX).map(|n| entry(format!("{n}.npy"))).collect();
    require_refused("65535 entries", &archive(&many, false), "at most 1000");
    let long: Vec<Entry> = (0..900).map(|n| entry(format!("{n}{}", "\u{1}".repeat(60_000)))).collect();
    require_refused("long names", &archive(&long, false), "at most 1024");
}

/// A safetensors file with a header.
fn safetensors(header: &str) -> Vec<u8> {
    [&(header.len() as u64).to_le_bytes(), header.as_bytes()].concat()
}

#[test]
fn headers_of_safetensors_are_small() {
    let _alone = alone();
    let metadata = |text: &str| safetensors(&format!(r#"{{"__metadata__":{{"lightpath":{}}}}}"#, quoted(text)));
    let many = |part: &str, count: usize| part.repeat(count).trim_end_matches(',').to_owned();
    for (name, file, reason) in [
        (
            "dimensions",
            safetensors(&format!(
                r#"{{"x":{{"dtype":"F32","shape":[{}],"data_offsets":[0,4]}}}}"#,
                many("1,", 20_000_000)
            )),
            "at most 1048576",
        ),
        (
            "fewer dimensions",
            safetensors(&format!(
                r#"{{"x":{{"dtype":"F32","shape":[{}],"data_offsets":[0,4]}}}}"#,
                many("1,", 500_000)
            )),
            "more than 50000 values",
        ),
        (
            "a long shape",
            safetensors(&format!(
                r#"{{"x":{{"dtype":"F32","shape":[{}],"data_offsets":[0,0]}}}}    "#,
                many("0,", 40_000)
            )),
            "more sides",
        ),
        ("a long name", safetensors(&format!(r#"{{"{}":{{"dtype":"F3"}}}}"#, "x".repeat(1_000_000))), "invalid"),
        ("lists in a tensor", safetensors(&format!(r#"{{"x":[{}]}}"#, many("[],", 300_000))), "more than 50000"),
        ("nested lists", safetensors(&format!(r#"{{"x":{}"#, "[".repeat(900_000))), "recursion limit"),
        ("a tree", metadata(&format!(r#"{{"record":[{}]}}"#, many("[],", 300_000))), "more than 50000"),
        ("a tree of objects", metadata(&format!(r#"{{"record":[{}]}}"#, many("{},", 49_000))), "missing field"),
        ("modes", metadata(&format!(r#"{{"mode_orders":[{}]}}"#, many("1,", 400_000))), "more than 50000"),
        ("a long kind", metadata(&format!(r#"{{"model":"{}"}}"#, "x".repeat(900_000))), "invalid"),
        ("a key twice", metadata(r#"{"format":"x","record":{"a":1,"a":2}}"#), "duplicate field `a`"),
        ("a tensor twice", safetensors(r#"{"x":1,"x":2}"#), "duplicate field `x`"),
        ("a header that is not there", u64::MAX.to_le_bytes().into_iter().chain(*b"{}").collect(), "at most 1048576"),
    ] {
        require_refused(name, &file, reason);
    }
}

/// The text as a string of JSON.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\\\""))
}

#[test]
fn arrays_that_claim_a_huge_shape_are_refused() {
    let _alone = alone();
    for shape in ["(1099511627776, 1099511627776)", "(16384, 16384)", "(18446744073709551615,)"] {
        for descr in ["<c8", "<f2", "<U999999999"] {
            let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
            let file = [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes()].concat();
            assert!(!import_within(&header, &file, BUDGET_BYTES).is_empty());
        }
    }
    let compact = [&b"LPKC\x03\x03\x0c\x0c\xff\x00\x08\x0d"[..], &[0xff; 60]].concat();
    require_refused("a compact kernel with many harmonics", &compact, "requires");
}
