//! Statuses that every client accepts: gRPC sends a refusal in the headers that end an answer, and clients refuse
//! headers of more than 8 KiB with a RESOURCE_EXHAUSTED of their own, which reads as "retry".

use axum::http::HeaderMap;
use lightpath_service::WrongField;
use tonic::Status;

/// Limit on the headers of a status \[bytes\]: 8 KiB, less what servers, proxies and HTTP add.
const STATUS_BYTES_MAX: usize = 7 << 10;
/// Limits on each text of a status, tried one after the other \[bytes\]. A text is sent up to three times, in Base64 or
/// with three characters for a byte, so the last one fits whatever its characters are.
const TEXT_BYTES_MAX: [usize; 3] = [1800, 900, 400];

/// Texts of a status.
#[derive(Clone, Debug)]
pub(crate) struct Texts {
    /// The message, unless it consists of the wrong fields.
    pub(crate) message: String,
    /// What the status is about.
    pub(crate) about: String,
    pub(crate) wrong: Vec<WrongField>,
}

/// The status that `build` makes of the texts. Texts that are too long for clients are cut, and if that is not enough, the
/// last wrong fields are left out. Both say how much there was.
pub(crate) fn fitting(texts: Texts, build: impl Fn(Texts) -> Status) -> Status {
    let mut status = build(texts.clone());
    for limit in TEXT_BYTES_MAX {
        if size_bytes(&status) <= STATUS_BYTES_MAX {
            return status;
        }
        status = build(shortened(&texts, limit));
    }
    let mut shortest = shortened(&texts, TEXT_BYTES_MAX[TEXT_BYTES_MAX.len() - 1]);
    while size_bytes(&status) > STATUS_BYTES_MAX && shortest.wrong.len() > 1 {
        shortest.wrong.pop();
        status = build(shortest.clone());
    }
    status
}

/// Size of the headers with a status \[bytes\], as HTTP/2 counts them: 32 for each header.
fn size_bytes(status: &Status) -> usize {
    let mut headers = HeaderMap::new();
    match status.add_header(&mut headers) {
        Ok(()) => headers.iter().map(|(name, value)| name.as_str().len() + value.len() + 32).sum(),
        Err(_) => usize::MAX,
    }
}

fn shortened(texts: &Texts, limit_bytes: usize) -> Texts {
    let wrong = texts.wrong.iter().map(|wrong| WrongField {
        field: cut(&wrong.field, limit_bytes / 2),
        problem: cut(&wrong.problem, limit_bytes / 2),
        fix: wrong.fix.map(|fix| cut(fix, limit_bytes / 2)),
    });
    Texts {
        message: cut(&texts.message, limit_bytes),
        about: cut(&texts.about, limit_bytes / 2),
        wrong: wrong.collect(),
    }
}

/// The beginning of a text, and how much of it is left out.
fn cut(text: &str, limit_bytes: usize) -> String {
    if text.len() <= limit_bytes {
        return text.to_owned();
    }
    let end = text.floor_char_boundary(limit_bytes);
    format!("{}… ({} more bytes)", &text[..end], text.len() - end)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::status;
    use lightpath_service::{Field, ServiceError, all_of};
    use tonic_types::StatusExt as _;

    /// Refusals of every size and character set fit into what clients accept.
    #[test]
    fn every_refusal_fits_into_the_headers_that_clients_accept() {
        for text in ["a", "\u{202e}", "%", "\n", "ä 😀"] {
            for length in [1, 100, 1000, 10_000, 100_000] {
                let long = text.repeat(length);
                let wrong = |count: usize| (0..count).map(|_| Field::new(&long).invalid(long.clone(), long.clone()));
                let field = Field::new("a").at(&"b".repeat(length.min(50)));
                let fields = (0..40).map(|index| field.index(index).invalid(long.clone(), "no"));
                let denied = ServiceError::Denied(long.clone());
                for error in
                    [all_of(wrong(1)), all_of(wrong(2)), all_of(fields), denied, field.missing(long.clone(), "no")]
                {
                    let code = status::code(&error);
                    let found = status::of(error);
                    assert!(size_bytes(&found) <= STATUS_BYTES_MAX, "{length} of {text:?}: {}", size_bytes(&found));
                    assert_eq!(found.code(), code);
                    assert!(found.get_error_details().error_info().is_some());
                }
            }
        }
    }

    #[test]
    fn cut_refusals_say_how_much_there_was() {
        let field = Field::new("x");
        let status = status::of(all_of((0..40).map(|index| field.index(index).invalid("y".repeat(700), "no"))));
        let named = status.get_error_details().bad_request().unwrap().field_violations.len();
        assert!((2..12).contains(&named), "{named}");
        assert!(
            status.message().starts_with("40 fields of the request are wrong:\n  x[0] yyy"),
            "{}",
            status.message()
        );
        assert!(status.message().ends_with(&format!("and {} more", 40 - named)), "{}", status.message());
        let one = status::of(field.invalid("no", "z".repeat(100_000)));
        assert!(one.message().ends_with("more bytes)"), "{}", one.message());
        let short = status::of(field.but("is 3", "must be 4"));
        assert_eq!(short.message(), "x is 3, but must be 4");
    }
}
