//! Input files of commands. A folder stands for the files in it.

use super::failure::Failure;
use super::session::print_note;
use super::show;
use std::fs::File;
use std::path::{Path, PathBuf};

/// Extensions of pictures that the server reads.
pub(crate) const PICTURES: &[&str] = &["png", "jpg", "jpeg", "tif", "tiff"];
/// Extensions of holograms.
pub(crate) const HOLOGRAMS: &[&str] = &["png"];

/// The given files, with the files of each folder in its place: those with one of the extensions, sorted by name. Says
/// on stderr how many each folder has.
pub(crate) fn expanded(given: &[PathBuf], extensions: &[&str]) -> Result<Vec<PathBuf>, Failure> {
    let mut files = Vec::new();
    for path in given {
        if !path.is_dir() {
            files.push(path.clone());
            continue;
        }
        let found = in_folder(path, extensions)?;
        let folder = path.display();
        if found.is_empty() {
            return Err(Failure::Usage(format!("{folder} has no files of the kinds {}", extensions.join(", "))));
        }
        print_note(&format!("{folder}: {}", show::counted(found.len(), "picture")));
        files.extend(found);
    }
    Ok(files)
}

/// Checks that all files can be opened. Otherwise a mistyped name would be found after earlier jobs were submitted.
pub(crate) fn check_readable<'a>(files: impl IntoIterator<Item = &'a PathBuf>) -> Result<(), Failure> {
    for path in files {
        File::open(path).map_err(|source| lightpath::Error::File { action: "read", path: path.clone(), source })?;
    }
    Ok(())
}

/// The text of a file, without the mark that editors of Windows write at the beginning.
pub(crate) fn text(path: &Path) -> Result<String, Failure> {
    let read_error = |source| lightpath::Error::File { action: "read", path: path.to_owned(), source };
    let bytes = std::fs::read(path).map_err(read_error)?;
    // UTF-16 has a zero in each letter of ASCII.
    let is_utf_16 = bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") || bytes.contains(&0);
    match String::from_utf8(bytes) {
        Ok(text) if !is_utf_16 => Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text)),
        _ => {
            let what = if is_utf_16 { "is UTF-16, as PowerShell's > writes it, or no text" } else { "is not UTF-8" };
            Err(Failure::Usage(format!("{} {what}; save it as text in UTF-8", path.display())))
        }
    }
}

/// The paths of what is in a folder, in their order, without hidden files. macOS writes a hidden `._NAME` beside each
/// NAME on drives of other systems: its extension is that of a picture, but it is none.
pub(crate) fn paths_in(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let read_error = |source| lightpath::Error::File { action: "read", path: folder.to_owned(), source };
    let entries = std::fs::read_dir(folder).map_err(read_error)?;
    let mut paths = entries.map(|entry| Ok(entry.map_err(read_error)?.path())).collect::<Result<Vec<_>, Failure>>()?;
    paths.retain(|path| !path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.')));
    paths.sort();
    Ok(paths)
}

/// Whether a file has one of the extensions, in capitals or small letters.
pub(crate) fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    extensions.contains(&extension.as_str())
}

fn in_folder(folder: &Path, extensions: &[&str]) -> Result<Vec<PathBuf>, Failure> {
    let mut paths = paths_in(folder)?;
    paths.retain(|path| has_extension(path, extensions) && path.is_file());
    Ok(paths)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_utf_8_with_or_without_a_mark() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("text.txt");
        let read = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            text(&path)
        };
        assert_eq!(read(b"\xef\xbb\xbf0.5\n").unwrap(), "0.5\n");
        assert_eq!(read("1 µm\n".as_bytes()).unwrap(), "1 µm\n");
        for (bytes, sign) in [
            (&b"\xff\xfe0\0\n\0"[..], "is UTF-16"),
            (b"\xfe\xff\x000\0\n", "is UTF-16"),
            (b"0\0\n\0", "is UTF-16"),
            (b"1 \xb5m\n", "is not UTF-8"),
        ] {
            let Err(Failure::Usage(problem)) = read(bytes) else { panic!("{bytes:?} was read") };
            assert!(problem.contains(sign) && problem.contains("save it as text in UTF-8"), "{problem}");
        }
    }

    #[test]
    fn a_folder_stands_for_its_pictures_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["b.PNG", "a.jpg", "notes.txt", ".hidden.png", "c.tiff"] {
            std::fs::write(at(name), b"x").unwrap();
        }
        std::fs::create_dir(at("d.png")).unwrap();
        let given = [at("z.png"), folder.path().to_owned()];
        let expected = [at("z.png"), at("a.jpg"), at("b.PNG"), at("c.tiff")];
        assert_eq!(expanded(&given, PICTURES).unwrap(), expected);
        let empty = expanded(&[folder.path().to_owned()], &["npy"]);
        assert!(matches!(empty, Err(Failure::Usage(text)) if text.contains("no files of the kinds npy")));
    }
}
