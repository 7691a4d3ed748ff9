//! Pictures of the demo: generated test cards, or pictures of the user.

use super::args::DemoArgs;
use anyhow::{Context as _, bail};
use lightpath_bench::TestCard;
use lightpath_domain::dataset::Encoding;
use lightpath_domain::job::Fit;
use lightpath_media::pictures::{self, Placement};
use lightpath_optics::{Grid, Plane, RegionOfInterest};
use std::fs;
use std::path::{Path, PathBuf};

/// A picture: the file that the server receives, and its decoded light.
#[derive(Clone)]
pub(super) struct Picture {
    /// Name of the picture, which can be part of a file name.
    pub(super) name: String,
    /// PNG, JPEG or TIFF file in sRGB.
    pub(super) file: Vec<u8>,
    /// Linear light at the size of the display.
    pub(super) intensity: Plane<f32>,
}

/// The pictures of one demo.
pub(super) struct Targets {
    /// Pictures of the training photographs.
    pub(super) training: Vec<Picture>,
    /// Pictures of the test photographs, on which kernels are measured.
    pub(super) test: Vec<Picture>,
    /// Pictures to be shown through each kernel; none of them is a training picture.
    pub(super) held_out: Vec<Picture>,
}

/// Fit of the pictures to the region of interest: they cover it without black borders.
pub(super) const FIT: Fit = Fit::Cover;

/// Cards that are always held out.
const HELD_OUT: [TestCard; 3] = [TestCard::Portrait, TestCard::Planet, TestCard::Leaf];

pub(super) fn load(args: &DemoArgs) -> anyhow::Result<Targets> {
    match &args.images {
        Some(folder) => from_folder(args, folder),
        None => from_cards(args),
    }
}

fn test_pairs(args: &DemoArgs) -> usize {
    (args.pairs as usize).div_ceil(4).max(2)
}

fn from_cards(args: &DemoArgs) -> anyhow::Result<Targets> {
    let training_cards: Vec<TestCard> = TestCard::ALL.into_iter().filter(|card| !HELD_OUT.contains(card)).collect();
    let many = |cards: &[TestCard], count: usize, stream: u64| -> anyhow::Result<Vec<Picture>> {
        // Separate streams of seeds ensure that no picture is in two of the sets.
        let seed = |i: usize| args.seed.wrapping_mul(3).wrapping_add(stream) * 1_000_000 + (i / cards.len()) as u64;
        (0..count).map(|i| card(args, cards[i % cards.len()], seed(i), i >= cards.len())).collect()
    };
    Ok(Targets {
        training: many(&training_cards, args.pairs as usize, 0)?,
        test: many(&HELD_OUT, test_pairs(args), 1)?,
        held_out: many(&HELD_OUT, args.held_out as usize, 2)?,
    })
}

fn card(args: &DemoArgs, card: TestCard, seed: u64, numbered: bool) -> anyhow::Result<Picture> {
    let region = region(args)?;
    let light = card.render(region.height_px(), region.width_px(), seed)?;
    let name = if numbered { format!("{}-{}", card.name(), seed % 1_000_000 + 1) } else { card.name().to_owned() };
    picture(args, name, pictures::grey_png_srgb(&light)?)
}

/// Decodes a picture by the same rules as the server.
fn picture(args: &DemoArgs, name: String, file: Vec<u8>) -> anyhow::Result<Picture> {
    let (width_px, height_px) = args.resolution();
    let (width_px, height_px) = (width_px as usize, height_px as usize);
    let placement = Placement { fit: FIT, area: Some(region(args)?.into()), height_px, width_px };
    let intensity =
        pictures::target_intensity(&file, Encoding::Srgb, &placement).with_context(|| format!("cannot use {name}"))?;
    Ok(Picture { name, file, intensity })
}

/// The region of interest, which the pictures fill.
pub(super) fn region(args: &DemoArgs) -> anyhow::Result<RegionOfInterest> {
    let (width_px, height_px) = args.resolution();
    Ok(RegionOfInterest::middle(&Grid::try_new(height_px as usize, width_px as usize, args.pixel_pitch)?))
}

