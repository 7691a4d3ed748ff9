//! Simulated benches in TOML files. The keys are the field names of the message [`SimulatedBench`].

use crate::failure::Failure;
use crate::inputs;
use lightpath::v1::SimulatedBench;
use std::path::Path;

/// Name of the bench that comes with the program, and its file.
const LIKE_THE_PAPER: (&str, &str) = ("like-the-paper", include_str!("../../../docs/like-the-paper.toml"));

/// Reads a bench from a file, or takes the one that comes with the program by its name. All properties are optional.
pub(super) fn read(path: &Path) -> Result<SimulatedBench, Failure> {
    if path.as_os_str() == LIKE_THE_PAPER.0 {
        return parse(LIKE_THE_PAPER.1).map_err(Failure::Usage);
    }
    let text = inputs::text(path)?;
    parse(&text).map_err(|problem| Failure::Usage(format!("{}: {problem}", path.display())))
}

fn parse(text: &str) -> Result<SimulatedBench, String> {
    let table: toml::Table = text.parse().map_err(|error: toml::de::Error| error.to_string())?;
    if let Some(name) = table.keys().find(|name| !names().contains(name)) {
        return Err(format!("there is no property {name}; the properties are: {}", names().join(", ")));
    }
    toml::from_str(text).map_err(|error| error.to_string())
}

/// Name and value of each property that is not 0, except the seed. Names are those of the file.
pub(super) fn properties(bench: &SimulatedBench) -> Vec<(String, f64)> {
    let value =
        |(name, value): (String, serde_json::Value)| Some((name, value.as_f64().filter(|value| *value != 0.0)?));
    values(bench).into_iter().filter_map(value).collect()
}

/// Names of all properties in the file.
fn names() -> Vec<String> {
    // Only properties that are set have a name in JSON.
    let bench = SimulatedBench {
        strength: Some(1.0),
        camera_noise: Some(1.0),
        full_well_electrons: Some(1.0),
        aberrations_at_m: Some(1.0),
        ..SimulatedBench::default()
    };
    values(&bench).into_iter().map(|(name, _)| name).collect()
}

/// Name and value of each property. The value of the seed is a string, as in protobuf's JSON form.
fn values(bench: &SimulatedBench) -> Vec<(String, serde_json::Value)> {
    let Ok(serde_json::Value::Object(values)) = serde_json::to_value(bench) else { return Vec::new() };
    values.into_iter().map(|(name, value)| (snake_case(&name), value)).collect()
}

/// Converts a name of protobuf's JSON form, such as `blurPx`, into snake case, such as `blur_px`.
fn snake_case(name: &str) -> String {
    let mut snake = String::new();
    for character in name.chars() {
        if character.is_ascii_uppercase() {
            snake.push('_');
        }
        snake.push(character.to_ascii_lowercase());
    }
    snake
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{DAMAGED, damaged};

    const DOCUMENTED: &str = include_str!("../../../docs/bench.toml");

    #[test]
    fn documented_file_has_every_property() {
        let bench = parse(DOCUMENTED).unwrap();
        assert_eq!(bench.seed, 7);
        assert_eq!(properties(&bench).len() + 1, names().len(), "every property of the documented file is not 0");
    }

    #[test]
    fn bench_like_the_paper_comes_with_the_program() {
        let bench = read(Path::new(LIKE_THE_PAPER.0)).unwrap();
        assert_eq!((bench.seed, bench.surface_waves, bench.ghost_share), (2022, 1.0, 0.02));
    }

    #[test]
    fn damaged_files_never_panic_the_parser() {
        let accepted = damaged(DOCUMENTED).filter(|text| parse(text).is_ok()).count();
        assert!((1..DAMAGED).contains(&accepted), "{accepted} were accepted");
    }

    #[test]
    fn all_properties_are_optional() {
        assert_eq!(parse("").unwrap(), SimulatedBench::default());
        let bench = parse("seed = 7\nblur_px = 0.5").unwrap();
        assert_eq!(bench, SimulatedBench { seed: 7, blur_px: 0.5, ..Default::default() });
        assert_eq!(properties(&bench), [("blur_px".to_owned(), 0.5)]);
    }

    #[test]
    fn error_for_misspelt_property_lists_valid_ones() {
        let error = parse("blurr_px = 1.0").unwrap_err();
        assert!(error.contains("no property blurr_px") && error.contains("blur_px, "), "{error}");
        assert_eq!(parse("strength = 0.0").unwrap().strength, Some(0.0));
        assert!(parse("strength = \"much\"").is_err());
    }
}
