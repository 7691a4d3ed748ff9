//! Input files of commands. A folder stands for the files in it.

use super::failure::Failure;
use super::session::print_note;
use super::show;
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

/// Extensions of pictures and arrays that the server reads.
pub(crate) const PICTURES: &[&str] = &["png", "jpg", "jpeg", "tif", "tiff", "bmp", "npy"];
/// Extensions of holograms.
pub(crate) const HOLOGRAMS: &[&str] = &["png"];

/// How pictures and arrays begin: PNG, JPEG, TIFF and BigTIFF in both byte orders, `.npy`.
const STARTS: [&[u8]; 7] = [b"\x89PNG", b"\xff\xd8\xff", b"II*\0", b"MM\0*", b"II+\0", b"MM\0+", b"\x93NUMPY"];
/// Lengths of the second header of a BMP, at its fifteenth byte. Its two letters alone begin many texts.
const BMP_HEADERS: [u32; 6] = [12, 40, 52, 56, 108, 124];

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

/// Checks that files are pictures or arrays by how they begin, before anything of them is sent: a list of files that
/// somebody else wrote may name any file.
pub(crate) fn require_pictures<'a>(files: impl IntoIterator<Item = &'a PathBuf>) -> Result<(), Failure> {
    files.into_iter().try_for_each(|path| {
        let failed = |source| lightpath::Error::File { action: "read", path: path.clone(), source };
        // Opening a pipe would wait for somebody who writes to it.
        let is_file = std::fs::metadata(path).map_err(failed)?.is_file();
        let mut start = Vec::new();
        if is_file {
            File::open(path).and_then(|file| file.take(18).read_to_end(&mut start)).map_err(failed)?;
        }
        if STARTS.iter().any(|known| start.starts_with(known)) || is_bmp(&start) {
            return Ok(());
        }
        let path = path.display();
        Err(Failure::Usage(format!(
            "{path} is not a picture or array (PNG, JPEG, TIFF, BMP or .npy), so nothing was uploaded; correct the list of \
             files"
        )))
    })
}

fn is_bmp(start: &[u8]) -> bool {
    let header = start.get(14..18).map(|digits| u32::from_le_bytes(std::array::from_fn(|i| digits[i])));
    start.starts_with(b"BM") && header.is_some_and(|bytes| BMP_HEADERS.contains(&bytes))
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
    fn only_pictures_and_arrays_pass_and_a_pipe_does_not_hang() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, content: &[u8]| {
            std::fs::write(folder.path().join(name), content).unwrap();
            folder.path().join(name)
        };
        let good = [file("a", b"\x89PNG\r\n\x1a\n"), file("b", b"\xff\xd8\xff\xe0"), file("c", b"II*\0\x08\0\0\0")];
        require_pictures(&good).unwrap();
        require_pictures(&[file("d", b"\x93NUMPY\x01")]).unwrap();
        require_pictures(&[file("e", b"BM\x36\x03\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0")]).unwrap();
        require_pictures(&[file("f.bmp", b"BMW is a maker of cars.")]).unwrap_err();
        let pipe = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let key = file("key.png", b"-----BEGIN OPENSSH PRIVATE KEY-----");
        for bad in
            [key, file("empty.png", b""), file("picture.gif", b"GIF89a\x01\0\x01\0"), pipe, folder.path().to_owned()]
        {
            match require_pictures(good.iter().chain([&bad])) {
                Err(Failure::Usage(text)) => assert!(
                    text.starts_with(&format!("{} is not a picture", bad.display())) && !text.contains("BEGIN"),
                    "{text}"
                ),
                other => panic!("{}: {other:?}", bad.display()),
            }
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
