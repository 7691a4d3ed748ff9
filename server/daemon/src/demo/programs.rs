//! How the user of the demo can call the programs that it suggests at its end.

use std::env;
use std::path::{Path, PathBuf};

/// The programs, as the user can call them now.
#[derive(Debug, PartialEq)]
pub(super) struct Programs {
    pub(super) lightpathd: String,
    pub(super) lightpath: String,
    /// The command that installs `lightpath` first, if there is none yet.
    pub(super) install: Option<&'static str>,
}

impl Programs {
    /// Looks where the programs are.
    pub(super) fn find() -> Self {
        let path = env::var_os("PATH").unwrap_or_default();
        let folders: Vec<PathBuf> = env::split_paths(&path).collect();
        let here = env::current_dir().unwrap_or_default();
        Self::among(&env::current_exe().unwrap_or_else(|_| "lightpathd".into()), &folders, &here)
    }

    /// The same for this program, the folders in which the shell looks for programs, and the user's folder. A program that
    /// the shell does not find is called by its path.
    fn among(this: &Path, folders: &[PathBuf], here: &Path) -> Self {
        let is_found = |name: &str| folders.iter().any(|folder| folder.join(name).is_file());
        let by_path = |program: &Path| program.strip_prefix(here).unwrap_or(program).display().to_string();
        let lightpathd = if is_found("lightpathd") { "lightpathd".to_owned() } else { by_path(this) };
        let beside = this.with_file_name("lightpath");
        let (lightpath, install) = match () {
            () if is_found("lightpath") => ("lightpath".to_owned(), None),
            () if beside.is_file() => (by_path(&beside), None),
            () => (
                "lightpath".to_owned(),
                Some("cargo install --locked --path cli    # once, in the checkout: some minutes"),
            ),
        };
        Self { lightpathd, lightpath, install }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn programs_are_called_as_the_shell_finds_them() {
        let folder = tempfile::tempdir().unwrap();
        let (built, installed) = (folder.path().join("target/release"), folder.path().join("bin"));
        let find = || {
            let found = Programs::among(&built.join("lightpathd"), std::slice::from_ref(&installed), folder.path());
            (found.lightpathd, found.lightpath, found.install.is_some())
        };
        let call = |lightpathd: &str, lightpath: &str, install| (lightpathd.to_owned(), lightpath.to_owned(), install);
        assert_eq!(find(), call("target/release/lightpathd", "lightpath", true), "cargo run builds one program");
        fs::create_dir_all(&built).unwrap();
        fs::write(built.join("lightpath"), "").unwrap();
        assert_eq!(find(), call("target/release/lightpathd", "target/release/lightpath", false));
        fs::create_dir_all(&installed).unwrap();
        for name in ["lightpathd", "lightpath"] {
            fs::write(installed.join(name), "").unwrap();
        }
        assert_eq!(find(), call("lightpathd", "lightpath", false));
    }
}
