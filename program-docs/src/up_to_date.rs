//! A test that a stored document is up to date.

use std::path::Path;

/// Environment variable that lets the test write the document instead.
const WRITE: &str = "LIGHTPATH_WRITE_DOCS";

/// Checks that a part of a document agrees with `part`. The part stands between the lines `<!-- NAME -->` and
/// `<!-- end of NAME -->`. With `LIGHTPATH_WRITE_DOCS=1` it writes the part into the document instead.
///
/// # Errors
///
/// A text that says what to do: the document cannot be read or written, lacks the marks, or is out of date.
pub fn check_document(path: &Path, name: &str, part: &str) -> Result<(), String> {
    let file = path.display();
    let document = std::fs::read_to_string(path).map_err(|error| format!("{file} cannot be read: {error}"))?;
    let (begin, end) = (format!("<!-- {name} -->\n"), format!("<!-- end of {name} -->"));
    let places = document.find(&begin).map(|at| at + begin.len()).zip(document.find(&end));
    let Some((from, to)) = places.filter(|(from, to)| from <= to) else {
        return Err(format!("{file} lacks the lines {} and {end}", begin.trim()));
    };
    let wanted = format!("\n{}\n\n", part.trim());
    if document[from..to] == wanted {
        return Ok(());
    }
    if std::env::var_os(WRITE).is_some() {
        let document = format!("{}{wanted}{}", &document[..from], &document[to..]);
        return std::fs::write(path, document).map_err(|error| format!("{file} cannot be written: {error}"));
    }
    Err(format!("{file} is out of date: run this test once more with {WRITE}=1"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn documents_that_differ_or_lack_the_marks_are_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.md");
        std::fs::write(&path, "x\n<!-- tool -->\n\n# tool\n\n<!-- end of tool -->\n").unwrap();
        assert_eq!(check_document(&path, "tool", "# tool\n"), Ok(()));
        assert!(check_document(&path, "tool", "# other").unwrap_err().contains("LIGHTPATH_WRITE_DOCS=1"));
        assert!(check_document(&path, "b", "# b").unwrap_err().contains("lacks the lines <!-- b -->"));
    }
}
