//! Compiles the C code that checks manifests with the machine's C compiler.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

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
/// The code that is tested, and what its tests share.
const SOURCES: [&str; 8] = [
    "lightpath_lines.c",
    "lightpath_keyring.c",
    "lightpath_manifest.c",
    "lightpath_body.c",
    "lightpath_verdict.c",
    "test/manifest_cases.c",
    "test/sha256.c",
    "test/vector_files.c",
];
/// What the example of the README needs of Monocypher, which a machine may lack.
const MONOCYPHER: &str = "#include <stddef.h>\n#include <stdint.h>\n\
    int crypto_ed25519_check(const uint8_t signature[64], const uint8_t public_key[32], const uint8_t *message,\n\
    \x20   size_t message_size);\n";

/// A program of `firmware/c/test`, which is one file. It is compiled once.
#[derive(Debug)]
pub(crate) struct Program {
    name: &'static str,
    compiled: OnceLock<PathBuf>,
}

/// Compares the verdicts of the vectors.
pub(crate) static CHECK_MANIFESTS: Program = Program { name: "check_manifests", compiled: OnceLock::new() };
/// Prints verdicts.
pub(crate) static MANIFEST_VERDICTS: Program = Program { name: "manifest_verdicts", compiled: OnceLock::new() };

/// Runs a program, which must succeed, and returns what it printed.
pub(crate) fn run(program: &Program, argument: &OsStr) -> String {
    let mut command = Command::new(program.compiled.get_or_init(|| compiled(program.name)));
    // The code allocates nothing, and a search for leaks fails where processes may not be traced.
    let output = command.arg(argument).env("ASAN_OPTIONS", "detect_leaks=0").output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{program:?} failed:\n{text}\n{}", errors(&output));
    text
}

/// Compiles the example of the README that checks manifests.
pub(crate) fn compile_example() {
    let text = std::fs::read_to_string(code().join("README.md")).unwrap();
    let examples = text.split("```c\n").skip(1).map(|rest| rest.split_once("```").unwrap().0);
    let example = examples.into_iter().find(|example| example.contains("lightpath_manifest.h"));
    let out = temporary("example");
    std::fs::write(out.join("monocypher-ed25519.h"), MONOCYPHER).unwrap();
    std::fs::write(out.join("example.c"), example.expect("the README has an example")).unwrap();
    let folders = [code(), code().join("test"), out.clone()];
    let includes = folders.iter().flat_map(|folder| [OsStr::new("-I"), folder.as_os_str()]);
    let output = cc().args(FLAGS).arg("-fsyntax-only").args(includes).arg(out.join("example.c")).output().unwrap();
    assert!(output.status.success(), "the README's example does not compile:\n{}", errors(&output));
    std::fs::remove_dir_all(out).unwrap();
}

fn code() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../firmware/c")
}

/// A new folder. Tests run at the same time: each has one of its own.
fn temporary(name: &str) -> PathBuf {
    let thread = format!("{:?}", std::thread::current().id()).replace(['(', ')'], "_");
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}_{}_{thread}", std::process::id()));
    std::fs::create_dir_all(&path).unwrap();
    path
}

/// Compiles a program and returns its path.
fn compiled(program: &str) -> PathBuf {
    require_sanitizers();
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("lightpath_{program}"));
    let test = format!("test/{program}.c");
    let sources = SOURCES.iter().copied().chain([test.as_str()]).map(|file| code().join(file));
    let output = cc().args(FLAGS).args(sources).arg("-o").arg(&path).output().unwrap();
    assert!(output.status.success(), "the code does not compile without warnings:\n{}", errors(&output));
    path
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn cc() -> Command {
    Command::new("cc")
}

/// Without sanitizers the tests would pass and say little. They must not.
fn require_sanitizers() {
    let folder = temporary("empty");
    let (source, program) = (folder.join("empty.c"), folder.join("empty"));
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
    std::fs::remove_dir_all(folder).unwrap();
}
