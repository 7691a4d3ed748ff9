//! Arguments for what holograms show: target pictures, distances and wavelengths.

use crate::arguments::{distance, wavelength};
use crate::destination;
use crate::failure::Failure;
use crate::inputs;
use crate::jobs::submission::label_of;
use crate::session::Session;
use clap::Args;
use lightpath::names;
use lightpath::v1::{OptimizeHologram, Place, optimize_hologram::ImagePlane};
use std::path::{Path, PathBuf};

/// Target pictures with their display, distances and wavelengths.
#[derive(Debug, Args)]
pub(super) struct Pictures {
    /// Show these pictures: PNG (8 or 16 bit, grey or colour), JPEG or TIFF, at least 8x8 px; a folder stands for all
    /// pictures in it. Colours are averaged; only with three wavelengths each wavelength shows its own colour
    #[arg(required_unless_present = "planes", value_name = "TARGET")]
    targets: Vec<PathBuf>,

    #[command(flatten)]
    scene: Scene,
}

/// Where a target is shown: display, distances and wavelengths. Commands with it have an argument `targets`.
#[derive(Debug, Args)]
pub(super) struct Scene {
    /// Use the display with this id, for example lab-2
    #[arg(long, value_name = "ID")]
    display: String,

    /// Set the distance from the SLM to the image plane, at most 10m, for example 150mm; negative for an image behind
    /// the SLM. With --depth-map give the distances of all planes, separated by commas
    #[arg(long = "distance", value_name = "LENGTH", value_parser = distance, value_delimiter = ',')]
    #[arg(allow_hyphen_values = true, required_unless_present = "planes")]
    distances: Vec<f64>,

    /// Set the wavelengths in vacuum, for example 515nm or 638nm,520nm,450nm; each gets one hologram [default: the
    /// display's only wavelength]
    #[arg(long = "wavelength", value_name = "LENGTH", value_parser = wavelength, value_delimiter = ',')]
    #[arg(allow_hyphen_values = true)]
    wavelengths: Vec<f64>,

    /// Show a picture at a distance, for example 140mm=near.png, or 140mm=near.png:2 with weight 2 (default: 1). One
    /// hologram shows all pictures that are given this way; use it in place of TARGET and --distance
    #[arg(long = "plane", value_name = "LENGTH=FILE", value_parser = plane, allow_hyphen_values = true)]
    #[arg(conflicts_with_all = ["targets", "distances", "depth_map"])]
    planes: Vec<PlaneFile>,

    /// Divide TARGET into planes by this grey picture of depths: white is at the first --distance, black at the last
    #[arg(long, value_name = "FILE")]
    depth_map: Option<PathBuf>,
}

/// A target picture with its distance and weight, given as `140mm=near.png:2`.
#[derive(Clone, Debug, PartialEq)]
struct PlaneFile {
    distance_m: f64,
    file: PathBuf,
    weight: f64,
}

fn plane(text: &str) -> Result<PlaneFile, String> {
    let form = "must be a distance and a picture, such as 140mm=near.png, and may end with a weight above 0, such as \
                140mm=near.png:2";
    let (length, file) = text.split_once('=').ok_or(form)?;
    let distance_m = distance(length).map_err(|error| error.to_string())?;
    let weighted = file.rsplit_once(':').and_then(|(file, weight)| Some((file, weight.parse::<f64>().ok()?)));
    let (file, weight) = weighted.unwrap_or((file, 1.0));
    if file.is_empty() || !(weight > 0.0 && weight.is_finite()) {
        return Err(form.to_owned());
    }
    Ok(PlaneFile { distance_m, file: file.into(), weight })
}

impl Scene {
    /// Checks rules that clap cannot check.
    pub(super) fn check(&self) -> Result<(), Failure> {
        let several = self.distances.len() > 1;
        match &self.depth_map {
            None if several => Err(Failure::Usage(
                "several distances need --depth-map, which divides a picture among them; for several pictures use --plane"
                    .to_owned(),
            )),
            Some(_) if !several => Err(Failure::Usage(
                "--depth-map needs at least two distances, such as --distance 140mm,150mm,160mm".to_owned(),
            )),
            _ => Ok(()),
        }
    }

