//! Documents of lines `name value`, in a fixed order.

use crate::{DOCUMENT_BYTES_MAX, Time};

/// Reason why a text is not a document of the wanted kind; the messages say what each means. Lines count from 1.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)]
pub enum DocumentError {
    #[error("the document has {bytes} bytes, but may have at most {DOCUMENT_BYTES_MAX}")]
    TooLarge { bytes: usize },
    #[error("the document must be lines of printable ASCII, each with a line feed at its end")]
    NotText,
    /// A line has another name than the one that must stand there, or is missing.
    #[error("line {line} must begin with \"{expected}\"")]
    Name { line: usize, expected: &'static str },
    /// The first line names the right kind of document, but another version of its format.
    #[error("the {document} has another version of the format than {version}, the one that this program reads")]
    Version { document: &'static str, version: u32 },
    #[error("line {line}: {name} must be {expected}")]
    Value { line: usize, name: &'static str, expected: &'static str },
    #[error("line {line}: the document must end before it")]
    TooLong { line: usize },
}

/// Writes a document.
#[derive(Default)]
pub(crate) struct Writer(String);

impl Writer {
    pub(crate) fn line(mut self, name: &str, value: impl ToString) -> Self {
        self.0 += name;
        self.0.push(' ');
        self.0 += &value.to_string();
        self.0.push('\n');
        self
    }

    pub(crate) fn finish(self) -> String {
        self.0
    }
}

/// Reads a document line by line.
pub(crate) struct Reader<'a> {
    text: &'a str,
    rest: &'a str,
    line: usize,
}

impl<'a> Reader<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Result<Self, DocumentError> {
        if bytes.len() > DOCUMENT_BYTES_MAX {
            return Err(DocumentError::TooLarge { bytes: bytes.len() });
        }
        let is_plain = bytes.iter().all(|byte| matches!(byte, b' '..=b'~' | b'\n')) && bytes.ends_with(b"\n");
        let text = std::str::from_utf8(bytes).ok().filter(|_| is_plain).ok_or(DocumentError::NotText)?;
        Ok(Self { text, rest: text, line: 0 })
    }

    /// The bytes before the present line.
    pub(crate) fn before(&self) -> &'a str {
        &self.text[..self.text.len() - self.rest.len()]
    }

    /// Whether the next line has this name.
    pub(crate) fn comes(&self, name: &str) -> bool {
        self.rest.strip_prefix(name).is_some_and(|rest| rest.starts_with(' '))
    }

    /// The value of the next line, which must have this name.
    pub(crate) fn text(&mut self, name: &'static str) -> Result<&'a str, DocumentError> {
        self.line += 1;
        let wrong = DocumentError::Name { line: self.line, expected: name };
        let (line, rest) = self.rest.split_once('\n').ok_or_else(|| wrong.clone())?;
        let value = line.strip_prefix(name).and_then(|value| value.strip_prefix(' ')).ok_or(wrong)?;
        self.rest = rest;
        Ok(value)
    }

    /// Reads the first line, which names the kind of the document and the version of its format.
    pub(crate) fn head(&mut self, head: &'static str, version: u32) -> Result<(), DocumentError> {
        if self.text(head)? == version.to_string() {
            return Ok(());
        }
        let document = head.rsplit(' ').next().unwrap_or(head);
        Err(DocumentError::Version { document, version })
    }

    /// The value of the next line as `parse` reads it. The value must be in the form in which it is written.
    pub(crate) fn value<T: ToString>(
        &mut self,
        name: &'static str,
        expected: &'static str,
        parse: impl FnOnce(&str) -> Option<T>,
    ) -> Result<T, DocumentError> {
        let text = self.text(name)?;
        let value = parse(text).filter(|value| value.to_string() == text);
        value.ok_or(DocumentError::Value { line: self.line, name, expected })
    }

    pub(crate) fn number<T: std::str::FromStr + ToString>(&mut self, name: &'static str) -> Result<T, DocumentError> {
        self.value(name, "a whole number without leading zeros", |text| text.parse().ok())
    }

    pub(crate) fn time(&mut self, name: &'static str) -> Result<Time, DocumentError> {
        self.value(name, "a time, such as 2026-11-23T18:30:00Z", Time::parse)
    }

    pub(crate) fn wrong_value(&self, name: &'static str, expected: &'static str) -> DocumentError {
        DocumentError::Value { line: self.line, name, expected }
    }

    /// Checks that no line is left.
    pub(crate) fn end(self) -> Result<(), DocumentError> {
        if self.rest.is_empty() { Ok(()) } else { Err(DocumentError::TooLong { line: self.line + 1 }) }
    }
}

/// Whether a text is an id or a name: no spaces.
pub(crate) fn is_word(text: &str) -> bool {
    !text.is_empty()
        && text.len() <= 63
        && text.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"._-".contains(&byte))
}

/// Whether a text is this many hexadecimal digits, in lower case.
pub(crate) fn is_hex(text: &str, digits: usize) -> bool {
    text.len() == digits && text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
}
