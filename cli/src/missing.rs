//! What to do about a name that does not exist: which name was probably meant, which there are, and how to make one.
//!
//! The names come from the lists that this caller may see, so a suggestion tells nothing that is hidden.

use super::failure::{Failure, TargetFailure};
use super::session::Session;
use super::show;
use lightpath::{names, units, v1};

/// Distances that differ by less are the same: they are stored in whole nanometres \[m\].
const SAME_M: f64 = 0.5e-9;
/// Names that are listed if none is near to the given one.
const LISTED_MAX: usize = 6;
/// Names among which one that was meant is searched.
const CANDIDATES_MAX: u32 = 500;

/// The same failure. One about a name that does not exist says also what to do.
pub(crate) async fn explained(session: &Session, failure: Failure) -> Failure {
    let refusal = match &failure {
        Failure::Client(lightpath::Error::Refused(refusal))
        | Failure::Target(TargetFailure { error: lightpath::Error::Refused(refusal), .. }) => refusal,
        _ => return failure,
    };
    match advice(session, &refusal.missing_resource()).await {
        Some(advice) => Failure::Advised(Box::new(failure), advice),
        None => failure,
    }
}

/// What to do if `resource`, such as `displays/lab`, does not exist. `None`: nothing is known about such names.
async fn advice(session: &Session, resource: &str) -> Option<String> {
    match resource.split('/').collect::<Vec<_>>().as_slice() {
        ["displays", id] => {
            let there = displays(session).await;
            let create = format!(
                "to declare it: lightpath display create {id} --resolution 1920x1080 \\\n      --pixel-pitch 8um --wavelength 515nm"
            );
            Some(format!("{}\n  {create}", which(id, &there, "lightpath display list")))
        }
        ["datasets", id] => {
            let there = datasets(session, "").await;
            let ids: Vec<String> = there.iter().map(|dataset| names::id(&dataset.name).to_owned()).collect();
            let create = format!("to create it: lightpath dataset create {id} --display DISPLAY --distance 150mm");
            Some(format!("{}\n  {create}", which(id, &ids, "lightpath dataset list")))
        }
        ["displays", id, "kernels", _] => Some(format!(
            "see which kernels there are: lightpath kernel list --display {id}\n  to learn one: lightpath kernel learn --help"
        )),
        ["displays", _, "kernels", _, "versions", _] => {
            let kernel = resource.split("/versions/").next().unwrap_or_default();
            Some(format!("see which versions there are: lightpath kernel versions {kernel}"))
        }
        ["jobs", _] => Some("see which jobs there are: lightpath job list".to_owned()),
        ["webhooks", _] => Some("see which webhooks there are: lightpath webhook list".to_owned()),
        _ => None,
    }
}

/// The failure of a command that needs a kernel where a display has none: `optics` says where, such as `at 150 mm`.
pub(crate) async fn kernel(session: &Session, display: &str, distance_m: f64, optics: &str) -> Failure {
    // A display that does not exist has no kernel, either.
    if let Err(error) = session.client.get_display(v1::GetDisplayRequest { name: names::display(display) }).await {
        return error.into();
    }
    let here = |dataset: &&v1::Dataset| {
        let there_m = dataset.place.as_ref().and_then(v1::Place::distance_m);
        there_m.is_some_and(|there_m| (there_m - distance_m).abs() < SAME_M)
    };
    let learn = match datasets(session, &names::display(display)).await.iter().find(here) {
        Some(dataset) => format!("to learn one: lightpath kernel learn --dataset {} --wait", names::id(&dataset.name)),
        None => format!(
            "to learn one, collect photographs of holograms:\n    lightpath dataset create NAME --display {display} --distance {}\n    \
             lightpath dataset add NAME --patterns holograms/ --photos photos/\n    lightpath dataset finalize NAME\n    \
             lightpath kernel learn --dataset NAME --wait",
            units::show_m(distance_m).replace(' ', "")
        ),
    };
    Failure::Refused(format!(
        "display {display} has no kernel {optics}\n  {learn}\n  see which kernels there are: lightpath kernel list --display {display}"
    ))
}

