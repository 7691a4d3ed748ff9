//! Documents that are none. Where they still have a signature, it is right: only their form is wrong.

use crate::cases::Known;
use crate::documents::{NOW, ROOT, SIGNER, digest, key, keyring, listed, manifest, optics, public, signed_keyring};
use crate::vectors::{Set, known, of_keyring, of_manifest, wanted};
use lightpath_manifest::{Keyring, Manifest, Optics};

/// Name of the verdict about a wrong value.
const VALUE: &str = "document_wrong_value";
/// Name of the verdict about a line that is not the one that must stand there.
const OTHER: &str = "document_other_line";
const NOT_TEXT: &str = "document_not_text";
const TOO_LONG: &str = "document_too_long";
const VERSION: &str = "document_other_version";

/// Values of a manifest that are not possible: the number of the line, a name for the file, the line.
const MANIFEST_VALUES: [(usize, &str, &str); 68] = [
    (2, "empty", "display "),
    (2, "space", "display pl uto"),
    (2, "two-spaces", "display  pluto"),
    (2, "space-at-end", "display pluto "),
    (2, "slash", "display pluto/1"),
    (2, "comma", "display pluto,1"),
    (2, "64-characters", "display pluto-pluto-pluto-pluto-pluto-pluto-pluto-pluto-pluto-pluto-1234"),
    (3, "63-digits", "optics 0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcde"),
    (3, "65-digits", "optics 0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef0"),
    (3, "upper-case", "optics 0123456789ABCDEF0123456789abcdef0123456789abcdef0123456789abcdef"),
    (3, "as-a-digest", "optics sha256-0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef"),
    (4, "leading-zero", "wavelength_pm 0515000"),
    (4, "plus", "wavelength_pm +515000"),
    (4, "fraction", "wavelength_pm 515000.0"),
    (4, "too-large", "wavelength_pm 9223372036854775808"),
    (4, "too-small", "wavelength_pm -9223372036854775809"),
    (4, "minus-zero", "wavelength_pm -0"),
    (4, "minus", "wavelength_pm -"),
    (4, "empty", "wavelength_pm "),
    (5, "empty", "place "),
    (5, "no-kind", "place  150000000"),
    (5, "only-a-kind", "place distance_nm"),
    (5, "nothing-after-the-kind", "place distance_nm "),
    (5, "kind-with-a-slash", "place distance/nm 150000000"),
    (5, "kind-of-64", "place kind-kind-kind-kind-kind-kind-kind-kind-kind-kind-kind-kind-1234 1"),
    (6, "leading-zero", "generation 07"),
    (6, "minus", "generation -7"),
    (6, "too-large", "generation 18446744073709551616"),
    (6, "far-too-large", "generation 99999999999999999999999"),
    (6, "space-at-end", "generation 7 "),
    (7, "leading-zero", "version 012"),
    (7, "too-large", "version 4294967296"),
    (8, "empty", "format "),
    (8, "space", "format com pact"),
    (9, "upper-case", "digest sha256-0123456789ABCDEF0123456789abcdef0123456789abcdef0123456789abcdef"),
    (9, "no-digit", "digest sha256-0123456789abcdeg0123456789abcdef0123456789abcdef0123456789abcdef"),
    (9, "too-short", "digest sha256-0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcde"),
    (9, "too-long", "digest sha256-0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef0"),
    (9, "another-hash", "digest sha512-0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef"),
    (9, "no-hash", "digest 0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef"),
    (10, "too-large", "size_bytes 18446744073709551616"),
    (10, "leading-zero", "size_bytes 0200"),
    (11, "too-large", "width_px 4294967296"),
    (11, "hexadecimal", "width_px 0x780"),
    (12, "leading-zero", "height_px 01080"),
    (13, "minus", "pixel_pitch_pm -8000000"),
    (15, "upper-case", "interpolated No"),
    (15, "number", "interpolated 0"),
    (15, "space-at-end", "interpolated no "),
    (16, "no-leap-year", "issued 2026-02-29T00:00:00Z"),
    (16, "century", "issued 2100-02-29T00:00:00Z"),
    (16, "month-0", "issued 2026-00-01T00:00:00Z"),
    (16, "minute-60", "issued 2026-11-23T18:60:00Z"),
    (16, "month-13", "issued 2026-13-01T00:00:00Z"),
    (16, "day-0", "issued 2026-11-00T00:00:00Z"),
    (16, "hour-24", "issued 2026-11-23T24:00:00Z"),
    (16, "leap-second", "issued 2026-11-23T23:59:60Z"),
    (16, "before-1970", "issued 1969-12-31T23:59:59Z"),
    (16, "lower-case", "issued 2026-11-23t18:00:00z"),
    (17, "space-for-t", "expires 2026-11-30 18:00:00Z"),
    (17, "no-zone", "expires 2026-11-30T18:00:00"),
    (17, "offset", "expires 2026-11-30T18:00:00+00:00"),
    (17, "year-10000", "expires 10000-01-01T00:00:00Z"),
    (17, "31st-of-november", "expires 2026-11-31T18:00:00Z"),
    (18, "15-digits", "key 0123456789abcde"),
    (18, "17-digits", "key 0123456789abcdef0"),
    (18, "upper-case", "key 0123456789ABCDEF"),
    (18, "no-digits", "key not hexadecimal!"),
];

