//! The import rules of the architecture: an absence that nobody watches does not last.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Every crate with those of ours that it may depend on. Cargo enforces the rest.
const CRATES: [(&str, &[&str]); 14] = [
    ("optics", &[]),
    ("proto", &[]),
    ("client", &["proto"]),
    ("server/domain", &["optics"]),
    ("server/fail-points", &[]),
    ("server/fixtures", &["domain"]),
    ("server/store", &["domain", "fail-points"]),
    ("server/artifacts", &["fail-points"]),
    ("server/media", &["artifacts", "domain", "optics"]),
    ("server/metrics", &["artifacts", "domain", "store"]),
    ("server/worker", &["artifacts", "domain", "media", "metrics", "optics", "store"]),
    ("server/api", &["artifacts", "domain", "fail-points", "media", "metrics", "optics", "proto", "store"]),
    (
        "server/daemon",
        &["", "api", "artifacts", "domain", "fail-points", "media", "metrics", "optics", "proto", "store", "worker"],
    ),
    ("tests", &[]),
];
/// Dependencies that only some crates may have, each with those crates.
const KEEPERS: [(&str, &[&str]); 6] = [
    ("sqlx", &["server/store", "server/fixtures"]),
    ("tonic", &["proto", "client", "server/api", "server/daemon"]),
    ("prost", &["proto", "client", "server/api"]),
    ("axum", &["server/api"]),
    ("tokio", &["client", "server/artifacts", "server/store", "server/worker", "server/api", "server/daemon"]),
    ("object_store", &[]),
];

#[test]
fn crates_depend_only_on_those_they_may() {
    for (name, ours) in CRATES {
        let dependencies = dependencies(name);
        let allowed: BTreeSet<_> =
            ours.iter().map(|it| format!("lightpath-{it}").trim_end_matches('-').to_owned()).collect();
        let used: BTreeSet<_> = dependencies.iter().filter(|it| it.starts_with("lightpath")).cloned().collect();
        assert!(used.is_subset(&allowed), "{name} depends on {used:?}, but may only on {allowed:?}");
        for (family, keepers) in KEEPERS {
            let kept = keepers.contains(&name) || !dependencies.iter().any(|dependency| is_family(dependency, family));
            assert!(kept, "{name} depends on {family}, which is for {keepers:?}");
        }
    }
}

#[test]
fn every_crate_has_a_line() {
    let manifest: toml::Table = std::fs::read_to_string(root().join("Cargo.toml")).unwrap().parse().unwrap();
    let members = manifest["workspace"]["members"].as_array().unwrap().iter();
    let members: BTreeSet<_> = members.map(|member| member.as_str().unwrap()).collect();
    assert_eq!(members, CRATES.iter().map(|(name, _)| *name).collect());
}

#[test]
fn optics_and_domain_know_no_files_no_sockets_no_clock() {
    let mut broken = Vec::new();
    for folder in ["optics/src", "server/domain/src"] {
        for (path, source) in sources(folder) {
            for unwanted in ["std::fs", "std::net", "std::process", "std::env", "std::time::SystemTime"] {
                if mentions(&source, unwanted) {
                    broken.push(format!("{folder}/{}: {unwanted}", path.display()));
                }
            }
        }
    }
    assert!(broken.is_empty(), "{broken:#?}");
}