/// Reads the pictures in a folder. The first pictures by name are held out. The others are for learning, and are
/// repeated if there are too few.
fn from_folder(args: &DemoArgs, folder: &Path) -> anyhow::Result<Targets> {
    let mut paths: Vec<PathBuf> = fs::read_dir(folder)
        .with_context(|| format!("cannot read {}", folder.display()))?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| is_picture(path))
        .collect();
    paths.sort();
    let held_out = args.held_out as usize;
    if paths.len() < held_out + 2 {
        let (found, needed) = (paths.len(), held_out + 2);
        bail!("{} has {found} PNG, JPEG or TIFF pictures, but {needed} are needed", folder.display());
    }
    let used = held_out + args.pairs as usize;
    let pictures: Vec<Picture> = paths.iter().take(used).map(|path| read(args, path)).collect::<Result<_, _>>()?;
    let (shown, learned) = pictures.split_at(held_out);
    Ok(Targets {
        training: learned.iter().cycle().take(args.pairs as usize).cloned().collect(),
        test: shown.iter().cycle().take(test_pairs(args)).cloned().collect(),
        held_out: shown.to_vec(),
    })
}

fn is_picture(path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    path.is_file() && ["png", "jpg", "jpeg", "tif", "tiff"].contains(&ending.as_str())
}

fn read(args: &DemoArgs, path: &Path) -> anyhow::Result<Picture> {
    let bytes = fs::metadata(path).map(|file| file.len()).with_context(|| format!("cannot read {}", path.display()))?;
    if bytes > pictures::FILE_BYTES_MAX as u64 {
        bail!("{} has {bytes} bytes, but must have at most {}", path.display(), pictures::FILE_BYTES_MAX);
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    picture(args, name, fs::read(path).with_context(|| format!("cannot read {}", path.display()))?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    fn args(images: Option<PathBuf>) -> DemoArgs {
        DemoArgs {
            out: PathBuf::new(),
            images,
            asked_resolution: Some((64, 40)),
            paper: false,
            distance: None,
            wavelength: 515e-9,
            pixel_pitch: 8e-6,
            seed: 1,
            pairs: 14,
            held_out: 4,
            iterations: 1,
            training_iterations: 1,
            models: Vec::new(),
        }
    }

    fn files(pictures: &[Picture]) -> HashSet<&[u8]> {
        pictures.iter().map(|picture| picture.file.as_slice()).collect()
    }

    #[test]
    fn no_generated_picture_is_in_two_sets() {
        let targets = load(&args(None)).unwrap();
        let (training, test, held_out) = (files(&targets.training), files(&targets.test), files(&targets.held_out));
        assert_eq!((training.len(), test.len(), held_out.len()), (14, 4, 4));
        assert!(training.is_disjoint(&test) && training.is_disjoint(&held_out) && test.is_disjoint(&held_out));
        let names: HashSet<_> = targets.held_out.iter().map(|picture| &picture.name).collect();
        assert_eq!(names.len(), 4);
    }

    #[test]
    fn held_out_pictures_of_the_user_are_not_learned_from() {
        let folder = tempfile::tempdir().unwrap();
        let few = load(&args(Some(folder.path().to_owned()))).err().unwrap().to_string();
        assert!(few.contains("6 are needed"), "{few}");
        for seed in 0..7 {
            let picture = TestCard::Clouds.render(50, 70, seed).unwrap();
            fs::write(folder.path().join(format!("{seed}.PNG")), pictures::grey_png_srgb(&picture).unwrap()).unwrap();
        }
        fs::write(folder.path().join("notes.txt"), "no picture").unwrap();
        let targets = load(&args(Some(folder.path().to_owned()))).unwrap();
        assert_eq!((targets.training.len(), targets.held_out.len()), (14, 4));
        assert!(files(&targets.training).is_disjoint(&files(&targets.held_out)));
        assert_eq!(targets.training[0].intensity.width_px(), 64);
    }
}