/// The manifest with a new, right signature, if a line for it is there.
pub(crate) fn signed_again(bytes: &[u8], seed: u8) -> Vec<u8> {
    const LINE: &[u8] = b"\nsignature ";
    let Some(at) = bytes.windows(LINE.len()).position(|window| window == LINE) else { return bytes.to_vec() };
    let (body, rest) = bytes.split_at(at + 1);
    let end = rest.iter().position(|&byte| byte == b'\n').unwrap_or(rest.len());
    [body, format!("signature {}", key(seed).sign(body)).as_bytes(), &rest[end..]].concat()
}

/// The manifest with the digest of its present optics, if these lines are in their places.
pub(crate) fn digested_again(bytes: &[u8]) -> Vec<u8> {
    let mut lines: Vec<&[u8]> = bytes.split_inclusive(|&byte| byte == b'\n').collect();
    if lines.len() < 5 || !lines[2].starts_with(b"optics ") {
        return bytes.to_vec();
    }
    let digest = digest(&lines[3..5].concat()).replacen("sha256-", "optics ", 1) + "\n";
    lines[2] = digest.as_bytes();
    lines.concat()
}

/// The keyring with new, right signatures in all their lines.
pub(crate) fn keyring_signed_again(bytes: &[u8], seed: u8) -> Vec<u8> {
    const LINE: &[u8] = b"\nsignature ";
    let Some(at) = bytes.windows(LINE.len()).position(|window| window == LINE) else { return bytes.to_vec() };
    let (body, rest) = bytes.split_at(at + 1);
    let right = format!("signature {} {}", public(seed), key(seed).sign(body)).into_bytes();
    let lines = rest.split_inclusive(|&byte| byte == b'\n').map(|line| {
        let is_signature = line.starts_with(&LINE[1..]);
        let end = if line.ends_with(b"\n") { "\n" } else { "" };
        if is_signature { [&right, end.as_bytes()].concat() } else { line.to_vec() }
    });
    [body.to_vec(), lines.collect::<Vec<_>>().concat()].concat()
}

fn lines_of(bytes: &[u8]) -> Vec<String> {
    std::str::from_utf8(bytes).unwrap().split_inclusive('\n').map(str::to_owned).collect()
}

/// The lines without one, with one twice, and with two in the other order.
fn moved_lines(lines: &[String]) -> Vec<(String, String, &'static str, usize)> {
    let mut moved = Vec::new();
    for at in 0..lines.len() {
        let (number, is_last) = (at + 1, at + 1 == lines.len());
        let change = |change: &dyn Fn(&mut Vec<String>)| {
            let mut lines = lines.to_vec();
            change(&mut lines);
            lines.concat()
        };
        let twice = if is_last { (TOO_LONG, number + 1) } else { (OTHER, number + 1) };
        moved.push((format!("{number:02}-missing"), change(&|lines| drop(lines.remove(at))), OTHER, number));
        let doubled = change(&|lines| lines.insert(at, lines[at].clone()));
        moved.push((format!("{number:02}-doubled"), doubled, twice.0, twice.1));
        if !is_last {
            moved.push((format!("{number:02}-swapped"), change(&|lines| lines.swap(at, at + 1)), OTHER, number));
        }
    }
    moved
}

