//! All vectors, each with the verdict that a person wrote down.

use crate::cases::{Case, Clock, Known, Question, Verdict};
use crate::documents::{
    EARLY, GONE, LATE, NEW_ROOT, NOW, REVOKED, ROOT, SIGNER, STRANGER, body, digest, extreme_manifest, key, keyring,
    listed, manifest, manifest_of, new_optics, pinned_roots, public, signed_keyring, time, unix_s, wanted_of,
};
use crate::malformed;
use lightpath_manifest::{DOCUMENT_BYTES_MAX, Keyring, ListedKey, Manifest, Optics, Wanted};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

const CASES_HEAD: &str = "\
# What a device must say about each document. Times are seconds since 1970; with a + it is that time or later, and none:
# the device has no clock, which is 0+.
# keyring FILE KNOWN NOW VERDICT LINE          KNOWN: the device's keyring, or pinned: it has only roots.txt
# manifest FILE KNOWN NOW DISPLAY OPTICS FORMAT GENERATION VERDICT LINE
# body FILE SIZE DIGEST VERDICT
";
const SIGNATURES_HEAD: &str = "\
# Every right signature of the documents, for a test without Ed25519: the key, the SHA-256 of what it signed, the
# signature.
";
/// Signed documents must not be changed by a checkout.
const ATTRIBUTES: &str = "* -text\n";

/// The files of the vectors, and the cases.
#[derive(Default)]
pub(crate) struct Set {
    documents: BTreeMap<String, Vec<u8>>,
    pub(crate) cases: Vec<(Case, Verdict)>,
}

impl Set {
    pub(crate) fn add(&mut self, file: &str, document: Vec<u8>, question: Question, name: &'static str, line: usize) {
        if let Some(other) = self.documents.insert(file.to_owned(), document.clone()) {
            assert!(other == document, "two documents are called {file}");
        }
        let case = Case { file: file.to_owned(), document, question };
        self.cases.push((case, Verdict { name, line, says: String::new() }));
    }

    /// All files with their bytes.
    fn files(&self) -> BTreeMap<String, Vec<u8>> {
        let cases = self.cases.iter().map(|(case, verdict)| match case.question {
            Question::Body { .. } => format!("{} {}\n", case.line(), verdict.name),
            _ => format!("{} {} {}\n", case.line(), verdict.name, verdict.line),
        });
        let hex = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02x}")).collect::<String>();
        let signatures: BTreeSet<String> = self
            .cases
            .iter()
            .flat_map(|(case, _)| {
                let bytes = case.signatures();
                let lines = bytes
                    .chunks(128)
                    .map(|all| format!("{} {} {}\n", hex(&all[..32]), hex(&all[32..64]), hex(&all[64..])));
                lines.collect::<Vec<_>>()
            })
            .collect();
        let mut files = self.documents.clone();
        files.insert("cases.txt".to_owned(), (CASES_HEAD.to_owned() + &cases.collect::<String>()).into_bytes());
        let signatures: String = signatures.into_iter().collect();
        files.insert("signatures.txt".to_owned(), (SIGNATURES_HEAD.to_owned() + &signatures).into_bytes());
        let roots: String = pinned_roots().iter().map(|root| format!("{root}\n")).collect();
        let roots = "# The root keys of the device's manufacture.\n".to_owned() + &roots;
        files.insert("roots.txt".to_owned(), roots.into_bytes());
        files.insert(".gitattributes".to_owned(), ATTRIBUTES.as_bytes().to_vec());
        files
    }

    /// Writes all files into an empty folder.
    pub(crate) fn write(&self, folder: &Path) {
        if folder.exists() {
            fs::remove_dir_all(folder).unwrap();
        }
        for (name, bytes) in self.files() {
            let path = folder.join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, bytes).unwrap();
        }
    }

    /// Compares the committed files with these, and returns their size.
    pub(crate) fn compare(&self, folder: &Path) -> usize {
        let files = self.files();
        let mut committed = Vec::new();
        names(folder, folder, &mut committed);
        committed.sort();
        assert_eq!(committed, files.keys().map(PathBuf::from).collect::<Vec<_>>(), "{} writes them", crate::WRITE);
        for (name, bytes) in &files {
            assert!(fs::read(folder.join(name)).unwrap() == *bytes, "{name}: {} writes new vectors", crate::WRITE);
        }
        files.values().map(Vec::len).sum()
    }
}

/// The files below a folder, relative to `root`.
fn names(root: &Path, folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            names(root, &path, found);
        } else {
            found.push(path.strip_prefix(root).unwrap().to_owned());
        }
    }
}

