//! No files or folders of a crate import each other in a circle.

use super::imports::{CRATES, first_name, inside, is_test, sources, top_level, without_tests};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The path of a module: names from the root of its crate, which has none.
type Module = Vec<String>;

#[test]
fn no_files_or_folders_of_a_crate_import_each_other_in_a_circle() {
    for (name, _) in CRATES {
        let modules = sources(&format!("{name}/src")).into_iter().filter(|(path, _)| !is_test(path));
        let circle = circle(&modules.map(|(path, source)| (module_of(&path), source)).collect());
        assert!(circle.is_empty(), "{name}: {circle:#?}");
    }
}

#[test]
fn check_finds_circles() {
    let modules = |last: &str| {
        let sources = [
            ("", "mod a; mod b; mod c; pub use c::d::D;"),
            ("a", "use crate::{b::B, std::fmt}; use super::b;"),
            ("b", "fn f(d: crate::D) {} mod tests { use crate::a; }"),
            ("c", "mod d; mod e; use d::D;"),
            ("c::d", "use super::e::E;"),
            ("c::e", last),
        ];
        let path = |name: &str| name.split("::").filter(|name| !name.is_empty()).map(str::to_owned).collect();
        sources.map(|(name, source)| (path(name), source.to_owned())).into()
    };
    assert_eq!(circle(&modules("use super::fmt; use std::b::B;")), BTreeSet::new());
    let found = |pairs: &[(&str, &str)]| pairs.iter().map(|(a, b)| ((*a).to_owned(), (*b).to_owned())).collect();
    assert_eq!(circle(&modules("use super::super::b;")), found(&[("b", "c"), ("c", "b")]));
    assert_eq!(circle(&modules("use crate::c::{self, D};")), found(&[("c::d", "c::e"), ("c::e", "c::d")]));
    assert_eq!(circle(&modules("fn f(a: crate::a::A)")), found(&[("a", "b"), ("b", "c"), ("c", "a")]));
}

fn module_of(path: &Path) -> Module {
    let names = path.with_extension("");
    let mut names: Module = names.iter().map(|name| name.to_str().unwrap().to_owned()).collect();
    names.pop_if(|name| ["lib", "main", "mod"].contains(&name.as_str()));
    names
}

/// The imports between the files and folders of a folder that are part of a circle, or lead from one to another. A folder
/// and what is in it may know each other.
fn circle(modules: &BTreeMap<Module, String>) -> BTreeSet<(String, String)> {
    let in_crate = |find: fn(&str) -> Vec<Module>| {
        let of = |(module, source): (&Module, &String)| {
            let paths = find(without_tests(source)).into_iter();
            (module.clone(), paths.filter_map(|path| from_root(module, &path, modules)).collect())
        };
        modules.iter().map(of).collect::<BTreeMap<Module, Vec<Module>>>()
    };
    let (imported, named) = (in_crate(imports), in_crate(inline_paths));
    let mut arrows = BTreeSet::new();
    for (module, path) in
        imported.iter().chain(&named).flat_map(|(module, paths)| paths.iter().map(move |p| (module, p)))
    {
        let target = defining(path, &imported);
        let shared = module.iter().zip(&target).take_while(|(a, b)| a == b).count();
        if shared < module.len().min(target.len()) {
            arrows.insert((module[..=shared].join("::"), target[..=shared].join("::")));
        }
    }
    loop {
        let (from, to): (BTreeSet<_>, BTreeSet<_>) = arrows.iter().cloned().unzip();
        let before = arrows.len();
        arrows.retain(|(a, b)| to.contains(a) && from.contains(b));
        if arrows.len() == before {
            return arrows;
        }
    }
}

/// The module in which a path ends, also where another module hands on what it imported from there.
fn defining(path: &[String], imported: &BTreeMap<Module, Vec<Module>>) -> Module {
    let length = (0..=path.len()).rev().find(|length| imported.contains_key(&path[..*length])).unwrap_or(0);
    let (module, names) = path.split_at(length);
    let handed_on = names.first().and_then(|name| imported.get(module)?.iter().find(|path| path.last() == Some(name)));
    match handed_on.filter(|from| *from != path) {
        Some(from) => defining(&[from.as_slice(), &names[1..]].concat(), imported),
        None => module.to_vec(),
    }
}

/// The path from the root of the crate to what `module` calls `path`; `None`: it is in another crate.
fn from_root(module: &Module, path: &Module, modules: &BTreeMap<Module, String>) -> Option<Module> {
    let ups = path.iter().take_while(|name| *name == "super").count();
    let names = match path.first()?.as_str() {
        "crate" => return Some(path[1..].to_vec()),
        "super" => &path[ups..],
        child if modules.contains_key(&[module.as_slice(), &[child.to_owned()]].concat()) => path,
        _ => return None,
    };
    Some([&module[..module.len().saturating_sub(ups)], names].concat())
}

/// The paths of all imports.
fn imports(source: &str) -> Vec<Module> {
    source.split("use ").skip(1).filter_map(|rest| rest.split(';').next()).flat_map(ungrouped).collect()
}

/// The paths of an import without its groups.
fn ungrouped(import: &str) -> Vec<Module> {
    let is_name = |name: &&str| !name.is_empty() && *name != "self";
    let names = |path: &str| path.split("::").map(first_name).filter(is_name).map(str::to_owned).collect::<Module>();
    let Some((parent, group)) = import.split_once("::{") else { return vec![names(import)] };
    let items = top_level(inside(group)).into_iter().flat_map(ungrouped);
    items.map(|item| [names(parent), item].concat()).collect()
}

/// The paths in a source that begin in its crate, outside and inside of imports.
fn inline_paths(source: &str) -> Vec<Module> {
    let starts = ["crate::", "super::"].into_iter().flat_map(|start| source.match_indices(start));
    let path =
        |rest: &str| rest.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':')).next().map(str::to_owned);
    let paths = starts
        .filter(|(start, _)| !source[..*start].ends_with("super::"))
        .filter_map(|(start, _)| path(&source[start..]));
    paths.map(|path| path.split("::").map(str::to_owned).filter(|name| !name.is_empty()).collect()).collect()
}
