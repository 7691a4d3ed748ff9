//! Masks of updates: which fields of a message a request changes.

use lightpath_service::{Field, Result, shortened};
use std::collections::BTreeSet;

/// The fields that a request changes, of those that it names or sets.
#[derive(Debug)]
pub(crate) struct Changes(BTreeSet<&'static str>);

impl Changes {
    /// Checks a mask. Without one, the fields that the message sets change; `*` stands for all. `fields` are the names of
    /// the fields that clients may send, each with whether the message sets it; `output` those that only the server
    /// sets, which are passed over. `changeable` says in a refusal what a mask can have.
    pub(crate) fn of(
        mask: Option<Vec<String>>,
        fields: &[(&'static str, bool)],
        output: &[&str],
        changeable: &str,
    ) -> Result<Self> {
        let paths = mask.unwrap_or_default();
        if paths.is_empty() {
            return Ok(Self(fields.iter().filter(|(_, is_set)| *is_set).map(|(name, _)| *name).collect()));
        }
        let mut named = BTreeSet::new();
        for (i, path) in paths.iter().enumerate() {
            // A part of a field that is a message stands for the field: none of those can change.
            let first = path.split('.').next().unwrap_or_default();
            match fields.iter().find(|(name, _)| *name == first) {
                Some((name, _)) => drop(named.insert(*name)),
                None if path == "*" => named.extend(fields.iter().map(|(name, _)| *name)),
                None if output.contains(&first) => {}
                None => {
                    let field = Field::new("update_mask.paths").index(i);
                    return Err(field.but(format!("is {:?}", shortened(path)), format!("must be {changeable}")));
                }
            }
        }
        Ok(Self(named))
    }

    /// Whether the field changes.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.0.contains(name)
    }
}
