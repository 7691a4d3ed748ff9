//! The import rules of the architecture: which crates and modules each crate may use.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Every crate, with the crates of the workspace that it may depend on.
pub(super) const CRATES: [(&str, &[&str]); 29] = [
    ("optics/fft", &[]),
    ("optics", &["fft"]),
    ("optics/bench", &["fft", "optics"]),
    ("optics/camera", &["optics"]),
    ("optics/gpu", &["optics"]),
    ("manifest", &[]),
    ("proto", &[]),
    ("program-docs", &[]),
    ("units", &[]),
    ("client", &["proto", "units"]),
    ("cli", &["", "manifest", "program-docs"]),
    ("client/python/engine", &["bench", "domain", "media", "optics"]),
    ("agent", &["fail-points", "manifest", "program-docs", "units"]),
    ("rig", &["", "bench", "optics", "program-docs", "proto", "units"]),
    ("server/domain", &["bench", "camera", "optics", "units"]),
    ("server/fail-points", &[]),
    ("server/fixtures", &["domain"]),
    ("server/store", &["domain", "fail-points", "units"]),
    ("server/artifacts", &["fail-points"]),
    ("server/media", &["camera", "domain", "optics"]),
    ("server/metrics", &["artifacts", "domain", "store"]),
    ("server/dashboard", &[]),
    ("server/webhooks", &["domain", "metrics", "store"]),
    ("server/rigs", &["domain"]),
    (
        "server/worker",
        &["artifacts", "bench", "camera", "domain", "gpu", "media", "metrics", "optics", "rigs", "store"],
    ),
    ("server/service", &["artifacts", "bench", "camera", "domain", "manifest", "media", "metrics", "optics", "store"]),
    (
        "server/api",
        &[
            "artifacts",
            "bench",
            "camera",
            "dashboard",
            "domain",
            "fail-points",
            "media",
            "metrics",
            "optics",
            "proto",
            "rigs",
            "service",
            "store",
        ],
    ),
    (
        "server/daemon",
        &[
            "",
            "api",
            "artifacts",
            "bench",
            "domain",
            "fail-points",
            "gpu",
            "manifest",
            "media",
            "metrics",
            "optics",
            "program-docs",
            "proto",
            "rigs",
            "service",
            "store",
            "webhooks",
            "worker",
        ],
    ),
    ("tests", &[]),
];
/// External dependencies that only some crates may have, each with these crates.
const RESTRICTED: [(&str, &[&str]); 11] = [
    ("sqlx", &["server/store", "server/fixtures"]),
    ("tonic", &["proto", "client", "server/api", "server/daemon"]),
    ("prost", &["proto", "server/api"]),
    ("axum", &["server/api"]),
    ("pyo3", &["client/python/engine"]),
    ("wgpu", &["optics/gpu"]),
    ("numpy", &["client/python/engine"]),
    (
        "tokio",
        &[
            "client",
            "cli",
            "rig",
            "server/artifacts",
            "server/store",
            "server/rigs",
            "server/webhooks",
            "server/worker",
            "server/service",
            "server/api",
            "server/daemon",
        ],
    ),
    ("object_store", &["server/artifacts"]),
    ("clap", &["program-docs", "cli", "agent", "rig", "server/daemon"]),
    ("indicatif", &["cli", "server/daemon"]),
];

/// The folders and files of `optics/src`, from the ground up, each with those that it may import. All are below it, so
/// none imports one above it, and there is no circle.
const OPTICS: [(&str, &[&str]); 14] = [
    ("interrupt", &[]),
    ("propagation_method", &[]),
    ("error", &["propagation_method"]),
    ("numerics", &["error", "interrupt"]),
    ("diagnostics", &["error", "numerics"]),
    ("metrics", &["error", "interrupt", "numerics"]),
    ("display", &["error", "numerics", "propagation_method"]),
    ("propagation", &["display", "error", "interrupt", "numerics", "propagation_method"]),
    ("reference", &["display", "error", "interrupt", "numerics", "propagation"]),
    ("engine", &["display", "error", "interrupt", "numerics", "propagation", "propagation_method"]),
    ("hologram", &["display", "engine", "error", "interrupt", "metrics", "numerics", "propagation", "reference"]),
    ("learning", &["display", "engine", "error", "interrupt", "numerics", "reference"]),
    ("second_opinion", &["display", "error", "hologram", "interrupt", "numerics", "propagation"]),
    (
        "memory",
        &[
            "display",
            "engine",
            "hologram",
            "learning",
            "numerics",
            "propagation",
            "propagation_method",
            "second_opinion",
        ],
    ),
];

