//! Places of output files: a file, a folder, a pattern with `{name}`, or `-` for standard output. They are checked before
//! a job is submitted, so that no job runs whose result cannot be saved.

use super::failure::Failure;
use super::session::{Session, Stdout};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Placeholder for the name of a target in a pattern.
const NAME: &str = "{name}";
/// Stands for standard output.
const STDOUT: &str = "-";

/// An option that names output files.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Destination {
    /// The option, such as `-o`.
    pub(crate) option: &'static str,
    /// End of the names of files in a folder, such as `-pattern.png`.
    pub(crate) suffix: &'static str,
    /// Extensions of the known formats, each with what it means.
    pub(crate) formats: &'static [(&'static str, &'static str)],
}

/// The format of pictures.
pub(crate) const PNG: (&str, &str) = ("png", "a picture");

impl Destination {
    /// Returns one output file for each name, and checks that it can be written.
    ///
    /// `place` is a file for one name, a folder, or a pattern with `{name}`. In a folder the files are called
    /// `{name}{suffix}`. A missing folder is created if `place` ends with `/`.
    pub(crate) fn files(&self, stdout: &Stdout, place: &Path, names: &[String]) -> Result<Vec<PathBuf>, Failure> {
        let text = place.to_string_lossy();
        let (option, count) = (self.option, names.len());
        if is_stdout(place) {
            if count > 1 {
                return Err(Failure::Usage(format!(
                    "{option} - is standard output, which takes one file, but there are {count}: give a folder"
                )));
            }
            stdout.reserve(option)?;
            return Ok(vec![place.to_owned()]);
        }
        self.check_placeholders(&text)?;
        if text.ends_with('/') && !text.contains(NAME) {
            let file_error = |source| lightpath::Error::File { action: "create", path: place.to_owned(), source };
            std::fs::create_dir_all(place).map_err(file_error)?;
        }
        let files: Vec<PathBuf> = if text.contains(NAME) {
            names.iter().map(|name| text.replace(NAME, name).into()).collect()
        } else if place.is_dir() {
            names.iter().map(|name| place.join(format!("{name}{}", self.suffix))).collect()
        } else if count > 1 {
            return Err(Failure::Usage(format!(
                "{option} {text} is one file, but there are {count} targets: give a folder ({text}/) or a pattern with \
                 {NAME}"
            )));
        } else {
            vec![place.to_owned()]
        };
        files.iter().try_for_each(|file| self.check(file))?;
        Ok(files)
    }

    /// Returns the only output file of a command, and checks that it can be written.
    pub(crate) fn file(&self, stdout: &Stdout, place: &Path) -> Result<PathBuf, Failure> {
        if is_stdout(place) {
            stdout.reserve(self.option)?;
        } else {
            self.check(place)?;
        }
        Ok(place.to_owned())
    }

    /// Refuses placeholders other than `{name}`, which would otherwise become parts of file names.
    fn check_placeholders(&self, pattern: &str) -> Result<(), Failure> {
        for part in pattern.split('{').skip(1) {
            let Some((word, _)) = part.split_once('}') else { continue };
            if format!("{{{word}}}") != NAME {
                let option = self.option;
                return Err(Failure::Usage(format!(
                    "{option} {pattern}: {{{word}}} is not known; the only placeholder is {NAME}, the name of the \
                     target's file without its extension"
                )));
            }
        }
        Ok(())
    }

    /// Refuses a file of an unknown format or in a place that cannot be written.
    fn check(&self, file: &Path) -> Result<(), Failure> {
        if file.is_dir() {
            let (option, folder) = (self.option, file.display());
            return Err(Failure::Usage(format!(
                "{option} {folder} is a folder, but must be a file: name a file in it"
            )));
        }
        self.check_format(file)?;
        check_writable(self.option, file)
    }

    fn check_format(&self, file: &Path) -> Result<(), Failure> {
        let extension = file.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if self.formats.is_empty() || self.formats.iter().any(|(known, _)| *known == extension) {
            return Ok(());
        }
        let known: Vec<String> = self.formats.iter().map(|(known, what)| format!(".{known} ({what})")).collect();
        let problem = match extension.as_str() {
            "" => "has no extension, which says the format".to_owned(),
            unknown => format!("has the extension .{unknown}, which is not known here"),
        };
        let (option, file) = (self.option, file.display());
        Err(Failure::Usage(format!("{option} {file} {problem}: use {}", known.join(" or "))))
    }
}

