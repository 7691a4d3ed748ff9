//! Output files of a hologram: their paths, and saving them.

use crate::destination::{self, Destination, PNG};
use crate::failure::Failure;
use crate::session::{Session, Stdout};
use crate::show;
use clap::Args;
use lightpath::v1::optimize_hologram_result::PlaneResult;
use lightpath::{units, v1};
use std::path::{Path, PathBuf};

/// Radians as a NumPy array.
const NPY: (&str, &str) = ("npy", "radians as float32");
const PATTERN: Destination =
    Destination { option: "-o", suffix: "-pattern.png", formats: &[("png", "grey levels for the display"), NPY] };
const PHASE_NPY: Destination = Destination { option: "--npy", suffix: "-phase.npy", formats: &[NPY] };
const RECONSTRUCTION: Destination =
    Destination { option: "--reconstruction", suffix: "-reconstruction.png", formats: &[PNG] };

/// Options that name output files.
#[derive(Debug, Args)]
#[command(next_help_heading = "Output files")]
pub(super) struct Outputs {
    /// Save the pattern for the display: a grey PNG of levels; a name that ends with .npy saves radians as float32; -
    /// writes the PNG to standard output
    #[arg(short = 'o', value_name = "PATTERN.png")]
    pattern: Option<PathBuf>,

    /// Save the phase in radians (float32) before phase response, carrier and quantization are applied
    #[arg(long, value_name = "FILE.npy")]
    npy: Option<PathBuf>,

    /// Save the reconstruction: the picture that the detector sees according to the kernel
    #[arg(long, value_name = "FILE.png")]
    reconstruction: Option<PathBuf>,
}

/// Paths of the output files of one target.
#[derive(Clone, Debug, Default)]
pub(super) struct Files {
    pattern: Option<PathBuf>,
    npy: Option<PathBuf>,
    reconstruction: Option<PathBuf>,
}

impl Outputs {
    /// True if at least one output file was given.
    pub(super) fn any(&self) -> bool {
        self.pattern.is_some() || self.npy.is_some() || self.reconstruction.is_some()
    }

    /// Returns the paths of the output files of each target, and checks them.
    pub(super) fn files(&self, stdout: &Stdout, names: &[String], targets: &[PathBuf]) -> Result<Vec<Files>, Failure> {
        let paths = |destination: Destination, place: &Option<PathBuf>| match place {
            None => Ok(vec![None; names.len()]),
            Some(place) => {
                let files = destination.files(stdout, place, names)?;
                Ok::<_, Failure>(files.into_iter().map(Some).collect())
            }
        };
        let patterns = paths(PATTERN, &self.pattern)?;
        let npys = paths(PHASE_NPY, &self.npy)?;
        let reconstructions = paths(RECONSTRUCTION, &self.reconstruction)?;
        let all = || [&patterns, &npys, &reconstructions].into_iter().flatten().flatten();
        destination::check_distinct(targets.iter().map(PathBuf::as_path), all().map(PathBuf::as_path))?;
        let zipped = patterns.into_iter().zip(npys).zip(reconstructions);
        Ok(zipped.map(|((pattern, npy), reconstruction)| Files { pattern, npy, reconstruction }).collect())
    }
}

impl Files {
    /// Downloads the files of a result.
    pub(super) async fn save(&self, session: &Session, result: &v1::OptimizeHologramResult) -> Result<(), Failure> {
        let parts = self.parts(result);
        if let Some((_, path)) = parts.iter().find(|(_, path)| destination::is_stdout(path)) {
            let count = parts.iter().filter(|(_, other)| other == path).count();
            if count > 1 {
                let text =
                    format!("the result has {count} files, but standard output takes one: name a file or folder");
                return Err(Failure::Usage(text));
            }
        }
        for (digest, path) in parts {
            destination::save(session, digest, &path).await?;
        }
        Ok(())
    }

    /// The paths of the files of a result, separated by commas. `None` without any.
    pub(super) fn text(&self, result: &v1::OptimizeHologramResult) -> Option<String> {
        let files = self.parts(result).into_iter().map(|(_, path)| destination::shown(&path));
        let text = files.collect::<Vec<_>>().join(", ");
        (!text.is_empty()).then_some(text)
    }

