//! A check of the JSON in a file before anything is made of it.
//!
//! A tree of JSON takes up to a hundred times the memory of its text. And where a key stands twice, one reader sees the
//! first value and another one the last.

use crate::shortened::shortened;
use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use std::cell::Cell;
use std::collections::HashSet;
use std::fmt;

/// Largest number of values. The header of a kernel has some hundred with the record of its version, so that its tree
/// takes some megabytes at most.
const VALUES_MAX: usize = 50_000;

/// Refuses a text that is not JSON, has more than [`VALUES_MAX`] values, or has a key twice in an object. It keeps nothing
/// but the keys of the objects that it is in.
pub(super) fn require_small(text: &[u8]) -> Result<(), serde_json::Error> {
    let left = Cell::new(VALUES_MAX);
    let mut json = serde_json::Deserializer::from_slice(text);
    Counted(&left).deserialize(&mut json)?;
    json.end()
}

/// A value that is passed over, and the number of values that may follow.
#[derive(Clone, Copy)]
struct Counted<'a>(&'a Cell<usize>);

impl Counted<'_> {
    fn count<E: Error>(self) -> Result<(), E> {
        let left = self.0.get().checked_sub(1);
        self.0.set(left.ok_or_else(|| E::custom(format_args!("it has more than {VALUES_MAX} values")))?);
        Ok(())
    }
}

impl<'de> DeserializeSeed<'de> for Counted<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Counted<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_unit<E: Error>(self) -> Result<(), E> {
        self.count()
    }

    fn visit_bool<E: Error>(self, _: bool) -> Result<(), E> {
        self.count()
    }

    fn visit_u64<E: Error>(self, _: u64) -> Result<(), E> {
        self.count()
    }

    fn visit_i64<E: Error>(self, _: i64) -> Result<(), E> {
        self.count()
    }

    fn visit_f64<E: Error>(self, _: f64) -> Result<(), E> {
        self.count()
    }

    fn visit_str<E: Error>(self, _: &str) -> Result<(), E> {
        self.count()
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        self.count()?;
        while list.next_element_seed(self)?.is_some() {}
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut object: A) -> Result<(), A::Error> {
        self.count()?;
        let mut keys = HashSet::new();
        while let Some(key) = object.next_key::<String>()? {
            object.next_value_seed(self)?;
            if let Some(key) = keys.replace(key) {
                return Err(A::Error::custom(format_args!("duplicate field `{}`", shortened(key))));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_trees_and_keys_that_stand_twice_are_refused() {
        let refusal = |text: &str| require_small(text.as_bytes()).unwrap_err().to_string();
        require_small(br#"{"a":[1,-1,0.5,null,true,{"a":"b"}],"b":{"a":1}}  "#).unwrap();
        assert!(refusal(r#"{"a":1,"b":{"c":1,"c":2}}"#).contains("duplicate field `c`"));
        assert!(refusal(&format!("[{}0]", "0,".repeat(VALUES_MAX))).contains("more than 50000 values"));
        assert!(refusal(&"[".repeat(1000)).contains("recursion limit"));
        assert!(require_small(b"{} {}").is_err() && require_small(b"{").is_err());
    }
}