#[test]
fn crates_have_only_allowed_dependencies() {
    for (name, allowed_crates) in CRATES {
        let dependencies = dependencies(name);
        let allowed: BTreeSet<_> =
            allowed_crates.iter().map(|part| format!("lightpath-{part}").trim_end_matches('-').to_owned()).collect();
        let used: BTreeSet<_> =
            dependencies.iter().filter(|dependency| dependency.starts_with("lightpath")).cloned().collect();
        assert!(used.is_subset(&allowed), "{name} depends on {used:?}, but may depend only on {allowed:?}");
        for (family, users) in RESTRICTED {
            let allowed = users.contains(&name) || !dependencies.iter().any(|dependency| is_family(dependency, family));
            assert!(allowed, "{name} depends on {family}, but only {users:?} may");
        }
    }
}

#[test]
fn rules_cover_every_crate_of_the_workspace() {
    let manifest: toml::Table = std::fs::read_to_string(root().join("Cargo.toml")).unwrap().parse().unwrap();
    let members = manifest["workspace"]["members"].as_array().unwrap().iter();
    let members: BTreeSet<_> = members.map(|member| member.as_str().unwrap()).collect();
    assert_eq!(members, CRATES.iter().map(|(name, _)| *name).collect());
}

#[test]
fn fuzzing_uses_the_versions_of_the_workspace() {
    let versions = |folder: &str| {
        let lock: toml::Table =
            std::fs::read_to_string(root().join(folder).join("Cargo.lock")).unwrap().parse().unwrap();
        let text = |package: &toml::Value, key: &str| package[key].as_str().unwrap().to_owned();
        let packages = lock["package"].as_array().unwrap().iter();
        packages.map(|package| (text(package, "name"), text(package, "version"))).collect::<BTreeSet<_>>()
    };
    let (here, there) = (versions(""), versions("fuzz"));
    let own = ["lightpath-fuzz", "libfuzzer-sys", "arbitrary", "cap", "jobserver"];
    let differing: Vec<_> = there.difference(&here).filter(|(name, _)| !own.contains(&name.as_str())).collect();
    assert!(differing.is_empty(), "take the versions of Cargo.lock into fuzz/Cargo.lock: {differing:?}");
    let there: BTreeSet<_> = there.into_iter().map(|(name, _)| name).collect();
    for name in ["server/daemon", "server/api", "server/service", "server/worker", "server/store", "optics"] {
        assert!(dependencies(name).is_subset(&there), "fuzz/Cargo.lock lacks dependencies of {name}");
    }
}