#[test]
fn in_the_daemon_only_the_assembly_and_the_demo_speak_the_wire() {
    let mut broken = Vec::new();
    for (path, source) in sources("server/daemon/src") {
        let assembles = path.starts_with("server.rs") || path.starts_with("demo");
        for unwanted in ["lightpath_proto", "lightpath::v1", "tonic", "lightpath::"] {
            if !assembles && mentions(&source, unwanted) {
                broken.push(format!("server/daemon/src/{}: {unwanted}", path.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{broken:#?}");
}

#[test]
fn the_check_finds_what_it_looks_for() {
    for (source, found) in [
        ("use sqlx::Row;", true),
        ("    sqlx::query(\"x\")", true),
        ("use {std::fmt, sqlx::Row};", true),
        ("pub use sqlx as database;", true),
        ("// use sqlx::Row;", false),
        ("/// see sqlx::Row", false),
        ("let my_sqlx = 1;", false),
        ("let x = my_sqlx::f();", false),
        ("let text = \"sqlx::Row\";", false),
    ] {
        assert_eq!(mentions(&strip(source), "sqlx"), found, "{source}");
    }
    for (source, found) in [
        ("use crate::store::Store;", true),
        ("use crate::{api, store::Store};", true),
        ("use crate::{api::{x, y}, job};", false),
        ("use crate::storey::X;", false),
        ("use std::{fmt, fs};", false),
    ] {
        assert_eq!(mentions(&strip(source), "crate::store"), found, "{source}");
    }
    assert!(mentions("use std::{fmt, fs};", "std::fs"));
    assert!(mentions("use tonic_types::StatusExt;", "tonic"), "a crate stands for its family");
}

/// Names in the `[dependencies]` of a crate.
fn dependencies(name: &str) -> BTreeSet<String> {
    let text = std::fs::read_to_string(root().join(name).join("Cargo.toml")).unwrap();
    let manifest: toml::Table = text.parse().unwrap();
    manifest
        .get("dependencies")
        .and_then(toml::Value::as_table)
        .into_iter()
        .flat_map(toml::Table::keys)
        .cloned()
        .collect()
}

/// The sources below a folder, without comments and string literals; paths from that folder on.
fn sources(folder: &str) -> Vec<(PathBuf, String)> {
    fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                walk(&path, found);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                found.push(path);
            }
        }
    }
    let folder = root().join(folder);
    let mut found = Vec::new();
    walk(&folder, &mut found);
    assert!(!found.is_empty(), "{} has no sources", folder.display());
    let read = |path: PathBuf| {
        let source = strip(&std::fs::read_to_string(&path).unwrap());
        (path.strip_prefix(&folder).unwrap().to_owned(), source)
    };
    found.into_iter().map(read).collect()
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

/// The source without line comments and the insides of plain string literals on one line.
fn strip(source: &str) -> String {
    let mut stripped = String::new();
    for line in source.lines() {
        let (mut in_string, mut escaped, mut before) = (false, false, ' ');
        for (index, character) in line.char_indices() {
            match character {
                _ if escaped => escaped = false,
                '\\' if in_string => escaped = true,
                // A quote as a character literal opens no string.
                '"' if before != '\'' => in_string = !in_string,
                '/' if !in_string && line[index..].starts_with("//") => break,
                _ if !in_string => stripped.push(character),
                _ => {}
            }
            before = character;
        }
        stripped.push('\n');
    }
    stripped
}

/// The source names the path, alone or in a group: `use std::{fmt, fs}` names `std::fs`.
fn mentions(source: &str, path: &str) -> bool {
    let named = |text: &str, path: &str| {
        text.match_indices(path).any(|(start, _)| {
            let before = text[..start].chars().next_back();
            let after = text[start + path.len()..].chars().next();
            let starts = before.is_none_or(|c| !(c.is_alphanumeric() || c == '_' || c == ':'));
            // `tonic` stands for `tonic_types`, too; `lightpath::` and `crate::store` only for themselves.
            let ends =
                path.ends_with(':') || after.is_none_or(|c| !c.is_alphanumeric() && (c != '_' || !path.contains("::")));
            starts && ends && (path.contains("::") || is_path(text, start, path))
        })
    };
    if named(source, path) {
        return true;
    }
    let Some((parent, child)) = path.rsplit_once("::").filter(|(_, child)| !child.is_empty()) else { return false };
    groups(source, parent).iter().any(|group| top_level(group).iter().any(|item| first_name(item) == child))
}

/// A crate's name counts in a path or an import, not as a variable.
fn is_path(text: &str, start: usize, path: &str) -> bool {
    let name_end = text[start..].find(|c: char| !(c.is_alphanumeric() || c == '_')).map_or(text.len(), |i| start + i);
    let family = &text[start..name_end];
    let line_start = text[..start].rfind('\n').map_or(0, |i| i + 1);
    let imported = text[line_start..start].trim_start();
    is_family(family, path)
        && (text[name_end..].starts_with("::") || imported.starts_with("use ") || imported.starts_with("pub use "))
}

/// `tonic-types` and `tonic_types` belong to `tonic`.
fn is_family(name: &str, family: &str) -> bool {
    name.strip_prefix(family).is_some_and(|rest| rest.is_empty() || rest.starts_with(['-', '_']))
}

/// What stands between the braces of each `parent::{…}`.
fn groups<'a>(source: &'a str, parent: &str) -> Vec<&'a str> {
    let opening = format!("{parent}::{{");
    source.match_indices(&opening).map(|(start, _)| inside(&source[start + opening.len()..])).collect()
}

/// Up to the brace that closes the group.
fn inside(text: &str) -> &str {
    let mut depth = 1;
    let end = text.find(|c| {
        depth += i32::from(c == '{') - i32::from(c == '}');
        depth == 0
    });
    &text[..end.unwrap_or(text.len())]
}

/// The parts of a group, whatever they hold.
fn top_level(group: &str) -> Vec<&str> {
    let mut depth = 0;
    group
        .split(move |c| {
            depth += i32::from(c == '{') - i32::from(c == '}');
            c == ',' && depth == 0
        })
        .collect()
}

fn first_name(item: &str) -> &str {
    let item = item.trim();
    item.split(|c: char| !(c.is_alphanumeric() || c == '_')).next().unwrap_or(item)
}
