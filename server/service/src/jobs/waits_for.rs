//! Why a waiting job cannot start: no living process can run it.

use lightpath_domain::ability::Labels;
use lightpath_store::{Process, Store};

const GIB: f64 = 1_073_741_824.0;

/// Why no living process can run a job with these needs and this estimate of memory \[bytes\]; `None`: one can.
pub(super) fn no_process(store: &Store, needs: &Labels, memory_bytes: u64) -> Option<String> {
    // A server alone runs a job above its limit, which was lowered then.
    let memory_bytes = if store.is_shared() { memory_bytes } else { 0 };
    missing(&store.living(), needs, memory_bytes)
}

/// What none of the processes has of what a job needs.
fn missing(living: &[Process], needs: &Labels, memory_bytes: u64) -> Option<String> {
    let mut labelled =
        living.iter().filter(|process| process.works() && process.abilities.labels.contain(needs)).peekable();
    let named = match needs.iter().count() {
        0 => String::new(),
        1 => format!("the label {needs}"),
        _ => format!("the labels {needs}"),
    };
    if labelled.peek().is_none()
        && let Some(display) = needs.rig()
    {
        return Some(format!("no rig serves displays/{display}; start lightpath-rig at its bench"));
    }
    if labelled.peek().is_none() {
        return Some(match needs.is_empty() {
            true => "no living process runs jobs".to_owned(),
            false => format!("no living process that runs jobs has {named}"),
        });
    }
    if labelled.any(|process| process.abilities.give(memory_bytes)) {
        return None;
    }
    let with = if named.is_empty() { String::new() } else { format!(" with {named}") };
    Some(format!("no living process{with} gives a job {:.1} GiB", memory_bytes as f64 / GIB))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_domain::ability::Abilities;
    use lightpath_store::ProcessKind;

    fn process(kind: ProcessKind, labels: &str, memory_bytes: u64) -> Process {
        Process {
            id: String::new(),
            kind,
            name: String::new(),
            version: String::new(),
            abilities: Abilities { labels: Labels::parse(labels).unwrap(), memory_bytes, ..Abilities::default() },
            workers: 1,
            start_time_ms: 0,
            seen_time_ms: 0,
        }
    }

    #[test]
    fn text_says_what_no_process_has() {
        const GIB: u64 = 1 << 30;
        let living = [
            process(ProcessKind::Server, "gpu", 0),
            process(ProcessKind::Worker, "", 9 * GIB),
            process(ProcessKind::Both, "bench-2,lab", GIB),
        ];
        for (needs, bytes, expected) in [
            ("", 9 * GIB, None),
            ("", 40 * GIB, Some("no living process gives a job 40.0 GiB")),
            ("gpu", 0, Some("no living process that runs jobs has the label gpu")),
            ("gpu,lab", 0, Some("no living process that runs jobs has the labels gpu, lab")),
            ("lab", GIB, None),
            ("lab", GIB + GIB / 2, Some("no living process with the label lab gives a job 1.5 GiB")),
        ] {
            let found = missing(&living, &Labels::parse(needs).unwrap(), bytes);
            assert_eq!(found.as_deref(), expected, "{needs} {bytes}");
        }
        let no_rig = missing(&living, &Labels::of_rig("lab"), 0);
        assert_eq!(no_rig.as_deref(), Some("no rig serves displays/lab; start lightpath-rig at its bench"));
        let none = missing(&living[..1], &Labels::default(), 0);
        assert_eq!(none.as_deref(), Some("no living process runs jobs"));
    }
}
