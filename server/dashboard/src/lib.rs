//! The web page of the server, as files in the program.
//!
//! The folder `page` has the files as browsers get them: HTML, CSS and JavaScript modules, without a step that builds
//! them. `page/vendor` has libraries of others, each with its licence and version.
#![forbid(unsafe_code)]

/// The file that a browser gets first.
pub const INDEX: &str = "index.html";

/// A file of the page.
#[derive(Clone, Copy, Debug)]
pub struct File {
    /// Its bytes.
    pub bytes: &'static [u8],
    /// Its content type.
    pub content_type: &'static str,
}

const FILES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/files.rs"));

/// The file with this name, such as `pages/jobs.js`.
#[must_use]
pub fn file(name: &str) -> Option<File> {
    let (_, bytes) = FILES.iter().find(|(known, _)| *known == name)?;
    let content_type = match name.rsplit('.').next()? {
        "html" => "text/html; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "svg" => "image/svg+xml",
        _ => "text/plain; charset=utf-8",
    };
    Some(File { bytes, content_type })
}

/// The names of all files.
pub fn names() -> impl Iterator<Item = &'static str> {
    FILES.iter().map(|(name, _)| *name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_found_by_their_names() {
        assert_eq!(file(INDEX).map(|file| file.content_type), Some("text/html; charset=utf-8"));
        assert_eq!(file("main.js").map(|file| file.content_type), Some("text/javascript; charset=utf-8"));
        for unknown in ["", "/", "../Cargo.toml", "pages", "index.html/"] {
            assert!(file(unknown).is_none(), "{unknown}");
        }
    }

    /// Modules and styles that a file of the page names.
    #[test]
    fn files_name_only_files_of_the_page() {
        for name in names().filter(|name| !name.starts_with("vendor/")) {
            let text = std::str::from_utf8(file(name).map_or(&[], |file| file.bytes)).unwrap_or_default();
            let folder = name.rsplit_once('/').map_or("", |(folder, _)| folder);
            for import in text.split("from \"").skip(1).filter_map(|rest| rest.split('"').next()) {
                let path = import.split('/').fold(folder.to_owned(), |path, part| match part {
                    "." => path,
                    ".." => path.rsplit_once('/').map_or(String::new(), |(up, _)| up.to_owned()),
                    part if path.is_empty() => part.to_owned(),
                    part => format!("{path}/{part}"),
                });
                assert!(file(&path).is_some(), "{name} imports {import}, which is {path}");
            }
        }
    }
}
