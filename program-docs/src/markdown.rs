//! A reference in Markdown: all commands of a program with their arguments, options and examples.

use clap::builder::StyledStr;
use clap::{Arg, ArgAction, Command};

/// Returns a document with a chapter for the program and one for each of its commands. It depends only on the definition
/// of the command line: not on the terminal, the environment or the time.
#[must_use]
pub fn markdown(mut program: Command) -> String {
    program.build();
    let mut text = String::new();
    contents(&program, &mut text);
    chapter(&program, 2, &mut text);
    text
}

/// Links to all chapters.
fn contents(command: &Command, text: &mut String) {
    for sub in visible(command) {
        let name = full_name(sub);
        let about = first_line(sub.get_about());
        text.push_str(&format!("{}- [{name}](#{}): {about}\n", indent(sub), anchor(&name)));
        contents(sub, text);
    }
}

/// Spaces before an entry of the contents: two for each command that it belongs to, except the program.
fn indent(command: &Command) -> String {
    let depth = full_name(command).split(' ').count().saturating_sub(2);
    "  ".repeat(depth)
}

fn chapter(command: &Command, level: usize, text: &mut String) {
    let name = full_name(command);
    text.push_str(&format!("\n{} {name}\n", "#".repeat(level.min(4))));
    let about = command.get_long_about().or_else(|| command.get_about());
    text.push_str(&paragraphs(about));
    text.push_str(&format!("\n```text\n{}\n```\n", usage(command)));
    let (values, options): (Vec<&Arg>, Vec<&Arg>) =
        own_arguments(command).into_iter().partition(|argument| argument.is_positional());
    table("Argument", &values, text);
    let mut headings: Vec<Option<&str>> = Vec::new();
    for option in &options {
        if !headings.contains(&option.get_help_heading()) {
            headings.push(option.get_help_heading());
        }
    }
    for heading in headings {
        let part: Vec<&Arg> = options.iter().copied().filter(|option| option.get_help_heading() == heading).collect();
        table(heading.unwrap_or("Option"), &part, text);
    }
    let after = command.get_after_long_help().or_else(|| command.get_after_help());
    if let Some(after) = after {
        text.push_str(&examples(&after.to_string()));
    }
    for sub in visible(command) {
        chapter(sub, level + 1, text);
    }
}

/// Commands that `--help` shows, without `help`.
fn visible(command: &Command) -> impl Iterator<Item = &Command> {
    command.get_subcommands().filter(|sub| !sub.is_hide_set() && sub.get_name() != "help")
}

/// Arguments of the command that `--help` shows. Global options are only in the chapter of the program.
fn own_arguments(command: &Command) -> Vec<&Arg> {
    let is_program = !full_name(command).contains(' ');
    let is_own = |argument: &&Arg| {
        !argument.is_hide_set()
            && !matches!(argument.get_id().as_str(), "help" | "version")
            && (is_program || !argument.is_global_set())
    };
    command.get_arguments().filter(is_own).collect()
}

/// The name with those of the commands above, for example `lightpath job list`.
fn full_name(command: &Command) -> String {
    command.get_bin_name().unwrap_or(command.get_name()).to_owned()
}

fn usage(command: &Command) -> String {
    const TITLE: &str = "Usage: ";
    let usage = command.clone().render_usage().to_string();
    // Further lines stand below the first one.
    usage.trim_start_matches(TITLE).trim().replace(&format!("\n{}", " ".repeat(TITLE.len())), "\n")
}

fn table(title: &str, arguments: &[&Arg], text: &mut String) {
    if arguments.is_empty() {
        return;
    }
    text.push_str(&format!("\n| {title} | Meaning |\n|---|---|\n"));
    for argument in arguments {
        text.push_str(&format!("| {} | {} |\n", syntax(argument), cell(&meaning(argument))));
    }
}

/// How an argument is written, for example `` `-o FILE` ``.
fn syntax(argument: &Arg) -> String {
    let names: Vec<String> = argument.get_value_names().unwrap_or_default().iter().map(ToString::to_string).collect();
    let values = match names.as_slice() {
        [] => argument.get_id().as_str().to_uppercase(),
        names => names.join(" "),
    };
    if argument.is_positional() {
        let many = argument.get_num_args().is_some_and(|count| count.max_values() > 1);
        return format!("`{values}{}`", if many { "…" } else { "" });
    }
    let mut forms = Vec::new();
    forms.extend(argument.get_short().map(|short| format!("-{short}")));
    forms.extend(argument.get_long().map(|long| format!("--{long}")));
    let takes_values = matches!(argument.get_action(), ArgAction::Set | ArgAction::Append);
    format!("`{}{}`", forms.join(", "), if takes_values { format!(" {values}") } else { String::new() })
}

/// What an argument means, with its default, its possible values and its environment variable.
fn meaning(argument: &Arg) -> String {
    let mut text =
        argument.get_long_help().or_else(|| argument.get_help()).map(ToString::to_string).unwrap_or_default();
    let takes_values = matches!(argument.get_action(), ArgAction::Set | ArgAction::Append);
    let values = argument.get_possible_values();
    let shown: Vec<_> = values.iter().filter(|value| !value.is_hide_set()).collect();
    if takes_values && !argument.is_hide_possible_values_set() && !shown.is_empty() {
        let words: Vec<String> = shown
            .iter()
            .map(|value| match value.get_help() {
                Some(help) => format!("`{}`: {}", value.get_name(), help.to_string().trim_end_matches('.')),
                None => format!("`{}`", value.get_name()),
            })
            .collect();
        text += &format!("\n\nValues: {}", words.join("; "));
    }
    if takes_values && !argument.is_hide_default_value_set() && !argument.get_default_values().is_empty() {
        let defaults: Vec<_> = argument.get_default_values().iter().map(|value| value.to_string_lossy()).collect();
        text += &format!("\n\nDefault: `{}`", defaults.join(" "));
    }
    if let Some(variable) = argument.get_env() {
        text += &format!("\n\nEnvironment: `{}`", variable.to_string_lossy());
    }
    text
}

