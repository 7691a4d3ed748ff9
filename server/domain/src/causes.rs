//! Error messages in one line.

use std::error::Error;

/// The message of an error and of its causes, from the outermost to the innermost.
pub fn with_causes(error: &(dyn Error + 'static)) -> String {
    let causes = std::iter::successors(Some(error), |&error| error.source());
    causes.map(ToString::to_string).collect::<Vec<_>>().join(": ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn message_names_every_cause() {
        #[derive(Debug, thiserror::Error)]
        #[error("could not write a file")]
        struct Outer(#[source] std::io::Error);
        let error = Outer(std::io::Error::other("the disk failed"));
        assert_eq!(with_causes(&error), "could not write a file: the disk failed");
    }
}