/// Changes that make no text of a document, or another number of lines; `lines`: of the document.
fn texts(good: &str, lines: usize) -> Vec<(&'static str, Vec<u8>, &'static str, usize)> {
    let of = |text: String| text.into_bytes();
    let after = |head: &str, byte: u8| [head.as_bytes(), &[byte], &good.as_bytes()[head.len()..]].concat();
    vec![
        ("empty", Vec::new(), NOT_TEXT, 0),
        ("only-a-line-feed", of("\n".to_owned()), OTHER, 1),
        ("carriage-returns", of(good.replace('\n', "\r\n")), NOT_TEXT, 0),
        ("no-line-feed-at-end", of(good.trim_end().to_owned()), NOT_TEXT, 0),
        ("zero-byte-at-end", of(good.to_owned() + "\0"), NOT_TEXT, 0),
        ("zero-byte", after("lightpath ", 0), NOT_TEXT, 0),
        ("tab", after("lightpath ", b'\t'), NOT_TEXT, 0),
        ("delete", after("lightpath ", 0x7f), NOT_TEXT, 0),
        ("latin-1", after("lightpath ", 0xe4), NOT_TEXT, 0),
        ("umlaut", of(good.replacen("path", "päth", 1)), NOT_TEXT, 0),
        ("byte-order-mark", of("\u{feff}".to_owned() + good), NOT_TEXT, 0),
        ("line-feed-first", of("\n".to_owned() + good), OTHER, 1),
        ("space-first", of(" ".to_owned() + good), OTHER, 1),
        ("upper-case-head", of(good.replacen("lightpath", "Lightpath", 1)), OTHER, 1),
        ("line-feed-at-end", of(good.to_owned() + "\n"), TOO_LONG, lines + 1),
        ("line-at-end", of(good.to_owned() + "more 1\n"), TOO_LONG, lines + 1),
        ("twice", of(good.to_owned() + good), TOO_LONG, lines + 1),
        ("cut", of(good.split_inclusive('\n').take(lines - 2).collect()), OTHER, lines - 1),
        ("line-feed-in-a-line", of(good.replacen("issued ", "issued\n", 1)), OTHER, position(good, "issued")),
        ("no-space", of(good.replacen("issued ", "issued", 1)), OTHER, position(good, "issued")),
        ("upper-case-name", of(good.replacen("issued ", "Issued ", 1)), OTHER, position(good, "issued")),
        ("longer-name", of(good.replacen("issued ", "issueds ", 1)), OTHER, position(good, "issued")),
    ]
}

/// Number of the line with this name.
fn position(text: &str, name: &str) -> usize {
    text.lines().position(|line| line.starts_with(name)).unwrap() + 1
}

/// Manifests of other versions of the format, and some whose digest is not that of their optics.
fn versions_and_optics(good: &str) -> Vec<(&'static str, String, &'static str, usize)> {
    let version = |text: &str| good.replacen("lightpath manifest 2", text, 1);
    let line = |of: &Optics| format!("optics {}", of.digest());
    let far = Optics::at_distance(515_000, 151_000_000);
    let long = Optics { place: format!("distance_nm {}", "1".repeat(129)), ..optics() };
    vec![
        ("01-version-1", version("lightpath manifest 1"), VERSION, 1),
        ("01-next-version", version("lightpath manifest 3"), VERSION, 1),
        ("01-leading-zero", version("lightpath manifest 02"), VERSION, 1),
        ("01-no-version", version("lightpath manifest "), VERSION, 1),
        ("05-digest-of-another-place", good.replace(&line(&optics()), &line(&far)), VALUE, 5),
        ("05-place-of-another-digest", good.replace("nm 150000000", "nm 151000000"), VALUE, 5),
        ("05-wavelength-of-another-digest", good.replace("pm 515000", "pm 515001"), VALUE, 5),
        ("05-129-characters", Manifest { optics: long, ..manifest() }.signed(&key(SIGNER)), VALUE, 5),
    ]
}