/// All vectors.
pub(crate) fn all() -> Set {
    let mut set = Set::default();
    first_keyrings(&mut set);
    next_keyrings(&mut set);
    manifests_of_keys(&mut set);
    manifests_in_time(&mut set);
    other_manifests(&mut set);
    bodies(&mut set);
    malformed::manifests(&mut set);
    malformed::keyrings(&mut set);
    set
}

/// The device's keyring.
pub(crate) fn known() -> Known {
    Known { name: "first.keyring".to_owned(), document: signed_keyring(&keyring(), &[ROOT]) }
}

/// The device's keyring, if its root key has moved.
fn moved() -> Known {
    let keyring = Keyring { version: 4, roots: vec![public(NEW_ROOT)], ..keyring() };
    Known { name: "moved.keyring".to_owned(), document: signed_keyring(&keyring, &[ROOT, NEW_ROOT]) }
}

pub(crate) fn of_keyring(known: &Known, now: &str) -> Question {
    Question::Keyring { known: known.clone(), now: clock(now) }
}

pub(crate) fn of_manifest(known: &Known, now: &str, wanted: &Wanted) -> Question {
    Question::Manifest { known: known.clone(), now: clock(now), wanted: wanted.clone() }
}

/// A time, a time with a + behind it, or `none`.
fn clock(now: &str) -> Clock {
    match now.strip_suffix('+') {
        Some(bound) => Clock::AtLeast(unix_s(bound)),
        None if now == "none" => Clock::None,
        None => Clock::At(unix_s(now)),
    }
}

pub(crate) fn wanted() -> Wanted {
    wanted_of(&manifest())
}

/// A keyring with eight keys of each kind.
fn largest_keyring() -> Vec<u8> {
    let seeds = |from: u8| (from..from + 8).map(public).collect();
    let keys = (20..28).map(|seed| listed(seed, "2026-11-01T00:00:00Z", "2027-11-01T00:00:00Z"));
    let largest = Keyring { version: u32::MAX, roots: seeds(1), keys: keys.collect(), revoked: seeds(30), ..keyring() };
    signed_keyring(&largest, &[8, 7, 6, 5, 4, 3, 2, 1])
}

/// Keyrings for a device that has only the root keys of its manufacture.
fn first_keyrings(set: &mut Set) {
    let pinned = Known::pinned();
    let first = known().document;
    for (now, verdict) in [
        (NOW, "trusted"),
        ("2026-10-31T23:59:59Z", "keyring_not_yet"),
        ("2026-11-01T00:00:00Z", "trusted"),
        ("2026-12-30T23:59:59Z", "trusted"),
        ("2026-12-31T00:00:00Z", "keyring_expired"),
        ("none", "trusted"),
        ("2026-10-31T23:59:59Z+", "trusted"),
        ("2026-12-30T23:59:59Z+", "trusted"),
        ("2026-12-31T00:00:00Z+", "keyring_expired"),
    ] {
        set.add("first.keyring", first.clone(), of_keyring(&pinned, now), verdict, 0);
    }
    let mut add = |file: &str, document, verdict| set.add(file, document, of_keyring(&pinned, NOW), verdict, 0);
    add("moved.keyring", moved().document, "trusted");
    add("largest.keyring", largest_keyring(), "trusted");
    let bare = Keyring { version: 0, roots: vec![], keys: vec![], revoked: vec![], ..keyring() };
    add("bare.keyring", signed_keyring(&bare, &[ROOT]), "trusted");
    let leap = Keyring {
        keys: vec![
            listed(SIGNER, "2000-02-29T00:00:00Z", "2028-02-29T23:59:59Z"),
            listed(EARLY, "1970-01-01T00:00:00Z", "2100-03-01T00:00:00Z"),
            listed(EARLY, "9999-12-31T23:59:59Z", "1970-01-01T00:00:00Z"),
        ],
        ..keyring()
    };
    add("leap-years.keyring", signed_keyring(&leap, &[ROOT]), "trusted");
    add("second-signature.keyring", signed_keyring(&keyring(), &[STRANGER, ROOT]), "trusted");
    add("stranger.keyring", signed_keyring(&keyring(), &[STRANGER]), "keyring_wrong_signature");
    add("signed-by-a-listed-key.keyring", signed_keyring(&keyring(), &[SIGNER]), "keyring_wrong_signature");
    let text = String::from_utf8(first).unwrap();
    let added = text.replacen("\nkey ", &format!("\nroot {}\nkey ", public(STRANGER)), 1);
    add("added-root.keyring", added.into_bytes(), "keyring_wrong_signature");
    // The signature of one version under the lines of another.
    let other = String::from_utf8(signed_keyring(&Keyring { version: 2, ..keyring() }, &[ROOT])).unwrap();
    let mixed = text.split("signature").next().unwrap().to_owned() + &other[other.find("signature").unwrap()..];
    add("mixed.keyring", mixed.into_bytes(), "keyring_wrong_signature");
    // The signature is the root's, but stands under another name.
    let renamed = text.replace(&format!("signature {}", public(ROOT)), &format!("signature {}", public(SIGNER)));
    add("signature-of-another-root.keyring", renamed.into_bytes(), "keyring_wrong_signature");
    add("flipped.keyring", flipped(&text), "keyring_wrong_signature");
}

