//! Lists of pairs, from manifests or from two folders matched by file name.

use crate::destination::name_of;
use crate::failure::Failure;
use crate::inputs::{self, PICTURES, has_extension, paths_in};
use lightpath::Words as _;
use lightpath::v1::Split;
use serde::{Deserialize, Deserializer, de};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Most names that an error message lists.
const SHOWN_MAX: usize = 5;

/// A pair of hologram and photograph in a list.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Entry {
    pub(super) id: String,
    pub(super) pattern: PathBuf,
    pub(super) photo: PathBuf,
    #[serde(default, deserialize_with = "split_or_none")]
    pub(super) split: Option<Split>,
    pub(super) black_level: Option<f64>,
    pub(super) exposure_s: Option<f64>,
    pub(super) camera_gain: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    black_level: Option<f64>,
    exposure_s: Option<f64>,
    camera_gain: Option<f64>,
    pairs: Vec<Entry>,
}

impl Entry {
    pub(super) fn new(id: String, pattern: PathBuf, photo: PathBuf) -> Self {
        Self { id, pattern, photo, split: None, black_level: None, exposure_s: None, camera_gain: None }
    }
}

/// Parses the split of a pair.
fn split(word: &str) -> Result<Split, String> {
    let given = Split::from_word(word).filter(|split| matches!(split, Split::Train | Split::Validation | Split::Test));
    given.ok_or_else(|| format!("split is \"{word}\", but must be train, validation or test"))
}

fn split_or_none<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Split>, D::Error> {
    let word = Option::<String>::deserialize(deserializer)?;
    word.map(|word| split(&word).map_err(de::Error::custom)).transpose()
}