/// A text in one cell of a table.
fn cell(text: &str) -> String {
    let lines = text.split("\n\n").map(str::trim).filter(|line| !line.is_empty());
    let lines: Vec<String> = lines.map(|line| escaped(&line.replace('\n', " "))).collect();
    lines.join("<br>").replace('|', "\\|")
}

fn paragraphs(text: Option<&StyledStr>) -> String {
    let text = text.map(ToString::to_string).unwrap_or_default();
    // clap removes the full stop of a single sentence.
    let full_stop = |paragraph: &str| if paragraph.ends_with(['.', ':']) { "" } else { "." };
    let paragraph = |paragraph: &str| {
        let line = escaped(&paragraph.trim().replace('\n', " "));
        format!("\n{line}{}\n", full_stop(&line))
    };
    text.split("\n\n").map(paragraph).collect()
}

fn first_line(text: Option<&StyledStr>) -> String {
    let text = text.map(ToString::to_string).unwrap_or_default();
    escaped(text.lines().next().unwrap_or_default())
}

/// The text after the options: lines that are indented are code.
fn examples(text: &str) -> String {
    let mut markdown = String::new();
    let mut is_code = false;
    for line in text.lines() {
        let indented = line.starts_with(' ');
        // An empty line between two lines of code belongs to the code.
        if line.is_empty() && is_code {
            markdown.push('\n');
            continue;
        }
        if indented != is_code {
            if is_code {
                let code = markdown.trim_end().len();
                markdown.truncate(code);
                markdown.push('\n');
            }
            markdown.push_str(if indented { "\n```text\n" } else { "```\n" });
            is_code = indented;
        }
        if indented {
            markdown.push_str(&format!("{}\n", line.strip_prefix("  ").unwrap_or(line)));
        } else if !line.is_empty() {
            markdown.push_str(&format!("\n{}\n", escaped(line)));
        }
    }
    if is_code {
        let code = markdown.trim_end().len();
        markdown.truncate(code);
        markdown.push_str("\n```\n");
    }
    markdown
}

/// A text whose signs mean nothing in Markdown or HTML, outside of code between backticks.
fn escaped(text: &str) -> String {
    let mut escaped = String::new();
    let mut is_code = false;
    for character in text.chars() {
        is_code ^= character == '`';
        match character {
            '<' if !is_code => escaped.push_str("&lt;"),
            '*' | '_' | '[' | ']' if !is_code => {
                escaped.push('\\');
                escaped.push(character);
            }
            other => escaped.push(other),
        }
    }
    escaped
}

/// The part of a link that leads to a heading.
fn anchor(heading: &str) -> String {
    heading.replace(' ', "-")
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::builder::PossibleValue;

    fn program() -> Command {
        let state =
            Arg::new("state").long("state").value_parser([PossibleValue::new("open").help("Open.")]).help("Only [x]");
        let out = Arg::new("out").short('o').value_name("FILE").help("Write here").help_heading("Output files");
        let all = Arg::new("all").long("all").action(ArgAction::SetTrue).help("All of them");
        let server =
            Arg::new("server").long("server").global(true).env("TOOL_SERVER").default_value("a|b").help("Ask it");
        let ids = Arg::new("ids").value_name("ID").num_args(1..).required(true).help("Ids");
        let list = Command::new("list")
            .about("List jobs")
            .long_about("List jobs.\n\nThe newest first.")
            .args([ids, state, out, all])
            .after_long_help("Examples:\n  tool list 1\n\n  tool list 2\n\nExit codes: 0.");
        Command::new("tool").about("Do it").arg(server).subcommand(list).subcommand(Command::new("x").hide(true))
    }

    #[test]
    fn every_visible_command_has_a_chapter_with_all_its_options() {
        let text = markdown(program());
        for part in [
            "- [tool list](#tool-list): List jobs\n",
            "\n## tool\n\nDo it.\n",
            "| `--server SERVER` | Ask it<br>Default: `a\\|b`<br>Environment: `TOOL_SERVER` |",
            "\n### tool list\n\nList jobs.\n\nThe newest first.\n\n```text\ntool list [OPTIONS] <ID>...\n```\n",
            "| Argument | Meaning |\n|---|---|\n| `ID…` | Ids |\n",
            "| `--state STATE` | Only \\[x\\]<br>Values: `open`: Open |\n| `--all` | All of them |\n",
            "| Output files | Meaning |\n|---|---|\n| `-o FILE` | Write here |",
            "\nExamples:\n\n```text\ntool list 1\n\ntool list 2\n```\n\nExit codes: 0.\n",
        ] {
            assert!(text.contains(part), "{part}\n---\n{text}");
        }
        assert_eq!(text.matches("--server").count(), 1, "global options are explained once");
        assert_eq!(
            text.matches("| `--all`").count(),
            1,
            "each option is explained once, also behind another heading's"
        );
        assert!(!text.contains("tool x"));
    }
}
