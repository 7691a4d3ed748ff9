//! A test of help texts: that a terminal of 80 columns shows them whole, and that they say what they should.

use clap::{Arg, Command};

/// Columns of a terminal that nobody has made wider.
const COLUMNS: usize = 80;

/// Checks the help of a program and of all its commands: each command and each argument has one, no line is longer than
/// 80 columns, examples need not be broken to fit, the usage names what must be given, and no backslash that belongs to
/// the documentation is shown. Set `max_term_width` to 80 to make clap break the other lines.
///
/// # Errors
///
/// A text with a line for each mistake.
pub fn check_help(mut program: Command) -> Result<(), String> {
    program.build();
    let mut mistakes = Vec::new();
    check(&program, &mut mistakes);
    if mistakes.is_empty() { Ok(()) } else { Err(mistakes.join("\n")) }
}

fn check(command: &Command, mistakes: &mut Vec<String>) {
    let name = command.get_bin_name().unwrap_or(command.get_name()).to_owned();
    if command.get_about().is_none() {
        mistakes.push(format!("{name} has no help"));
    }
    for argument in command.get_arguments().filter(|argument| !argument.is_hide_set()) {
        check_argument(&name, argument, mistakes);
    }
    let after = [command.get_after_help(), command.get_after_long_help()].into_iter().flatten();
    for text in after.map(ToString::to_string) {
        // clap breaks lines at any space. So it would break an example in the middle, and nobody could copy it.
        text.lines().filter(|line| line.starts_with("  ")).for_each(|line| check_width(&name, line, mistakes));
    }
    for text in [command.clone().render_help(), command.clone().render_long_help()].map(|text| text.to_string()) {
        text.lines().for_each(|line| check_width(&name, line, mistakes));
    }
    let usage = command.clone().render_usage().to_string();
    let names = |argument: &Arg| {
        let long = argument.get_long().map(|long| format!("--{long}"));
        [long, argument.get_short().map(|short| format!("-{short}"))].into_iter().flatten().collect::<Vec<_>>()
    };
    for required in command.get_arguments().filter(|argument| argument.is_required_set()) {
        let names = names(required);
        if !names.is_empty() && !names.iter().any(|name| usage.contains(&format!("{name} "))) {
            mistakes.push(format!("{name} needs {}, but its usage does not say so: {usage}", names[0]));
        }
    }
    command.get_subcommands().filter(|sub| !sub.is_hide_set()).for_each(|sub| check(sub, mistakes));
}

fn check_argument(name: &str, argument: &Arg, mistakes: &mut Vec<String>) {
    match argument.get_help().map(ToString::to_string) {
        None => mistakes.push(format!("{name} {} has no help", argument.get_id())),
        // Documentation escapes brackets, which a terminal would show as they are.
        Some(help) if help.contains('\\') => {
            mistakes.push(format!("{name} {} has a backslash: {help}", argument.get_id()));
        }
        Some(_) => {}
    }
}

fn check_width(name: &str, line: &str, mistakes: &mut Vec<String>) {
    let width = line.chars().count();
    if width > COLUMNS {
        mistakes.push(format!("the help of {name} has a line of {width} columns: {line}"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_mistake_is_found() {
        let long = "--option-with-a-long-name ".repeat(4);
        let size = Arg::new("size").long("size").required(true).help("Size \\[px\\]");
        let show = Command::new("show").about("Show it").override_usage("show").arg(size).arg(Arg::new("id"));
        let show = show.after_long_help(format!("Example:\n  tool show {long}"));
        let good = Command::new("tool").about("Do it").max_term_width(80).after_help(long.clone());
        assert_eq!(check_help(good.clone()), Ok(()), "text is wrapped");
        let mistakes = check_help(good.subcommand(show)).unwrap_err();
        for sign in
            ["show id has no help", "show size has a backslash", "has a line of 116 columns:   tool", "needs --size"]
        {
            assert!(mistakes.contains(sign), "{sign}\n{mistakes}");
        }
        assert!(check_help(Command::new("tool")).unwrap_err().contains("tool has no help"));
    }
}
