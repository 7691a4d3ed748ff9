//! Compiles the decoder with the machine's C compiler.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Each error of memory or arithmetic ends the program.
const FLAGS: [&str; 8] = [
    "-std=c99",
    "-Wall",
    "-Wextra",
    "-Werror",
    "-pedantic",
    "-fsanitize=address,undefined",
    "-fno-sanitize-recover=all",
    "-O1",
];

/// A program of `firmware/c/test`.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Program {
    CheckVectors,
    Fuzz,
    Verdicts,
}

impl Program {
    fn name(self) -> &'static str {
        match self {
            Self::CheckVectors => "check_vectors",
            Self::Fuzz => "fuzz",
            Self::Verdicts => "verdicts",
        }
    }
}

/// Runs a program, which must succeed, and returns what it printed.
pub(crate) fn run(program: Program, arguments: &[&OsStr]) -> String {
    let mut command = Command::new(compiled(program));
    // The decoder allocates nothing, and a search for leaks fails where processes may not be traced.
    let output = command.args(arguments).env("ASAN_OPTIONS", "detect_leaks=0").output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{program:?} failed:\n{text}\n{}", errors(&output));
    text
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Compiles a program and returns its path.
fn compiled(program: Program) -> PathBuf {
    require_sanitizers(program);
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../firmware/c");
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("lightpath_{}", program.name()));
    let mut sources = sources(&folder);
    sources.push(folder.join("test/vector_files.c"));
    sources.push(folder.join(format!("test/{}.c", program.name())));
    let output = cc().args(FLAGS).args(&sources).arg("-o").arg(&path).arg("-lm").output().unwrap();
    assert!(output.status.success(), "the decoder does not compile without warnings:\n{}", errors(&output));
    path
}

/// Compiles the example of the decoder's README.
pub(crate) fn compile_example() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../firmware/c");
    let text = std::fs::read_to_string(folder.join("README.md")).unwrap();
    let (_, rest) = text.split_once("```c\n").expect("the README has an example");
    let (example, _) = rest.split_once("```").unwrap();
    let source = Path::new(env!("CARGO_TARGET_TMPDIR")).join("lightpath_example.c");
    std::fs::write(&source, example).unwrap();
    let output = cc().args(FLAGS).arg("-fsyntax-only").arg("-I").arg(&folder).arg(source).output().unwrap();
    assert!(output.status.success(), "the README's example does not compile:\n{}", errors(&output));
}

/// The decoder's own files.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let files = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path());
    let mut sources: Vec<_> = files.filter(|path| path.extension().is_some_and(|ending| ending == "c")).collect();
    sources.sort();
    sources
}

fn cc() -> Command {
    Command::new("cc")
}

/// Without sanitizers the tests would pass and say little. They must not.
fn require_sanitizers(needed_by: Program) {
    // Tests run at the same time: each has files of its own.
    let name = format!("lightpath_empty_{}_{}", needed_by.name(), std::process::id());
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let (source, program) = (folder.join(format!("{name}.c")), folder.join(name));
    std::fs::write(&source, "int main(void) { return 0; }\n").unwrap();
    let compiled = cc().args(FLAGS).arg(&source).arg("-o").arg(&program).output();
    let output = compiled.expect("the C compiler `cc` is needed: install gcc or clang");
    let is_fit = output.status.success() && Command::new(&program).output().is_ok_and(|run| run.status.success());
    assert!(
        is_fit,
        "the C compiler `cc` has no sanitizers, which the tests of firmware/c need; install gcc or clang with \
         libasan and libubsan:\n{}",
        errors(&output)
    );
    std::fs::remove_file(source).unwrap();
    std::fs::remove_file(program).unwrap();
}