/// Creates a folder, if it is missing, and checks that files can be written in it.
pub(crate) fn create_folder(option: &str, folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(|error| {
        Failure::Usage(format!("{option} {}: the folder cannot be created: {error}", folder.display()))
    })?;
    check_writable(option, &folder.join("file"))
}

/// Saves an artifact in a file, or writes it to standard output.
pub(crate) async fn save(session: &Session, digest: &str, file: &Path) -> Result<(), Failure> {
    if is_stdout(file) {
        return Stdout::write_file(&session.client.download(digest).await?);
    }
    Ok(session.client.download_to(digest, file).await?)
}

/// Writes bytes to a file, or to standard output.
pub(crate) fn write(bytes: &[u8], file: &Path) -> Result<(), Failure> {
    if is_stdout(file) {
        return Stdout::write_file(bytes);
    }
    let file_error = |source| lightpath::Error::File { action: "write", path: file.to_owned(), source };
    Ok(std::fs::write(file, bytes).map_err(file_error)?)
}

/// True for the place that stands for standard output.
pub(crate) fn is_stdout(file: &Path) -> bool {
    file.as_os_str() == STDOUT
}

/// The name of a file in messages.
pub(crate) fn shown(file: &Path) -> String {
    if is_stdout(file) { "standard output".to_owned() } else { file.display().to_string() }
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

/// Refuses a file whose folder does not exist or cannot be written.
fn check_writable(option: &str, file: &Path) -> Result<(), Failure> {
    let folder = match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let (shown, place) = (file.display(), folder.display());
    if !folder.is_dir() {
        return Err(Failure::Usage(format!("{option} {shown}: there is no folder {place}; create it first")));
    }
    // The only sure test: results are written to such a file first, too. It is removed at once.
    match tempfile::Builder::new().prefix(".lightpath-").tempfile_in(folder) {
        Ok(_) => Ok(()),
        Err(error) => {
            Err(Failure::Usage(format!("{option} {shown}: no file can be written in the folder {place}: {error}")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PHASE: Destination =
        Destination { option: "-o", suffix: "-pattern.png", formats: &[("png", "grey levels"), ("npy", "radians")] };

    fn files(place: &Path, names: &[&str]) -> Result<Vec<PathBuf>, Failure> {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        PHASE.files(&Stdout::default(), place, &names)
    }

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
        let (one, two) = (["eye"], ["eye", "sky"]);
        assert_eq!(files(&at("pattern.png"), &one).unwrap(), [at("pattern.png")]);
        assert_eq!(files(&at("phase.NPY"), &one).unwrap(), [at("phase.NPY")]);
        let in_folder = [at("eye-pattern.png"), at("sky-pattern.png")];
        assert_eq!(files(folder.path(), &two).unwrap(), in_folder);
        assert_eq!(files(&at("{name}-x.png"), &two).unwrap(), [at("eye-x.png"), at("sky-x.png")]);
        let made = format!("{}/", at("new").display());
        assert_eq!(files(Path::new(&made), &one).unwrap(), [at("new").join("eye-pattern.png")]);
        assert!(message(files(&at("pattern.png"), &two)).contains("2 targets"));
        assert!(message(files(Path::new("-"), &two)).contains("takes one file, but there are 2"));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "the checks leave no files");
    }

    #[test]
    fn places_that_cannot_be_written_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        assert!(message(files(&at("none/pattern.png"), &["eye"])).contains("there is no folder"));
        assert!(message(files(Path::new("/proc/pattern.png"), &["eye"])).contains("no file can be written"));
        std::fs::create_dir(at("eye-pattern.png")).unwrap();
        assert!(message(files(folder.path(), &["eye"])).contains("is a folder, but must be a file"));
        let single = PHASE.file(&Stdout::default(), folder.path());
        assert!(message(single).contains("is a folder, but must be a file"));
    }

    #[test]
    fn unknown_formats_and_placeholders_are_refused_with_those_that_are_known() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let unknown = message(files(&at("phase.jpg"), &["eye"]));
        assert!(
            unknown.contains(".jpg, which is not known here: use .png (grey levels) or .npy (radians)"),
            "{unknown}"
        );
        assert!(message(files(&at("phase"), &["eye"])).contains("has no extension, which says the format"));
        let unknown = message(files(&at("{target}-{name}.png"), &["eye"]));
        assert!(unknown.contains("{target} is not known; the only placeholder is {name}"), "{unknown}");
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
