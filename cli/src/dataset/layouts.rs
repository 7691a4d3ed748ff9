//! Lists of pairs from the folders of published datasets.

use super::manifest::Entry;
use crate::destination::name_of;
use crate::failure::Failure;
use crate::inputs::{has_extension, paths_in};
use clap::ValueEnum;
use lightpath::v1::Split;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// A way to arrange holograms and photographs in folders.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Layout {
    /// Two folders, HOLOGRAMS and PHOTOGRAPHS, with as many PNG files each, also in subfolders. The n-th photograph in
    /// the order of the paths belongs to the n-th hologram. Numbers in the names must agree. K. Kavakli, H. Urey and
    /// K. Aksit, Learned holographic light transport (2022), https://doi.org/10.5522/04/15087867
    RealisticHolography,
    /// One folder, with train, val and test. Each has phase/NAME.png and captured/NAME_PLANE.png. S. Choi, M.
    /// Gopakumar, Y. Peng, J. Kim and G. Wetzstein, Neural 3D holography (2021)
    NeuralHolography,
}

/// Pairs of the layout `realistic-holography`.
///
/// # Errors
///
/// [`Failure::Usage`] if the folders have no PNG files or different numbers of them, or if the numbers in two names
/// differ.
pub(super) fn realistic_holography(holograms: &Path, photographs: &Path) -> Result<Vec<Entry>, Failure> {
    let (phases, photos) = (pngs(holograms)?, pngs(photographs)?);
    if phases.is_empty() || phases.len() != photos.len() {
        let counts = (phases.len(), holograms.display(), photos.len(), photographs.display());
        let (a, in_a, b, in_b) = counts;
        return Err(Failure::Usage(format!(
            "{in_a} has {a} PNG files and {in_b} has {b}, but both must have the same number, at least 1"
        )));
    }
    let mut ids = BTreeSet::new();
    let mut entries = Vec::with_capacity(phases.len());
    for (phase, photo) in phases.into_iter().zip(photos) {
        if numbers(&phase) != numbers(&photo) {
            let (phase, photo) = (phase.display(), photo.display());
            return Err(Failure::Usage(format!(
                "in the order of the paths {photo} belongs to {phase}, but the numbers in their names differ; is a file missing?"
            )));
        }
        let id = name_of(&phase);
        if !ids.insert(id.clone()) {
            return Err(Failure::Usage(format!("two holograms are named {id}; import their folders one by one")));
        }
        entries.push(Entry::new(id, phase, photo));
    }
    Ok(entries)
}

/// Pairs of one plane of the layout `neural-holography`. Ids begin with the name of the split's folder.
///
/// # Errors
///
/// [`Failure::Usage`] if there is no hologram, or if one has no photograph of this plane.
pub(super) fn neural_holography(folder: &Path, plane: u32) -> Result<Vec<Entry>, Failure> {
    let mut entries = Vec::new();
    for (part, split) in [("train", Split::Train), ("val", Split::Validation), ("test", Split::Test)] {
        let phases = folder.join(part).join("phase");
        if !phases.is_dir() {
            continue;
        }
        for phase in pngs(&phases)? {
            let name = name_of(&phase);
            let photo = folder.join(part).join("captured").join(format!("{name}_{plane}.png"));
            if !photo.is_file() {
                let (photo, phase) = (photo.display(), phase.display());
                return Err(Failure::Usage(format!("there is no photograph {photo} of the hologram {phase}")));
            }
            entries.push(Entry { split: Some(split), ..Entry::new(format!("{part}-{name}"), phase, photo) });
        }
    }
    if entries.is_empty() {
        let folder = folder.display();
        return Err(Failure::Usage(format!(
            "there is no hologram in train/phase, val/phase or test/phase of {folder}"
        )));
    }
    Ok(entries)
}

/// The PNG files of a folder and its subfolders, in the order of their paths.
fn pngs(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let mut found = Vec::new();
    for path in paths_in(folder)? {
        if path.is_dir() {
            found.extend(pngs(&path)?);
        } else if has_extension(&path, &["png"]) {
            found.push(path);
        }
    }
    Ok(found)
}

/// The numbers in a file's name without its extension.
fn numbers(path: &Path) -> Vec<u64> {
    let name = name_of(path);
    name.split(|c: char| !c.is_ascii_digit()).filter_map(|digits| digits.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A temporary folder with empty files.
    fn folder(files: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for file in files {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        folder
    }

    fn text(found: Result<Vec<Entry>, Failure>) -> String {
        match found {
            Ok(entries) => entries.iter().map(|entry| format!("{}:{:?} ", entry.id, entry.split)).collect(),
            Err(Failure::Usage(problem)) => problem,
            Err(other) => panic!("{other:?}"),
        }
    }

    #[test]
    fn order_of_paths_pairs_two_folders() {
        let data = folder(&[
            "h/0002.png",
            "h/0001.png",
            "h/._0001.png",
            "h/.trash/0003.png",
            "p/0001_warped.png",
            "p/0002_warped.png",
            "p/notes.txt",
        ]);
        let (h, p) = (data.path().join("h"), data.path().join("p"));
        let entries = realistic_holography(&h, &p).unwrap();
        assert_eq!(entries[0].id, "0001");
        assert_eq!((&entries[1].pattern, &entries[1].photo), (&h.join("0002.png"), &p.join("0002_warped.png")));
        std::fs::remove_file(p.join("0001_warped.png")).unwrap();
        assert!(text(realistic_holography(&h, &p)).contains("has 2 PNG files"));
        std::fs::write(p.join("0003_warped.png"), "").unwrap();
        assert!(text(realistic_holography(&h, &p)).contains("the numbers in their names differ"));
        std::fs::create_dir(h.join("more")).unwrap();
        for (from, to) in [("h/more/0002.png", "p/0001_warped.png"), ("h/0002.png", "p/0002_warped.png")] {
            std::fs::write(data.path().join(from), "").unwrap();
            std::fs::write(data.path().join(to), "").unwrap();
        }
        std::fs::rename(p.join("0003_warped.png"), p.join("0002_x.png")).unwrap();
        assert!(text(realistic_holography(&h, &p)).contains("two holograms are named 0002"));
        assert!(matches!(realistic_holography(&data.path().join("none"), &p), Err(Failure::Client(_))));
    }

    #[test]
    fn folders_of_a_split_and_a_plane_name_the_photographs() {
        let data = folder(&[
            "train/phase/7.png",
            "train/captured/7_0.png",
            "train/captured/7_1.png",
            "val/phase/8.png",
            "val/captured/8_1.png",
        ]);
        assert_eq!(text(neural_holography(data.path(), 1)), "train-7:Some(Train) val-8:Some(Validation) ");
        assert_eq!(neural_holography(data.path(), 1).unwrap()[0].photo, data.path().join("train/captured/7_1.png"));
        assert!(text(neural_holography(data.path(), 0)).contains("8_0.png of the hologram"));
        assert!(text(neural_holography(&data.path().join("val"), 1)).contains("no hologram in train/phase"));
    }
}
