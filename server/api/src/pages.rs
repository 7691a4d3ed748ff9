//! Pages of lists: their sizes, and the tokens for the next pages.

use lightpath_service::{Field, Result};
use prost::Message;

/// Items on a page by default.
const PAGE_SIZE_DEFAULT: u32 = 50;
/// Limit on the items on a page: as many as one query should return.
const PAGE_SIZE_MAX: u32 = 1000;
/// Limit on the size of a page \[bytes\]. By default gRPC clients refuse messages above 4 MiB.
const PAGE_BYTES_MAX: usize = 3 << 20;
/// Limit on the length of a page token \[bytes\]. The tokens of the server are shorter.
const TOKEN_BYTES_MAX: usize = 1024;

/// A request for a page of a list.
///
/// A token is `list \n filter \n key` in hexadecimal digits. So a token from another list, or from the same list with
/// another filter, is recognized and refused.
#[derive(Debug)]
pub(crate) struct Page {
    list: String,
    /// Key of the item before the page; `None`: the first page.
    pub(crate) after: Option<String>,
    size: u32,
}

impl Page {
    /// Checks the request for a page. `list` names the list and its filter.
    pub(crate) fn new(list: &[&str], page_size: u32, page_token: &str) -> Result<Self> {
        // The size of a page alone has a zero for its default, as AIP-158 of Google's API guide says.
        let given = (page_size > 0).then_some(page_size);
        let size = Field::new("page_size").integer_or(given, PAGE_SIZE_DEFAULT, 1..=PAGE_SIZE_MAX)?;
        let list = list.join(" ");
        let after = match page_token {
            "" => None,
            token => Some(key_of(token, &list).ok_or_else(|| {
                let rule = "must be a next_page_token of the same list, or empty for the first page";
                Field::new("page_token").but("is unknown", rule)
            })?),
        };
        Ok(Self { list, after, size })
    }

    /// Number of items to read from the store: one more than the page holds, to find out whether there is a next page.
    pub(crate) fn limit(&self) -> u32 {
        self.size + 1
    }

    /// The messages of the items that fit on the page, and the token of the next page (empty after the last page).
    pub(crate) fn fill<T, M: Message>(
        &self,
        items: Vec<T>,
        key: impl Fn(&T) -> String,
        to_wire: impl Fn(T) -> M,
    ) -> (Vec<M>, String) {
        let (mut messages, mut bytes, mut last) = (Vec::new(), 0, String::new());
        for item in items {
            let item_key = key(&item);
            let message = to_wire(item);
            bytes += message.encoded_len();
            let full = messages.len() == self.size as usize || bytes > PAGE_BYTES_MAX;
            if full && !messages.is_empty() {
                return (messages, token_of(&self.list, &last));
            }
            messages.push(message);
            last = item_key;
        }
        (messages, String::new())
    }

    /// The key [`Self::after`] as a number.
    pub(crate) fn after_number<T: std::str::FromStr>(&self) -> Result<Option<T>> {
        let number = self.after.as_deref().map(str::parse).transpose();
        number.map_err(|_| Field::new("page_token").but("is damaged", "must be a next_page_token"))
    }
}

fn token_of(list: &str, key: &str) -> String {
    format!("{list}\n{key}").bytes().map(|byte| format!("{byte:02x}")).collect()
}

fn key_of(token: &str, list: &str) -> Option<String> {
    if token.len() > TOKEN_BYTES_MAX || !token.len().is_multiple_of(2) || !token.is_ascii() {
        return None;
    }
    let byte = |at: usize| u8::from_str_radix(&token[at..at + 2], 16).ok();
    let bytes: Vec<u8> = (0..token.len()).step_by(2).map(byte).collect::<Option<_>>()?;
    let text = String::from_utf8(bytes).ok()?;
    let (of_list, key) = text.split_once('\n')?;
    (of_list == list).then(|| key.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fill(page: &Page, items: &[&str]) -> (Vec<String>, String) {
        page.fill(items.to_vec(), ToString::to_string, ToString::to_string)
    }

    #[test]
    fn next_page_token_continues_the_list() {
        let first = Page::new(&["displays"], 2, "").unwrap();
        assert_eq!((first.limit(), &first.after), (3, &None));
        let (items, token) = fill(&first, &["a", "b", "c"]);
        assert_eq!(items, ["a", "b"]);
        let second = Page::new(&["displays"], 2, &token).unwrap();
        assert_eq!(second.after.as_deref(), Some("b"));
        assert_eq!(fill(&second, &["c"]), (vec!["c".to_owned()], String::new()));
        assert_eq!(fill(&first, &["a", "b"]).1, "", "a full page without further items is the last");
    }

    #[test]
    fn large_items_make_short_pages() {
        let page = Page::new(&["displays"], 0, "").unwrap();
        let large = "x".repeat(PAGE_BYTES_MAX / 2);
        let (items, token) = fill(&page, &[&large, "b", &large, "d"]);
        assert_eq!(items.len(), 2);
        assert_eq!(Page::new(&["displays"], 0, &token).unwrap().after.as_deref(), Some("b"));
        let huge = "x".repeat(PAGE_BYTES_MAX * 2);
        assert_eq!(fill(&page, &[&huge, "b"]).0.len(), 1, "one item always fits");
    }

    #[test]
    fn tokens_of_other_lists_are_refused() {
        let token = token_of("jobs lab-2", "17");
        assert_eq!(Page::new(&["jobs", "lab-2"], 0, &token).unwrap().after_number::<u32>().unwrap(), Some(17));
        for (list, token) in [
            (["jobs", "lab-3"], token.as_str()),
            (["jobs", "lab-2"], &token[1..]),
            (["jobs", "lab-2"], "xx"),
            (["jobs", "lab-2"], "ää"),
            (["jobs", "lab-2"], "+1"),
        ] {
            let refusal = Page::new(&list, 0, token).unwrap_err().to_string();
            assert!(refusal.starts_with("page_token is unknown"), "{refusal}");
        }
        assert!(Page::new(&["jobs"], 1001, "").is_err());
    }
}
