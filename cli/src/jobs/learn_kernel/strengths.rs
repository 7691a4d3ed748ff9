//! The parts that a learned display needed, as text: how strong they are, how certain that is, and what the photographs
//! could not show.

use crate::table::Facts;
use lightpath::v1::{LearnKernelResult, Part};

/// Adds the parts of the display to the facts about a result.
pub(super) fn add(result: &LearnKernelResult, facts: &mut Facts) {
    for Part { name, text, .. } in result.parts.iter().filter(|part| part.kept()) {
        facts.add(&name.replace('_', " "), text);
    }
    let hidden = result.parts.iter().filter(|part| !part.kept() && !part.text.is_empty());
    let hidden: Vec<String> = hidden.map(|part| format!("{} up to {}", part.title, part.text)).collect();
    facts.add_some("could be hidden", (!hidden.is_empty()).then(|| hidden.join("; ")));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kept_parts_are_facts_and_what_could_hide_is_named() {
        let part = |name: &str, title: &str, kept, text: &str| Part {
            name: name.to_owned(),
            title: title.to_owned(),
            kept: Some(kept),
            text: text.to_owned(),
            ..Default::default()
        };
        let parts = vec![
            part("light_blur", "blur of the light", true, "σ 0.45 ± 0.01 px along x, 0.300 ± 0.002 px along y"),
            part("uneven_response", "change of the response", false, "0.4 % RMS"),
            part("ghost", "ghost", false, ""),
        ];
        let mut facts = Facts::default();
        add(&LearnKernelResult { parts, ..Default::default() }, &mut facts);
        let text = facts.text();
        assert!(text.contains("light blur"), "{text}");
        assert!(text.contains("σ 0.45 ± 0.01 px along x, 0.300 ± 0.002 px along y"), "{text}");
        assert!(text.contains("change of the response up to 0.4 % RMS") && !text.contains("ghost"), "{text}");
    }
}