/// Reads the pairs of a manifest. Their paths are relative to the manifest's folder in the file, and to the working
/// folder in the result.
pub(super) fn read(path: &Path) -> Result<Vec<Entry>, Failure> {
    let text = inputs::text(path)?;
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let manifest = parse(&extension, &text)
        .map_err(|problem| Failure::Usage(format!("--manifest {}: {problem}", path.display())))?;
    if manifest.pairs.is_empty() {
        return Err(Failure::Usage(format!("--manifest {}: the file lists no pairs", path.display())));
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let complete = |entry: Entry| Entry {
        pattern: folder.join(&entry.pattern),
        photo: folder.join(&entry.photo),
        black_level: entry.black_level.or(manifest.black_level),
        exposure_s: entry.exposure_s.or(manifest.exposure_s),
        camera_gain: entry.camera_gain.or(manifest.camera_gain),
        ..entry
    };
    Ok(manifest.pairs.into_iter().map(complete).collect())
}

fn parse(extension: &str, text: &str) -> Result<Manifest, String> {
    match extension {
        "toml" => toml::from_str(text).map_err(|error| error.to_string()),
        "json" => serde_json::from_str(text).map_err(|error| error.to_string()),
        "csv" => table(text),
        other => Err(format!("the file name ends with \".{other}\", but must end with .toml, .json or .csv")),
    }
}

/// Pairs each hologram with the photograph of the same name. A name that occurs in only one folder is an error.
pub(super) fn match_folders(phases: &Path, photos: &Path) -> Result<Vec<Entry>, Failure> {
    let (mut holograms, mut photographs) = (pictures(phases)?, pictures(photos)?);
    let entries: Vec<Entry> = holograms
        .keys()
        .cloned()
        .collect::<Vec<_>>()
        .into_iter()
        .filter_map(|name| {
            let photo = photographs.remove(&name)?;
            Some(Entry::new(name.clone(), holograms.remove(&name)?, photo))
        })
        .collect();
    for (unmatched, folder, other_folder) in [(&holograms, phases, photos), (&photographs, photos, phases)] {
        if !unmatched.is_empty() {
            let shown: Vec<&str> = unmatched.keys().take(SHOWN_MAX).map(String::as_str).collect();
            return Err(Failure::Usage(format!(
                "{} files in {} have no file of the same name in {}: {}{}; rename them, or list the pairs in a --manifest",
                unmatched.len(),
                folder.display(),
                other_folder.display(),
                shown.join(", "),
                if unmatched.len() > SHOWN_MAX { ", …" } else { "" },
            )));
        }
    }
    if entries.is_empty() {
        return Err(Failure::Usage(format!("there are no pictures in {}", phases.display())));
    }
    Ok(entries)
}

/// The pictures of a folder, by file name without extension.
fn pictures(folder: &Path) -> Result<BTreeMap<String, PathBuf>, Failure> {
    let mut found = BTreeMap::new();
    for path in paths_in(folder)?.into_iter().filter(|path| has_extension(path, PICTURES)) {
        if let Some(other) = found.insert(name_of(&path), path.clone()) {
            let (a, b) = (other.display(), path.display());
            return Err(Failure::Usage(format!("{a} and {b} have the same name; list the pairs in a --manifest")));
        }
    }
    Ok(found)
}

/// Parses comma-separated values: a line of names, then a line for each pair. Fields may be quoted; a doubled quote
/// inside a quoted field stands for one quote.
fn table(text: &str) -> Result<Manifest, String> {
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let (_, first) = lines.next().ok_or("the file is empty")?;
    let names = fields(first);
    const KNOWN: [&str; 7] = ["id", "pattern", "photo", "split", "black_level", "exposure_s", "camera_gain"];
    if let Some(unknown) = names.iter().find(|name| !KNOWN.contains(&name.as_str())) {
        return Err(format!(
            "the first line has the unknown column \"{unknown}\"; the columns are {}",
            KNOWN.join(", ")
        ));
    }
    let pairs = lines
        .map(|(number, line)| entry(&names, &fields(line)).map_err(|error| format!("line {}: {error}", number + 1)));
    Ok(Manifest { black_level: None, exposure_s: None, camera_gain: None, pairs: pairs.collect::<Result<_, _>>()? })
}

/// Converts the fields of a line into a pair.
fn entry(names: &[String], fields: &[String]) -> Result<Entry, String> {
    if fields.len() != names.len() {
        return Err(format!("the line has {} fields, but the first line has {}", fields.len(), names.len()));
    }
    let field = |name: &str| {
        let value = names.iter().position(|known| known == name).map(|i| fields[i].as_str());
        value.filter(|value| !value.is_empty())
    };
    let required = |name: &str| field(name).map(str::to_owned).ok_or_else(|| format!("the line has no {name}"));
    let number = |name: &str| {
        let parsed = field(name)
            .map(|text| text.parse::<f64>().map_err(|_| format!("{name} is \"{text}\", but must be a number")));
        parsed.transpose()
    };
    let split = field("split").map(split).transpose()?;
    Ok(Entry {
        id: required("id")?,
        pattern: required("pattern")?.into(),
        photo: required("photo")?.into(),
        split,
        black_level: number("black_level")?,
        exposure_s: number("exposure_s")?,
        camera_gain: number("camera_gain")?,
    })
}

/// The fields of a line of comma-separated values.
fn fields(line: &str) -> Vec<String> {
    let (mut fields, mut field, mut quoted) = (Vec::new(), String::new(), false);
    let mut characters = line.trim_end_matches('\r').chars().peekable();
    while let Some(character) = characters.next() {
        match character {
            '"' if quoted && characters.peek() == Some(&'"') => {
                characters.next();
                field.push('"');
            }
            '"' => quoted = !quoted,
            ',' if !quoted => fields.push(std::mem::take(&mut field).trim().to_owned()),
            other => field.push(other),
        }
    }
    fields.push(field.trim().to_owned());
    fields
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{DAMAGED, damaged};

    fn message(result: Result<Vec<Entry>, Failure>) -> String {
        match result {
            Err(Failure::Usage(text)) => text,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn all_manifest_formats_give_the_same_pairs() {
        let folder = tempfile::tempdir().unwrap();
        let toml =
            "exposure_s = 0.02\n[[pairs]]\nid = \"a,1\"\npattern = \"p.png\"\nphoto = \"c.tif\"\nsplit = \"test\"\n";
        let json =
            r#"{"exposure_s": 0.02, "pairs": [{"id": "a,1", "pattern": "p.png", "photo": "c.tif", "split": "test"}]}"#;
        let csv = "id,pattern,photo,split,exposure_s\r\n\"a,1\", p.png ,c.tif,test,0.02\r\n\r\n";
        for (name, text) in [("m.toml", toml), ("m.json", json), ("m.csv", csv)] {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            let entries = read(&path).unwrap();
            assert_eq!(
                (entries.len(), entries[0].id.as_str(), entries[0].exposure_s),
                (1, "a,1", Some(0.02)),
                "{name}"
            );
            assert_eq!(entries[0].photo, folder.path().join("c.tif"));
            assert!(matches!(entries[0].split, Some(Split::Test)));
        }
    }

    #[test]
    fn damaged_manifests_never_panic_the_parser() {
        for (extension, seed) in [
            (
                "toml",
                "exposure_s = 0.02\n[[pairs]]\nid = \"a\"\npattern = \"p.png\"\nphoto = \"c.tif\"\nsplit = \"test\"\n",
            ),
            ("json", r#"{"pairs": [{"id": "a", "pattern": "p.png", "photo": "c.tif", "camera_gain": 1e3}]}"#),
            ("csv", "id,pattern,photo,split,exposure_s\r\n\"a,1\", p.png ,c.tif,test,0.02\r\nb,q.png,d.tif,,\r\n"),
        ] {
            let accepted = damaged(seed).filter(|text| parse(extension, text).is_ok()).count();
            assert!((1..DAMAGED).contains(&accepted), "{extension}: {accepted} were accepted");
        }
    }

    #[test]
    fn errors_name_the_mistake() {
        let folder = tempfile::tempdir().unwrap();
        for (name, text, sign) in [
            ("a.csv", "id,pattern,foto\n", "\"foto\""),
            ("b.csv", "id,pattern,photo\np1,p.png\n", "line 2: the line has 2 fields"),
            ("c.csv", "id,pattern,photo,exposure_s\np1,p.png,c.png,fast\n", "exposure_s is \"fast\""),
            ("d.toml", "[[pairs]]\nid = \"a\"\npattern = \"p.png\"\nfoto = \"c.png\"\n", "foto"),
            ("e.json", "{\"pairs\": []}", "lists no pairs"),
            ("f.txt", "", ".txt"),
        ] {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            let error = message(read(&path));
            assert!(error.contains(sign) && error.contains(name), "{error}");
        }
    }

    #[test]
    fn folders_are_matched_by_name_and_unmatched_files_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let (phases, photos) = (folder.path().join("phases"), folder.path().join("photos"));
        for (folder, names) in [
            (&phases, ["02.png", "01.png", "notes.txt", "._01.png"]),
            (&photos, ["01.tif", "02.jpg", "x.md", "._02.jpg"]),
        ] {
            std::fs::create_dir(folder).unwrap();
            names.iter().for_each(|name| std::fs::write(folder.join(name), name).unwrap());
        }
        let entries = match_folders(&phases, &photos).unwrap();
        let seen: Vec<_> =
            entries.iter().map(|e| (e.id.as_str(), e.photo.file_name().unwrap().to_str().unwrap())).collect();
        assert_eq!(seen, [("01", "01.tif"), ("02", "02.jpg")]);
        std::fs::write(photos.join("03.png"), "").unwrap();
        let error = message(match_folders(&phases, &photos));
        assert!(error.contains("03") && error.contains("no file of the same name"), "{error}");
        std::fs::remove_file(photos.join("03.png")).unwrap();
        std::fs::write(photos.join("01.png"), "").unwrap();
        assert!(message(match_folders(&phases, &photos)).contains("have the same name"));
    }
}