    /// Pairs of artifact digest and file path. If a result has several wavelengths, subframes or planes, the file names
    /// contain the wavelength, subframe number or distance. Of several wavelengths only the colour reconstructions are
    /// saved, if the result has them.
    fn parts<'a>(&self, result: &'a v1::OptimizeHologramResult) -> Vec<(&'a str, PathBuf)> {
        let is_npy = |path: &Path| path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("npy"));
        let mut parts = Vec::new();
        let several_wavelengths = result.wavelengths.len() > 1;
        for wavelength in &result.wavelengths {
            let colour = several_wavelengths.then(|| compact(wavelength.wavelength_m));
            let several_subframes = wavelength.subframes.len() > 1;
            for (i, subframe) in wavelength.subframes.iter().enumerate() {
                let number = several_subframes.then(|| format!("subframe{}", i + 1));
                let marks = [colour.clone(), number];
                if let Some(path) = &self.pattern {
                    let digest = if is_npy(path) { &subframe.phase } else { &subframe.pattern };
                    parts.push((digest.as_str(), marked(path, &marks)));
                }
                if let Some(path) = &self.npy {
                    parts.push((subframe.phase.as_str(), marked(path, &marks)));
                }
            }
            let Some(path) = self.reconstruction.as_ref().filter(|_| result.colour_reconstructions.is_empty()) else {
                continue;
            };
            let several_planes = wavelength.planes.len() > 1;
            for plane in &wavelength.planes {
                let marks = [colour.clone(), several_planes.then(|| place_mark(plane))];
                parts.push((plane.reconstruction.as_str(), marked(path, &marks)));
            }
        }
        if let (Some(path), Some(first)) = (&self.reconstruction, result.wavelengths.first()) {
            let several_planes = first.planes.len() > 1;
            for (digest, plane) in result.colour_reconstructions.iter().zip(&first.planes) {
                parts.push((digest.as_str(), marked(path, &[several_planes.then(|| place_mark(plane))])));
            }
        }
        parts
    }
}

/// The place of a picture in a file name, for example `150mm`.
fn place_mark(plane: &PlaneResult) -> String {
    show::place(plane.place.as_ref()).replace(' ', "")
}

/// Formats a length without a space, for example `638nm`.
fn compact(metres: f64) -> String {
    units::show_m(metres).replace(' ', "")
}

/// Adds marks to a file name: `pattern.png` becomes `pattern-638nm-subframe2.png`.
fn marked(path: &Path, marks: &[Option<String>]) -> PathBuf {
    if destination::is_stdout(path) {
        return path.to_owned();
    }
    let marks: String = marks.iter().flatten().map(|mark| format!("-{mark}")).collect();
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().map(|extension| format!(".{}", extension.to_string_lossy())).unwrap_or_default();
    path.with_file_name(format!("{stem}{marks}{extension}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use v1::Place;
    use v1::optimize_hologram_result::{Subframe, WavelengthResult};

    fn result(
        wavelengths_m: &[f64],
        subframes: usize,
        distances_m: &[f64],
        colours: bool,
    ) -> v1::OptimizeHologramResult {
        let plane = |&distance_m: &f64| PlaneResult { place: Some(Place::at_m(distance_m)), ..Default::default() };
        let wavelengths = wavelengths_m.iter().map(|&wavelength_m| WavelengthResult {
            wavelength_m,
            subframes: vec![Subframe { pattern: "pattern".into(), phase: "phase".into() }; subframes],
            planes: distances_m.iter().map(plane).collect(),
            ..Default::default()
        });
        let colour_reconstructions = if colours { vec!["colour".to_owned(); distances_m.len()] } else { vec![] };
        v1::OptimizeHologramResult { wavelengths: wavelengths.collect(), colour_reconstructions, ..Default::default() }
    }

    fn names(result: &v1::OptimizeHologramResult) -> String {
        let files = Files { pattern: Some("a/p.png".into()), npy: None, reconstruction: Some("s.png".into()) };
        files.text(result).unwrap()
    }

    #[test]
    fn several_wavelengths_subframes_and_planes_get_different_file_names() {
        assert_eq!(names(&result(&[515e-9], 1, &[0.15], false)), "a/p.png, s.png");
        let stack = names(&result(&[515e-9], 2, &[0.14, 0.15], false));
        assert_eq!(stack, "a/p-subframe1.png, a/p-subframe2.png, s-140mm.png, s-150mm.png");
        let colour = names(&result(&[638e-9, 520e-9, 450e-9], 1, &[0.15], true));
        assert_eq!(colour, "a/p-638nm.png, a/p-520nm.png, a/p-450nm.png, s.png");
        let two = names(&result(&[638e-9, 520e-9], 1, &[0.15], false));
        assert_eq!(two, "a/p-638nm.png, s-638nm.png, a/p-520nm.png, s-520nm.png");
    }
}