/// Refuses a display that does not exist, for lists that are empty then. An empty name stands for all displays.
pub(crate) async fn check_display(session: &Session, display: &str) -> Result<(), Failure> {
    if !display.is_empty() {
        session.client.get_display(v1::GetDisplayRequest { name: display.to_owned() }).await?;
    }
    Ok(())
}

/// Ids of displays. None if they cannot be listed, because advice is not worth another error.
async fn displays(session: &Session) -> Vec<String> {
    let request = v1::ListDisplaysRequest { page_size: CANDIDATES_MAX, ..Default::default() };
    let found = session.client.list_displays(request).await.map(|list| list.displays).unwrap_or_default();
    found.iter().map(|display| names::id(&display.name).to_owned()).collect()
}

/// Datasets of a display, newest first, or of all displays.
async fn datasets(session: &Session, display: &str) -> Vec<v1::Dataset> {
    let request =
        v1::ListDatasetsRequest { page_size: CANDIDATES_MAX, display: display.to_owned(), ..Default::default() };
    session.client.list_datasets(request).await.map(|list| list.datasets).unwrap_or_default()
}

/// The name that was probably meant; without one, the names that there are, or the command that lists them.
fn which(given: &str, there: &[String], list: &str) -> String {
    let near = there.iter().map(|name| (distance(given, name), name)).min();
    match near {
        Some((changes, name)) if changes <= changes_max(given) => format!("did you mean {}?", show::plain(name)),
        _ if there.is_empty() => "there is none yet".to_owned(),
        _ if there.len() <= LISTED_MAX => format!("there are: {}", show::plain(&there.join(", "))),
        _ => format!("see which there are: {list}"),
    }
}

/// Changes up to which one name was probably meant as another one: fewer in a short name, which resembles many.
fn changes_max(name: &str) -> usize {
    match name.chars().count() {
        0..=3 => 1,
        4..=8 => 2,
        _ => 3,
    }
}

/// The smallest number of changes that make one name of another, without regard to case: a character is inserted, removed or
/// replaced, or two neighbours change places (the optimal string alignment after Damerau 1964).
fn distance(from: &str, to: &str) -> usize {
    let [from, to] = [from, to].map(|name| name.to_lowercase().chars().collect::<Vec<_>>());
    let mut rows = vec![(0..=to.len()).collect::<Vec<_>>()];
    for i in 1..=from.len() {
        let mut row = vec![i];
        for j in 1..=to.len() {
            let replaced = rows[i - 1][j - 1] + usize::from(from[i - 1] != to[j - 1]);
            let changed = replaced.min(rows[i - 1][j] + 1).min(row[j - 1] + 1);
            let is_swap = i > 1 && j > 1 && from[i - 1] == to[j - 2] && from[i - 2] == to[j - 1];
            row.push(if is_swap { changed.min(rows[i - 2][j - 2] + 1) } else { changed });
        }
        rows.push(row);
    }
    rows[from.len()][to.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_names_are_suggested_and_others_listed() {
        let there = |names: &str| names.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        for (given, names, text) in [
            ("benhc", "pluto bench", "did you mean bench?"),
            ("LBA", "lab", "did you mean lab?"),
            ("frist-2", "first-1 first-2", "did you mean first-2?"),
            ("lab", "pca", "there are: pca"),
            ("nowhere", "", "there is none yet"),
            ("nowhere", "a b c d e f g", "see which there are: lightpath display list"),
        ] {
            assert_eq!(which(given, &there(names), "lightpath display list"), text, "{given}");
        }
        assert_eq!(["", "kitten", "flaw", "istting"].map(|name| distance(name, "sitting")), [7, 3, 7, 1]);
    }
}
