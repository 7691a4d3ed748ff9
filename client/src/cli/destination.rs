//! Paths of output files, from one file, a folder, or a pattern with `{name}`. They are checked before a job is
//! submitted.

use super::failure::Failure;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Placeholder for the name of a target in a pattern.
const NAME: &str = "{name}";

/// Returns one output file for each target.
///
/// `destination` is a file for one target, a folder, or a pattern with `{name}`. In a folder the files are called
/// `{name}{suffix}`. A missing folder is created if `destination` ends with `/`.
pub(crate) fn files(option: &str, destination: &Path, names: &[String], suffix: &str) -> Result<Vec<PathBuf>, Failure> {
    let text = destination.to_string_lossy();
    if text.contains(NAME) {
        let files: Vec<PathBuf> = names.iter().map(|name| text.replace(NAME, name).into()).collect();
        return files.into_iter().map(|file| in_existing_folder(option, file)).collect();
    }
    if text.ends_with('/') {
        let file_error = |source| lightpath::Error::File { action: "create", path: destination.to_owned(), source };
        std::fs::create_dir_all(destination).map_err(file_error)?;
    }
    if destination.is_dir() {
        return Ok(names.iter().map(|name| destination.join(format!("{name}{suffix}"))).collect());
    }
    if names.len() > 1 {
        let (count, file) = (names.len(), destination.display());
        return Err(Failure::Usage(format!(
            "{option} {file} is one file, but there are {count} targets: give a folder ({file}/) or a pattern with {NAME}"
        )));
    }
    Ok(vec![in_existing_folder(option, destination.to_owned())?])
}

/// Refuses to write two results to one file, or to overwrite an input file.
pub(crate) fn check_distinct<'a>(
    inputs: impl Iterator<Item = &'a Path>,
    outputs: impl Iterator<Item = &'a Path>,
) -> Result<(), Failure> {
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let inputs: BTreeSet<PathBuf> = inputs.map(real).collect();
    let mut seen = BTreeSet::new();
    for output in outputs {
        if inputs.contains(&real(output)) {
            return Err(Failure::Usage(format!(
                "{} is an input file and would be overwritten: give another output file",
                output.display()
            )));
        }
        if !seen.insert(output) {
            let file = output.display();
            return Err(Failure::Usage(format!("{file} would be written twice: give the targets different names")));
        }
    }
    Ok(())
}

/// The name of a target: its file name without folder and extension.
pub(crate) fn name_of(target: &Path) -> String {
    target.file_stem().unwrap_or(target.as_os_str()).to_string_lossy().into_owned()
}

/// Returns `file` if its folder exists. Otherwise the job would run before its result could not be written.
fn in_existing_folder(option: &str, file: PathBuf) -> Result<PathBuf, Failure> {
    let folder = match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    if folder.is_dir() {
        return Ok(file);
    }
    let (file, folder) = (file.display(), folder.display());
    Err(Failure::Usage(format!("{option} {file}: there is no folder {folder}; create it first")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(result: Result<impl std::fmt::Debug, Failure>) -> String {
        match result {
            Err(Failure::Usage(text)) => text,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn destination_is_a_file_a_folder_or_a_pattern() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let one = ["eye".to_owned()];
        let two = ["eye".to_owned(), "sky".to_owned()];
        assert_eq!(files("-o", &at("phase.png"), &one, "-phase.png").unwrap(), [at("phase.png")]);
        let in_folder = [at("eye-phase.png"), at("sky-phase.png")];
        assert_eq!(files("-o", folder.path(), &two, "-phase.png").unwrap(), in_folder);
        assert_eq!(files("-o", &at("{name}-x.png"), &two, "").unwrap(), [at("eye-x.png"), at("sky-x.png")]);
        let made = format!("{}/", at("new").display());
        assert_eq!(files("-o", Path::new(&made), &one, ".npy").unwrap(), [at("new").join("eye.npy")]);
        assert!(message(files("-o", &at("phase.png"), &two, "")).contains("2 targets"));
        assert!(message(files("-o", &at("none/phase.png"), &one, "")).contains("there is no folder"));
    }

    #[test]
    fn inputs_and_earlier_outputs_are_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("eye.png");
        std::fs::write(&target, b"x").unwrap();
        let other = folder.path().join("./eye.png");
        let inputs = || [target.as_path()].into_iter();
        assert!(message(check_distinct(inputs(), [other.as_path()].into_iter())).contains("is an input file"));
        let new = folder.path().join("new.png");
        assert!(check_distinct(inputs(), [new.as_path()].into_iter()).is_ok());
        assert!(message(check_distinct(inputs(), [new.as_path(); 2].into_iter())).contains("written twice"));
    }
}