pub(crate) fn manifests(set: &mut Set) {
    let good = manifest().signed(&key(SIGNER));
    let lines = lines_of(good.as_bytes());
    let mut add = |name: &str, text: &[u8], verdict, line| {
        let question = of_manifest(&known(), NOW, &wanted());
        set.add(&format!("malformed/manifest-{name}"), signed_again(text, SIGNER), question, verdict, line);
    };
    for (name, text, verdict, line) in moved_lines(&lines) {
        add(&name, text.as_bytes(), verdict, line);
    }
    for (number, name, line) in MANIFEST_VALUES {
        let mut lines = lines.clone();
        lines[number - 1] = format!("{line}\n");
        add(&format!("{number:02}-{name}"), lines.concat().as_bytes(), VALUE, number);
    }
    for (name, text, verdict, line) in versions_and_optics(&good) {
        add(name, text.as_bytes(), verdict, line);
    }
    for (name, text, verdict, line) in texts(&good, lines.len()) {
        add(name, &text, verdict, line);
    }
    let keyring = signed_keyring(&keyring(), &[ROOT]);
    let question = || of_manifest(&known(), NOW, &wanted());
    set.add("first.keyring", keyring, question(), OTHER, 1);
    // Not signed again: the signature's own form is wrong.
    let signature = lines[18].trim_end();
    for (name, line) in [
        ("127-digits", signature[..signature.len() - 1].to_owned()),
        ("129-digits", signature.to_owned() + "0"),
        ("upper-case", "signature ".to_owned() + &signature["signature ".len()..].to_uppercase()),
        ("space-at-end", signature.to_owned() + " "),
        ("with-its-key", signature.replace("signature", &format!("signature {}", public(SIGNER)))),
    ] {
        let text = good.replace(signature, &line).into_bytes();
        set.add(&format!("malformed/manifest-19-{name}"), text, question(), VALUE, 19);
    }
}

/// Values of a keyring that are not possible.
fn keyring_values(good: &str) -> Vec<(&'static str, String, usize)> {
    let replaced = |name: &'static str, line: &str, from: &str, to: &str| {
        let at = position(good, line);
        let mut lines = lines_of(good.as_bytes());
        let changed = lines[at - 1].replacen(from, to, 1);
        assert!(changed != lines[at - 1], "{name}");
        lines[at - 1] = changed;
        (name, lines.concat(), at)
    };
    let (root, signer) = (public(ROOT).to_string(), public(SIGNER).to_string());
    vec![
        replaced("version-leading-zero", "version", " 3", " 03"),
        replaced("version-too-large", "version", " 3", " 4294967296"),
        replaced("version-minus", "version", " 3", " -3"),
        replaced("issued-lower-case", "issued", "T", "t"),
        replaced("expires-year-10000", "expires", "2026", "10000"),
        replaced("root-63-digits", "root", &root, &root[..63]),
        replaced("root-65-digits", "root", &root, &format!("{root}0")),
        replaced("root-upper-case", "root", &root, &root.to_uppercase()),
        replaced("root-space-at-end", "root", &root, &format!("{root} ")),
        replaced("root-empty", "root", &root, ""),
        replaced("key-alone", "key", " 2026-11-01T00:00:00Z 2027-11-01T00:00:00Z", ""),
        replaced("key-one-time", "key", " 2027-11-01T00:00:00Z", ""),
        replaced("key-three-times", "key", "Z 2027", "Z 2026-12-01T00:00:00Z 2027"),
        replaced("key-two-spaces", "key", "Z ", "Z  "),
        replaced("key-no-space", "key", "Z ", "Z"),
        replaced("key-hyphen-for-space", "key", "Z ", "Z-"),
        replaced("key-upper-case", "key", &signer, &signer.to_uppercase()),
        replaced("key-31st-of-november", "key", "2027-11-01", "2027-11-31"),
        replaced("key-no-time", "key", "2026-11-01T00:00:00Z", "2026-11-01T00:00:0_Z"),
        replaced("revoked-63-digits", "revoked", "\n", "0\n"),
    ]
}

