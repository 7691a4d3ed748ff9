//! Generates the names and help texts of the API's enumerations.

use prost_types::source_code_info::Location;
use prost_types::{DescriptorProto, EnumDescriptorProto, FileDescriptorProto};
use std::error::Error;
use std::fmt::Write as _;

/// Field numbers in descriptors. The path of a comment in `SourceCodeInfo` consists of such numbers and of indices.
const MESSAGE_IN_FILE: i32 = 4;
const ENUM_IN_FILE: i32 = 5;
const MESSAGE_IN_MESSAGE: i32 = 3;
const ENUM_IN_MESSAGE: i32 = 4;
const VALUE_IN_ENUM: i32 = 2;

/// Returns Rust code that implements `Words` for every enumeration of the API.
pub(crate) fn words_code(files: &[FileDescriptorProto]) -> Result<String, Box<dyn Error>> {
    let mut code = String::new();
    for file in files.iter().filter(|file| file.package() == "lightpath.v1") {
        let comments = file.source_code_info.as_ref().map_or(&[][..], |info| &info.location);
        for (i, enumeration) in (0..).zip(&file.enum_type) {
            write_words(&mut code, "", enumeration, comments, &[ENUM_IN_FILE, i])?;
        }
        for (i, message) in (0..).zip(&file.message_type) {
            write_words_of_message(&mut code, "", message, comments, &[MESSAGE_IN_FILE, i])?;
        }
    }
    Ok(code)
}

/// Writes the implementations for the enumerations in a message and in its nested messages. `path` is the path of the
/// message.
fn write_words_of_message(
    code: &mut String,
    module: &str,
    message: &DescriptorProto,
    comments: &[Location],
    path: &[i32],
) -> Result<(), Box<dyn Error>> {
    let module = format!("{module}{}::", snake_case(message.name()));
    for (i, enumeration) in (0..).zip(&message.enum_type) {
        write_words(code, &module, enumeration, comments, &[path, &[ENUM_IN_MESSAGE, i]].concat())?;
    }
    for (i, nested) in (0..).zip(&message.nested_type) {
        write_words_of_message(code, &module, nested, comments, &[path, &[MESSAGE_IN_MESSAGE, i]].concat())?;
    }
    Ok(())
}

/// Writes the implementation for one enumeration. `path` is the path of the enumeration.
fn write_words(
    code: &mut String,
    module: &str,
    enumeration: &EnumDescriptorProto,
    comments: &[Location],
    path: &[i32],
) -> Result<(), Box<dyn Error>> {
    let prefix = format!("{}_", snake_case(enumeration.name()).to_uppercase());
    writeln!(code, "impl Words for v1::{module}{} {{\n    const WORDS: &'static [Word] = &[", enumeration.name())?;
    for (i, value) in (0..).zip(&enumeration.value) {
        let word = value.name().strip_prefix(&prefix).ok_or_else(|| format!("{} lacks {prefix}", value.name()))?;
        let word = word.to_lowercase().replace('_', "-");
        let value_path = [path, &[VALUE_IN_ENUM, i]].concat();
        let comment = comments.iter().find(|comment| comment.path == value_path);
        let help = comment.map_or("", |comment| comment.leading_comments());
        let help = help.lines().map(str::trim).collect::<Vec<_>>().join(" ");
        writeln!(code, "        Word {{ number: {}, word: {word:?}, help: {:?} }},", value.number(), help.trim())?;
    }
    writeln!(code, "    ];\n}}")?;
    Ok(())
}

/// Converts a name to snake case, such as `OptimizeHologram` to `optimize_hologram`.
fn snake_case(name: &str) -> String {
    let mut snake = String::new();
    for character in name.chars() {
        if character.is_uppercase() && !snake.is_empty() {
            snake.push('_');
        }
        snake.extend(character.to_lowercase());
    }
    snake
}