/// The document with another digit at the end of its last signature.
fn flipped(text: &str) -> Vec<u8> {
    let at = text.len() - 2;
    let digit = if &text[at..=at] == "0" { "1" } else { "0" };
    (text[..at].to_owned() + digit + "\n").into_bytes()
}

/// Keyrings for a device that has one.
fn next_keyrings(set: &mut Set) {
    let (known, moved) = (known(), moved());
    let of = |version: u32| Keyring { version, ..keyring() };
    let mut add = |file: &str, known: &Known, now: &str, document, verdict| {
        set.add(file, document, of_keyring(known, now), verdict, 0)
    };
    add("first.keyring", &known, NOW, known.document.clone(), "trusted");
    add("next.keyring", &known, NOW, signed_keyring(&of(4), &[ROOT]), "trusted");
    add("older.keyring", &known, NOW, signed_keyring(&of(2), &[ROOT]), "keyring_older");
    add("older.keyring", &Known::pinned(), NOW, signed_keyring(&of(2), &[ROOT]), "trusted");
    let with_key = |change: &dyn Fn(&mut ListedKey)| {
        let mut keys = keyring().keys;
        change(&mut keys[1]);
        Keyring { keys, ..keyring() }
    };
    let different: [(&str, Keyring); 9] = [
        ("root", Keyring { roots: vec![public(NEW_ROOT)], ..keyring() }),
        ("fewer-keys", Keyring { keys: vec![], ..keyring() }),
        ("fewer-revoked", Keyring { revoked: vec![public(REVOKED)], ..keyring() }),
        ("revoked", Keyring { revoked: vec![public(REVOKED), public(STRANGER)], ..keyring() }),
        ("issued", Keyring { issued: time("2026-11-01T00:00:01Z"), ..keyring() }),
        ("expires", Keyring { expires: time("2026-12-31T00:00:01Z"), ..keyring() }),
        ("key", with_key(&|key| key.key = public(STRANGER))),
        ("key-from", with_key(&|key| key.from = time("2026-12-01T00:00:01Z"))),
        ("key-until", with_key(&|key| key.until = time("2027-11-01T00:00:01Z"))),
    ];
    for (name, keyring) in different {
        let document = signed_keyring(&keyring, &[ROOT]);
        add(&format!("different-{name}.keyring"), &known, NOW, document, "keyring_different");
    }
    add("moved.keyring", &known, NOW, moved.document.clone(), "trusted");
    let after = Keyring { version: 5, roots: vec![public(NEW_ROOT)], ..keyring() };
    add("after-the-move.keyring", &moved, NOW, signed_keyring(&after, &[NEW_ROOT]), "trusted");
    add("after-the-move.keyring", &known, NOW, signed_keyring(&after, &[NEW_ROOT]), "keyring_wrong_signature");
    add("old-root-after-the-move.keyring", &moved, NOW, signed_keyring(&of(5), &[ROOT]), "keyring_wrong_signature");
    // Each of several root keys may sign, and one right signature is enough.
    let two = Keyring { roots: vec![public(NEW_ROOT), public(ROOT)], ..of(4) };
    let two = Known { name: "two-roots.keyring".to_owned(), document: signed_keyring(&two, &[ROOT]) };
    add("two-roots.keyring", &known, NOW, two.document.clone(), "trusted");
    add("after-two-roots.keyring", &two, NOW, signed_keyring(&of(5), &[ROOT]), "trusted");
    add("signed-twice.keyring", &two, NOW, signed_keyring(&of(5), &[NEW_ROOT, ROOT]), "trusted");
    let text = String::from_utf8(signed_keyring(&of(5), &[ROOT, NEW_ROOT])).unwrap();
    let second = text.replace(&format!("signature {} ", public(ROOT)), &format!("signature {} ", public(NEW_ROOT)));
    add("first-signature-wrong.keyring", &two, NOW, second.into_bytes(), "trusted");
    // The device slept: its own keyring has expired, and still leads to the present one.
    let present = Keyring { issued: time("2027-10-01T00:00:00Z"), expires: time("2027-12-31T00:00:00Z"), ..of(8) };
    add("a-year-later.keyring", &known, "2027-11-24T00:00:00Z", signed_keyring(&present, &[ROOT]), "trusted");
    add("a-year-later.keyring", &known, NOW, signed_keyring(&present, &[ROOT]), "keyring_not_yet");
    // An older keyring is refused for its version, whatever the time.
    let late = "2027-11-24T00:00:00Z";
    add("older.keyring", &known, late, signed_keyring(&of(2), &[ROOT]), "keyring_older");
    add("older.keyring", &known, "none", signed_keyring(&of(2), &[ROOT]), "keyring_older");
}