    /// Number of wavelengths of a hologram.
    pub(super) fn wavelengths(&self) -> usize {
        self.wavelengths.len().max(1)
    }

    /// The input files.
    pub(super) fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.planes.iter().map(|plane| &plane.file).chain(&self.depth_map)
    }

    /// Uploads the pictures and makes the request. `target` is the picture of all distances, if there are no planes.
    pub(super) async fn request(&self, session: &Session, target: Option<&Path>) -> Result<OptimizeHologram, Failure> {
        let mut spec = OptimizeHologram {
            display: names::display(&self.display),
            wavelengths_m: self.wavelengths.clone(),
            ..Default::default()
        };
        for plane in &self.planes {
            spec.planes.push(ImagePlane {
                place: Some(Place::at_m(plane.distance_m)),
                target: session.upload(&plane.file).await?,
                weight: Some(plane.weight),
            });
        }
        if let Some(target) = target {
            let target = session.upload(target).await?;
            let plane = |&distance_m: &f64| {
                let place = Some(Place::at_m(distance_m));
                ImagePlane { place, target: target.clone(), weight: None }
            };
            spec.planes.extend(self.distances.iter().map(plane));
        }
        if let Some(map) = &self.depth_map {
            spec.depth_map = session.upload(map).await?;
        }
        Ok(spec)
    }
}

impl Pictures {
    /// Checks rules that clap cannot check.
    pub(super) fn check(&self) -> Result<(), Failure> {
        self.scene.check()
    }

    /// Puts the pictures of each folder in its place.
    pub(super) fn expand(&mut self) -> Result<(), Failure> {
        self.targets = inputs::expanded(&self.targets, inputs::PICTURES)?;
        Ok(())
    }

    /// What each job is about: the file names of its pictures.
    pub(super) fn label(&self, index: usize) -> String {
        match self.targets.get(index) {
            Some(target) => label_of(target),
            None => self.scene.planes.iter().map(|plane| label_of(&plane.file)).collect::<Vec<_>>().join(", "),
        }
    }

    /// The name of each job: the name of its first picture.
    pub(super) fn names(&self) -> Vec<String> {
        match self.scene.planes.first() {
            Some(first) => vec![destination::name_of(&first.file)],
            None => self.targets.iter().map(|target| destination::name_of(target)).collect(),
        }
    }

    /// The picture that gives the `index`-th job its name.
    pub(super) fn first_file(&self, index: usize) -> PathBuf {
        self.scene.planes.first().map_or_else(|| self.targets[index].clone(), |plane| plane.file.clone())
    }

    /// The input files.
    pub(super) fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.targets.iter().chain(self.scene.files())
    }

    /// Uploads the pictures of the `index`-th job and makes its request.
    pub(super) async fn request(&self, session: &Session, index: usize) -> Result<OptimizeHologram, Failure> {
        self.scene.request(session, self.targets.get(index).map(PathBuf::as_path)).await
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_parsed() {
        let read = |text| plane(text).unwrap();
        let near = PlaneFile { distance_m: 0.14, file: "near.png".into(), weight: 1.0 };
        assert_eq!(read("140mm=near.png"), near);
        assert_eq!(read("0.14m=near.png"), near);
        assert_eq!(read("140mm=near.png:2.5"), PlaneFile { weight: 2.5, ..near.clone() });
        assert_eq!(read("-140mm=a:b.png").file, PathBuf::from("a:b.png"));
        for bad in ["near.png", "140mm", "140mm=", "140=near.png", "140mm=near.png:0", "x=near.png"] {
            assert!(plane(bad).is_err(), "{bad}");
        }
        assert!(plane("near.png").unwrap_err().contains("140mm=near.png"));
    }
}