#[test]
fn folders_of_optics_import_only_folders_below_them() {
    for (above, (name, allowed)) in OPTICS.iter().enumerate() {
        let below: Vec<_> = OPTICS[..above].iter().map(|(name, _)| *name).collect();
        assert!(allowed.iter().all(|name| below.contains(name)), "{name} may import only what is below it: {below:?}");
    }
    let mut broken = Vec::new();
    for (path, source) in sources("optics/src") {
        let folder = path.iter().next().unwrap().to_str().unwrap().trim_end_matches(".rs");
        if folder == "lib" || is_test(&path) {
            continue;
        }
        let allowed = OPTICS.iter().find(|(name, _)| *name == folder).map(|(_, allowed)| *allowed);
        let allowed = allowed.unwrap_or_else(|| panic!("optics/src/{folder} needs a row in OPTICS"));
        for name in named_in_crate(without_tests(&source)) {
            if name != folder && !allowed.contains(&name) {
                broken.push(format!("optics/src/{}: crate::{name}", path.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{broken:#?}");
}

#[test]
fn optics_and_domain_use_no_files_sockets_or_clock() {
    let mut broken = Vec::new();
    for folder in ["optics/src", "optics/bench/src", "optics/camera/src", "server/domain/src"] {
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
fn only_assembly_and_demo_of_daemon_use_the_wire_protocol() {
    let mut broken = Vec::new();
    for (path, source) in sources("server/daemon/src") {
        let is_allowed = path.starts_with("server.rs") || path.starts_with("demo");
        for unwanted in ["lightpath_proto", "lightpath::v1", "tonic", "lightpath::"] {
            if !is_allowed && mentions(&source, unwanted) {
                broken.push(format!("server/daemon/src/{}: {unwanted}", path.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{broken:#?}");
}

#[test]
fn check_finds_forbidden_imports() {
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
    assert!(mentions("use tonic_types::StatusExt;", "tonic"), "`tonic` includes `tonic_types`");
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

/// The source files below a folder, without comments and string literals. Paths are relative to the folder.
pub(super) fn sources(folder: &str) -> Vec<(PathBuf, String)> {
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

/// True for a file that holds only tests.
pub(super) fn is_test(path: &Path) -> bool {
    path.file_stem().and_then(|name| name.to_str()).is_some_and(|name| name.ends_with("tests"))
}

/// The source without its tests, which are at its end.
pub(super) fn without_tests(source: &str) -> &str {
    source.split("mod tests {").next().unwrap()
}

/// First names of all paths that begin with `crate::`.
fn named_in_crate(source: &str) -> Vec<&str> {
    let direct = source.match_indices("crate::").map(|(start, path)| first_name(&source[start + path.len()..]));
    let grouped = groups(source, "crate").into_iter().flat_map(top_level).map(first_name);
    direct.filter(|name| !name.is_empty()).chain(grouped).collect()
}

/// The root folder of the workspace.
fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

/// Removes line comments, and the text inside string literals that are on one line.
fn strip(source: &str) -> String {
    let mut stripped = String::new();
    for line in source.lines() {
        let (mut in_string, mut escaped, mut before) = (false, false, ' ');
        for (index, character) in line.char_indices() {
            match character {
                _ if escaped => escaped = false,
                '\\' if in_string => escaped = true,
                // A quote in a character literal does not start a string.
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

/// True if the source contains the path, directly or in a group: `use std::{fmt, fs}` contains `std::fs`.
fn mentions(source: &str, path: &str) -> bool {
    let named = |text: &str, path: &str| {
        text.match_indices(path).any(|(start, _)| {
            let before = text[..start].chars().next_back();
            let after = text[start + path.len()..].chars().next();
            let starts = before.is_none_or(|c| !(c.is_alphanumeric() || c == '_' || c == ':'));
            // `tonic` also matches `tonic_types`. `lightpath::` and `crate::store` match only themselves.
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

/// True if a crate's name is part of a path or an import. False if it is the name of a variable.
fn is_path(text: &str, start: usize, path: &str) -> bool {
    let name_end = text[start..].find(|c: char| !(c.is_alphanumeric() || c == '_')).map_or(text.len(), |i| start + i);
    let family = &text[start..name_end];
    let line_start = text[..start].rfind('\n').map_or(0, |i| i + 1);
    let imported = text[line_start..start].trim_start();
    is_family(family, path)
        && (text[name_end..].starts_with("::") || imported.starts_with("use ") || imported.starts_with("pub use "))
}

/// True if a crate belongs to a family: `tonic-types` and `tonic_types` belong to `tonic`.
fn is_family(name: &str, family: &str) -> bool {
    name.strip_prefix(family).is_some_and(|rest| rest.is_empty() || rest.starts_with(['-', '_']))
}

/// The text between the braces of each `parent::{…}`.
fn groups<'a>(source: &'a str, parent: &str) -> Vec<&'a str> {
    let opening = format!("{parent}::{{");
    source.match_indices(&opening).map(|(start, _)| inside(&source[start + opening.len()..])).collect()
}

/// The text up to the brace that closes the group.
pub(super) fn inside(text: &str) -> &str {
    let mut depth = 1;
    let end = text.find(|c| {
        depth += i32::from(c == '{') - i32::from(c == '}');
        depth == 0
    });
    &text[..end.unwrap_or(text.len())]
}

/// The items of a group. An item may contain groups.
pub(super) fn top_level(group: &str) -> Vec<&str> {
    let mut depth = 0;
    group
        .split(move |c| {
            depth += i32::from(c == '{') - i32::from(c == '}');
            c == ',' && depth == 0
        })
        .collect()
}

/// The first name of a path.
pub(super) fn first_name(item: &str) -> &str {
    let item = item.trim();
    item.split(|c: char| !(c.is_alphanumeric() || c == '_')).next().unwrap_or(item)
}