pub(crate) fn keyrings(set: &mut Set) {
    let good = String::from_utf8(signed_keyring(&keyring(), &[ROOT])).unwrap();
    let lines = lines_of(good.as_bytes());
    let mut add = |name: &str, text: &[u8], verdict, line| {
        let question = of_keyring(&Known::pinned(), NOW);
        set.add(&format!("malformed/keyring-{name}"), keyring_signed_again(text, ROOT), question, verdict, line);
    };
    // Lines of keys may be missing or twice.
    for (name, text, verdict, line) in moved_lines(&lines[..4]) {
        let (text, is_last) = (text + &lines[4..].concat(), name.starts_with("04"));
        match name.as_str() {
            "04-doubled" => add(&name, text.as_bytes(), OTHER, 5),
            _ => add(&name, text.as_bytes(), verdict, line - usize::from(is_last && line > 5)),
        }
    }
    let with_line = |after: &str, line: &str| good.replacen(after, &format!("{after}{line}"), 1);
    let (root, revoked) = (lines[4].clone(), lines[10].clone());
    add("root-after-keys", (lines[..4].concat() + &lines[5] + &root + &lines[6..].concat()).as_bytes(), OTHER, 6);
    add("key-after-revoked", with_line(&revoked, &lines[5]).as_bytes(), OTHER, 12);
    add("no-signature", lines[..11].concat().as_bytes(), OTHER, 12);
    add("line-between-signatures", (good.clone() + &root + &lines[11]).as_bytes(), TOO_LONG, 13);
    add("next-version", good.replacen(" 1\n", " 2\n", 1).as_bytes(), VERSION, 1);
    for (name, text, line) in keyring_values(&good) {
        add(name, text.as_bytes(), VALUE, line);
    }
    for (name, text, verdict, line) in texts(&good, lines.len()) {
        add(name, &text, verdict, line);
    }
    too_many_keys(set);
    let question = || of_keyring(&Known::pinned(), NOW);
    set.add("good.manifest", manifest().signed(&key(SIGNER)).into_bytes(), question(), OTHER, 1);
    let signature = lines[11].trim_end();
    for (name, line) in [
        ("127-digits", signature[..signature.len() - 1].to_owned()),
        ("129-digits", signature.to_owned() + "0"),
        ("without-its-key", signature.replace(&format!("{} ", public(ROOT)), "")),
        ("upper-case", "signature ".to_owned() + &signature["signature ".len()..].to_uppercase()),
        ("two-spaces", signature.replace(&public(ROOT).to_string(), &format!("{} ", public(ROOT)))),
        ("hyphen-for-space", signature.replace(&format!("{} ", public(ROOT)), &format!("{}-", public(ROOT)))),
    ] {
        let text = good.replace(signature, &line).into_bytes();
        set.add(&format!("malformed/keyring-signature-{name}"), text, question(), VALUE, 12);
    }
}

/// Keyrings with nine keys of a kind.
fn too_many_keys(set: &mut Set) {
    let nine = || (20..29).map(public).collect::<Vec<_>>();
    let times = ("2026-11-01T00:00:00Z", "2027-11-01T00:00:00Z");
    let keys = (20..29).map(|seed| listed(seed, times.0, times.1)).collect();
    let signers = [1, 1, 1, 1, 1, 1, 1, 1, 1];
    for (name, keyring, roots, line) in [
        ("roots", Keyring { roots: nine(), ..keyring() }, &signers[..1], 13),
        ("keys", Keyring { keys, ..keyring() }, &signers[..1], 14),
        ("revoked", Keyring { revoked: nine(), ..keyring() }, &signers[..1], 18),
        ("signatures", keyring(), &signers[..], 20),
    ] {
        let (file, question) = (format!("malformed/keyring-nine-{name}"), of_keyring(&Known::pinned(), NOW));
        set.add(&file, signed_keyring(&keyring, roots), question, VALUE, line);
    }
}