/// Manifests whose keys or signatures decide.
fn manifests_of_keys(set: &mut Set) {
    let known = known();
    let by = |seed: u8| manifest().signed(&key(seed)).into_bytes();
    let mut add = |file: &str, known: &Known, now: &str, document, verdict| {
        set.add(file, document, of_manifest(known, now, &wanted()), verdict, 0);
    };
    add("good.manifest", &known, NOW, by(SIGNER), "trusted");
    add("good.manifest", &known, "none", by(SIGNER), "trusted");
    add("good.manifest", &Known::pinned(), NOW, by(SIGNER), "key_unknown");
    add("good.manifest", &moved(), NOW, by(SIGNER), "trusted");
    add("unknown-key.manifest", &known, NOW, by(STRANGER), "key_unknown");
    add("signed-by-root.manifest", &known, NOW, by(ROOT), "key_unknown");
    add("revoked-key.manifest", &known, NOW, by(REVOKED), "key_revoked");
    add("revoked-key.manifest", &known, "none", by(REVOKED), "key_revoked");
    add("revoked-key-not-listed.manifest", &known, NOW, by(GONE), "key_revoked");
    add("early-key.manifest", &known, NOW, by(EARLY), "key_not_yet");
    add("early-key.manifest", &known, "2026-11-30T23:59:59Z", by(EARLY), "key_not_yet");
    add("late-key.manifest", &known, NOW, by(LATE), "key_expired");
    // It was issued after the end of its key.
    add("late-key.manifest", &known, "none", by(LATE), "key_expired");
    add("late-key.manifest", &known, "2026-11-20T00:00:00Z+", by(LATE), "key_expired");
    add("early-key.manifest", &known, "2026-11-24T00:00:00Z+", by(EARLY), "trusted");
    let good = String::from_utf8(by(SIGNER)).unwrap();
    add("flipped.manifest", &known, NOW, flipped(&good), "manifest_wrong_signature");
    let zeros = good.split("signature").next().unwrap().to_owned() + "signature " + &"0".repeat(128) + "\n";
    add("zeros.manifest", &known, NOW, zeros.into_bytes(), "manifest_wrong_signature");
    // Lines of two versions under one signature.
    let other = Manifest { version: 13, digest: digest(b"another file"), size_bytes: 12, ..manifest() };
    let other = other.signed(&key(SIGNER));
    let of = |text: &str, name: &str| text.lines().find(|line| line.starts_with(name)).unwrap().to_owned();
    for name in ["version", "digest", "size_bytes", "signature"] {
        let mixed = good.replace(&of(&good, name), &of(&other, name));
        add(&format!("mixed-{name}.manifest"), &known, NOW, mixed.into_bytes(), "manifest_wrong_signature");
    }
    // The signature is right for the key that signed, but the line names another.
    let renamed = good.replace(&public(SIGNER).id(), &public(EARLY).id());
    add("names-another-key.manifest", &known, "2026-12-01T00:00:00Z", renamed.into_bytes(), "manifest_wrong_signature");
}

