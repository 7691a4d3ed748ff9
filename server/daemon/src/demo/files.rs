//! The output folder of the demo.

use anyhow::{Context as _, bail};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Access to the output folder of the demo.
pub(super) struct Files {
    out: PathBuf,
}

/// Name of a file that marks a data folder as made by the demo. The next demo may replace such a folder.
const MARK: &str = "made-by-lightpath-demo";

impl Files {
    /// Creates the output folder, with an empty data folder in it. The folder must be new, empty or made by an earlier
    /// demo, whose data is replaced. So the demo never mixes its files with the user's.
    pub(super) fn create(out: &Path) -> anyhow::Result<Self> {
        let files = Self { out: out.to_owned() };
        let data = files.data_dir();
        if data.join(MARK).exists() {
            fs::remove_dir_all(&data).with_context(|| format!("cannot replace {}", data.display()))?;
        } else if !is_empty(out)? {
            bail!("{} contains files that are not from a demo; choose a new folder with --out", out.display());
        }
        fs::create_dir_all(&data).with_context(|| format!("cannot create {}", data.display()))?;
        fs::write(data.join(MARK), "The next demo in this folder replaces this data folder.\n")?;
        Ok(files)
    }

    /// Path of the server's data folder.
    pub(super) fn data_dir(&self) -> PathBuf {
        self.out.join("data")
    }

    /// Path of a file in the output folder.
    pub(super) fn at(&self, name: &str) -> PathBuf {
        self.out.join(name)
    }

    /// Writes a file, and creates the folders in its name.
    pub(super) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> anyhow::Result<()> {
        let path = self.at(name);
        let folder = path.parent().context("the file has no parent folder")?;
        fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
        fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))
    }

    /// Path of a target for the commands that the demo suggests at its end.
    pub(super) fn example_target(&self) -> PathBuf {
        let mut targets: Vec<PathBuf> = fs::read_dir(self.at("targets"))
            .map(|folder| folder.flatten().map(|entry| entry.path()).collect())
            .unwrap_or_default();
        targets.sort();
        targets.into_iter().next().unwrap_or_else(|| PathBuf::from("target.png"))
    }
}

/// Whether a folder is empty or does not exist.
fn is_empty(folder: &Path) -> anyhow::Result<bool> {
    match fs::read_dir(folder) {
        Ok(mut entries) => Ok(entries.next().is_none()),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(true),
        Err(error) => Err(error).with_context(|| format!("cannot use {} as the output folder", folder.display())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_new_folders_and_folders_of_demos_are_used() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let files = Files::create(&out).unwrap();
        files.write("targets/a.png", b"a").unwrap();
        fs::write(files.data_dir().join("lightpath.db"), "old").unwrap();
        Files::create(&out).unwrap();
        assert!(!files.data_dir().join("lightpath.db").exists());
        assert!(files.example_target().ends_with("targets/a.png"));

        fs::remove_file(files.data_dir().join(MARK)).unwrap();
        assert!(Files::create(&out).is_err());
        assert!(files.data_dir().exists());

        let empty = folder.path().join("empty");
        fs::create_dir(&empty).unwrap();
        Files::create(&empty).unwrap();
        let other = folder.path().join("other");
        fs::create_dir(&other).unwrap();
        fs::write(other.join("thesis.txt"), "mine").unwrap();
        let refused = Files::create(&other).err().unwrap().to_string();
        assert!(refused.contains("not from a demo"), "{refused}");
        assert_eq!(fs::read_dir(&other).unwrap().count(), 1);
    }
}
