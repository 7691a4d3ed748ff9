//! Tests of the examples in help texts.

use super::*;

/// The words of the first command in a line of a shell.
fn words(line: &str) -> Vec<String> {
    let (mut words, mut word, mut quote) = (Vec::new(), String::new(), None);
    for character in line.chars() {
        match (quote, character) {
            (Some(open), close) if open == close => quote = None,
            (None, '"' | '\'') => quote = Some(character),
            (None, '|' | '>' | ';') => break,
            (None, ' ') => words.push(std::mem::take(&mut word)),
            (_, other) => word.push(other),
        }
    }
    words.push(word);
    words.retain(|word| !word.is_empty());
    words
}

#[test]
fn examples_are_commands_that_are_parsed() {
    fn check(command: &clap::Command, checked: &mut usize) {
        let help = command.get_after_long_help().map(ToString::to_string).unwrap_or_default();
        // A backslash at the end of a line continues the command.
        for line in help.replace("\\\n", " ").lines().map(str::trim).filter(|line| line.starts_with("lightpath ")) {
            let line = line.replace("PUBLIC-KEY", "3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c");
            let error = Cli::try_parse_from(words(&line)).err();
            assert!(error.as_ref().is_none_or(|error| error.exit_code() == 0), "{line}\n{error:?}");
            *checked += 1;
        }
        command.get_subcommands().for_each(|sub| check(sub, checked));
    }
    let mut checked = 0;
    check(&Cli::command(), &mut checked);
    assert!(checked > 30, "{checked} examples");
}

#[test]
fn commands_that_make_files_or_follow_jobs_teach_with_an_example() {
    let mut cli = Cli::command();
    cli.build();
    for path in [
        "job list",
        "job show",
        "job watch",
        "job cancel",
        "job retry",
        "job logs",
        "hologram optimize",
        "hologram save",
        "hologram verify",
        "simulate",
        "photo score",
        "kernel watch",
        "kernel fetch",
        "kernel export",
        "kernel report",
        "kernel compare",
        "kernel learn",
        "kernel promote",
        "dataset create",
        "dataset add",
        "dataset finalize",
        "dataset calibration",
        "dataset align",
        "doctor",
        "man",
        "completions",
    ] {
        let command = path.split(' ').fold(&cli, |command, name| command.find_subcommand(name).unwrap());
        let help = command.get_after_long_help().map(ToString::to_string).unwrap_or_default();
        assert!(help.contains(&format!("  lightpath {path}")), "{path} has no example of itself: {help}");
    }
}