/// Manifests and keyrings whose times decide.
fn manifests_in_time(set: &mut Set) {
    let known = known();
    let good = manifest().signed(&key(SIGNER)).into_bytes();
    for (now, verdict) in [
        ("2026-11-23T17:59:59Z", "manifest_not_yet"),
        ("2026-11-23T18:00:00Z", "trusted"),
        ("2026-11-30T17:59:59Z", "trusted"),
        ("2026-11-30T18:00:00Z", "manifest_expired"),
        ("2026-12-31T00:00:00Z", "keyring_expired"),
        ("2026-10-31T23:59:59Z", "keyring_not_yet"),
        ("1970-01-01T00:00:00Z", "keyring_not_yet"),
        ("1970-01-01T00:00:00Z+", "trusted"),
        ("2026-11-30T17:59:59Z+", "trusted"),
        ("2026-11-30T18:00:00Z+", "manifest_expired"),
        ("2026-12-31T00:00:00Z+", "keyring_expired"),
        ("9999-12-31T23:59:59Z+", "keyring_expired"),
    ] {
        set.add("good.manifest", good.clone(), of_manifest(&known, now, &wanted()), verdict, 0);
    }
    // Without a clock, no key can name a time after the end of its keyring.
    let far = Manifest { issued: time("2026-12-31T00:00:00Z"), expires: time("9999-12-31T23:59:59Z"), ..manifest() };
    let far = far.signed(&key(SIGNER)).into_bytes();
    set.add("issued-late.manifest", far, of_manifest(&known, "none", &wanted()), "keyring_expired", 0);
    // A clock that fails with -1 is no missing clock.
    for (now, verdict) in [(-1, "keyring_not_yet"), (i64::MAX, "keyring_expired")] {
        let question = Question::Manifest { known: known.clone(), now: Clock::At(now), wanted: wanted() };
        set.add("good.manifest", good.clone(), question, verdict, 0);
    }
}

/// Manifests about something else, and unusual ones.
fn other_manifests(set: &mut Set) {
    let known = known();
    let good = manifest().signed(&key(SIGNER)).into_bytes();
    for (other, verdict) in [
        (Wanted { generation: 0, ..wanted() }, "trusted"),
        (Wanted { generation: 7, ..wanted() }, "trusted"),
        (Wanted { generation: 8, ..wanted() }, "lower_generation"),
        (Wanted { generation: u64::MAX, ..wanted() }, "lower_generation"),
        (Wanted { display: "venus".to_owned(), ..wanted() }, "other_display"),
        (Wanted { display: "pluto2".to_owned(), ..wanted() }, "other_display"),
        (Wanted { display: "plut".to_owned(), ..wanted() }, "other_display"),
        (Wanted { display: "Pluto".to_owned(), ..wanted() }, "other_display"),
        (Wanted { optics: Optics::at_distance(515_001, 150_000_000), ..wanted() }, "other_optics"),
        (Wanted { optics: Optics::at_distance(515_000, -150_000_000), ..wanted() }, "other_optics"),
        (Wanted { optics: new_optics(), ..wanted() }, "other_optics"),
        (Wanted { format: "f16".to_owned(), ..wanted() }, "other_format"),
    ] {
        set.add("good.manifest", good.clone(), of_manifest(&known, NOW, &other), verdict, 0);
    }
    let mut add = |file: &str, manifest: &Manifest, verdict| {
        let document = manifest.signed(&key(SIGNER)).into_bytes();
        set.add(file, document, of_manifest(&known, NOW, &wanted_of(manifest)), verdict, 0);
    };
    add("extreme.manifest", &extreme_manifest(), "trusted");
    // A device trusts places of kinds that it does not know.
    add("another-kind-of-place.manifest", &Manifest { optics: new_optics(), ..manifest() }, "trusted");
    add("interpolated.manifest", &Manifest { interpolated: true, ..manifest() }, "trusted");
    add("largest.manifest", &manifest_of(DOCUMENT_BYTES_MAX), "trusted");
    add("too-large.manifest", &manifest_of(DOCUMENT_BYTES_MAX + 1), "document_too_large");
}

/// Files.
fn bodies(set: &mut Set) {
    let question = || Question::Body { size_bytes: body().len() as u64, digest: digest(&body()) };
    let mut add = |file: &str, bytes, verdict| set.add(file, bytes, question(), verdict, 0);
    let mut corrupt = body();
    corrupt[123] ^= 4;
    add("good.body", body(), "trusted");
    add("corrupt.body", corrupt, "body_corrupt");
    add("longer.body", [body(), vec![0]].concat(), "body_longer");
    add("much-longer.body", [body(), body(), body()].concat(), "body_longer");
    add("shorter.body", body()[..199].to_vec(), "body_shorter");
    add("empty.body", Vec::new(), "body_shorter");
    let near = digest(&body())[..70].to_owned() + if digest(&body()).ends_with('0') { "1" } else { "0" };
    let near = Question::Body { size_bytes: body().len() as u64, digest: near };
    set.add("good.body", body(), near, "body_corrupt", 0);
    let nothing = Question::Body { size_bytes: 0, digest: digest(b"") };
    set.add("empty.body", Vec::new(), nothing, "trusted", 0);
}
