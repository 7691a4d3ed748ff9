//! Evidence from the photographs: the residuals of each pair, and the band that the holograms illuminated.

use super::chapter::{Chapter, ReportError};
use crate::figures::{Axis, Canvas, CaptionedPicture, ColourMap, ContactRow, ContactSheet, Heatmap, escaped};
use crate::pictures::Rectangle;
use lightpath_domain::dataset::Split;
use lightpath_optics::diagnostics::LitBand;
use lightpath_optics::learning::{Pair, PartStrength, ResponseCovariance, compare};
use lightpath_optics::{Engine, Error, Plane, RegionOfInterest};
use std::fmt::Write as _;

/// Comparison of a kernel with the pairs of its dataset.
#[derive(Clone, Debug)]
pub struct Evidence {
    region: RegionOfInterest,
    pixel_pitch_m: f64,
    pairs: Vec<PairEvidence>,
    lit: LitBand,
    /// Uncertainty of the phase response. `None`: the training pairs do not determine it.
    pub response: Option<ResponseCovariance>,
    /// How strong the model's parts are, and how certain that is. `None`: the training pairs do not determine it.
    pub strengths: Option<Vec<PartStrength>>,
}

/// Comparison of one pair with the kernel, with small pictures.
#[derive(Clone, Debug)]
pub struct PairEvidence {
    id: String,
    split: Split,
    photo: Plane<f32>,
    predicted: Plane<f32>,
    residual: Plane<f32>,
    /// The region of interest \[px of the small pictures\].
    region: Rectangle,
    /// Mean squared error of the pair in the region of interest.
    loss: f64,
}

/// Largest number of pairs with pictures. Held-out pairs come first.
pub const PAIRS_SHOWN_MAX: usize = 8;
/// Largest width of a picture \[px\].
const WIDTH_PX_MAX: usize = 320;

impl Evidence {
    /// Evidence without pairs.
    #[must_use]
    pub fn new(region: RegionOfInterest, height_px: usize, width_px: usize, pixel_pitch_m: f64) -> Self {
        let (pairs, lit) = (Vec::new(), LitBand::new(height_px, width_px));
        Self { region, pixel_pitch_m, pairs, lit, response: None, strengths: None }
    }

    /// Compares a pair's photograph with the engine's prediction, and keeps pictures of both.
    ///
    /// # Errors
    ///
    /// [`Error`] for a pair of another size, or without a valid pixel.
    pub fn add(&mut self, engine: &Engine, id: &str, split: Split, pair: &Pair) -> Result<(), Error> {
        if split == Split::Train {
            self.lit.add(&pair.phase)?;
        }
        if self.pairs.len() >= PAIRS_SHOWN_MAX {
            return Ok(());
        }
        let sums = compare(engine, pair, self.region)?;
        let (gain, offset) = sums.best_gain_and_offset();
        let predicted = engine.light(&pair.phase)?.map(|light| (gain * f64::from(light) + offset) as f32);
        let saturated = crate::pictures::SATURATION;
        let (height, width) = (pair.photo.height_px(), pair.photo.width_px());
        let residual = Plane::from_fn(height, width, |y, x| {
            let photo = pair.photo.at(y, x);
            let counts = photo < saturated && self.region.columns(y).is_some_and(|columns| columns.contains(&x));
            if counts { predicted.at(y, x) - photo } else { 0.0 }
        });
        self.pairs.push(PairEvidence {
            id: id.to_owned(),
            split,
            loss: mean_squared_error(&residual, &pair.photo, self.region),
            photo: shrunk(&pair.photo),
            predicted: shrunk(&predicted),
            residual: shrunk(&residual),
            region: shrunk_region(self.region, width.div_ceil(WIDTH_PX_MAX)),
        });
        Ok(())
    }
}

fn mean_squared_error(residual: &Plane<f32>, photo: &Plane<f32>, region: RegionOfInterest) -> f64 {
    let saturated = crate::pictures::SATURATION;
    let (mut sum, mut count) = (0.0, 0_u32);
    for y in 0..photo.height_px() {
        for x in region.columns(y).unwrap_or_default() {
            if photo.at(y, x) < saturated {
                sum += f64::from(residual.at(y, x)).powi(2);
                count += 1;
            }
        }
    }
    sum / f64::from(count.max(1))
}

/// The region in pictures that [`shrunk`] reduced by `block`.
fn shrunk_region(region: RegionOfInterest, block: usize) -> Rectangle {
    let Rectangle { x_px, y_px, width_px, height_px } = region.into();
    let [x_px, y_px, width_px, height_px] = [x_px, y_px, width_px, height_px].map(|px| px / block);
    Rectangle { x_px, y_px, width_px, height_px }
}

/// The plane, reduced to the means over blocks. It is no wider than a picture of the report.
fn shrunk(plane: &Plane<f32>) -> Plane<f32> {
    let block = plane.width_px().div_ceil(WIDTH_PX_MAX);
    let (rows, columns) = (plane.height_px() / block, plane.width_px() / block);
    Plane::from_fn(rows.max(1), columns.max(1), |y, x| {
        let mut sum = 0.0;
        let (mut count, height, width) = (0_u16, plane.height_px(), plane.width_px());
        for py in y * block..((y + 1) * block).min(height) {
            for px in x * block..((x + 1) * block).min(width) {
                sum += plane.at(py, px);
                count += 1;
            }
        }
        sum / f32::from(count.max(1))
    })
}

/// The chapters about residuals and about identifiability.
pub(super) fn chapters(evidence: &Evidence) -> Result<Vec<Chapter>, ReportError> {
    Ok(vec![residuals(evidence)?, identifiability(evidence)?])
}

fn residuals(evidence: &Evidence) -> Result<Chapter, ReportError> {
    let mut chapter = Chapter {
        title: "Photographs and predictions",
        body: "<p>Photographs, the model's predictions with gain and black level fitted to each photograph, and the \
               differences. If the model were complete, the differences would be noise. Only pixels count that are in \
               the region of interest and not saturated. Darkened: light that the pictures do not need.</p>"
            .to_owned(),
        ..Chapter::default()
    };
    let mut body = "<table><tr><th>pair</th><th>used for</th><th class=n>mean squared error</th></tr>".to_owned();
    for pair in &evidence.pairs {
        // Writing to a string cannot fail.
        let _ = write!(
            body,
            "<tr><td>{}</td><td>{}</td><td class=n>{:.3e}</td></tr>",
            escaped(&pair.id),
            word(pair.split),
            pair.loss
        );
        let scaled = |plane: &Plane<f32>, brightest: f32| plane.map(|light| light / brightest);
        let brightest = pair.photo.values().iter().copied().fold(1e-6, f32::max);
        let (photo, predicted) = (scaled(&pair.photo, brightest), scaled(&pair.predicted, brightest));
        let sheet = ContactSheet {
            title: &format!("pair {} ({})", pair.id, word(pair.split)),
            subtitle: &format!("mean squared error {:.3e}", pair.loss),
            columns: &["photograph", "prediction"],
            region: Some(pair.region),
            rows: vec![ContactRow {
                pictures: vec![
                    CaptionedPicture { intensity: &photo, caption: String::new() },
                    CaptionedPicture { intensity: &predicted, caption: String::new() },
                ],
            }],
        };
        let deviation = pair.loss.sqrt().max(1e-6) as f32;
        let axis = |label, px: usize| Axis { label, start: 0.0, end: px as f64 };
        let map = Heatmap {
            title: "prediction − photograph",
            values: &pair.residual,
            colours: ColourMap::Diverging,
            range: (-3.0 * deviation, 3.0 * deviation),
            unit: "",
            x: axis("x", pair.residual.width_px()),
            y: axis("y", pair.residual.height_px()),
        };
        let canvas = Canvas::grid(&[vec![sheet.draw(), map.draw()]]);
        chapter.png(&format!("residual-{}", pair.id), &format!("Pair {}, {}", pair.id, word(pair.split)), &canvas)?;
        let shape = [pair.residual.height_px(), pair.residual.width_px()];
        chapter.array(
            &format!("residual_{}", pair.id),
            &shape,
            pair.residual.values().iter().map(|&value| value.into()),
        );
    }
    chapter.body.push_str(&body);
    chapter.body.push_str("</table>");
    Ok(chapter)
}

fn identifiability(evidence: &Evidence) -> Result<Chapter, ReportError> {
    let power = evidence.lit.power();
    let decibel = power.map(|power| 10.0 * power.max(1e-6).log10());
    let half = 0.5 / evidence.pixel_pitch_m / 1000.0;
    let axis = |label| Axis { label, start: -half, end: half };
    let map = Heatmap {
        title: "light of the training holograms by frequency",
        values: &decibel,
        colours: ColourMap::Sequential,
        range: (-40.0, 20.0),
        unit: "dB",
        x: axis("fx [1/mm]"),
        y: axis("fy [1/mm]"),
    };
    let dark = 100.0 * evidence.lit.dark_part();
    let mut chapter = Chapter {
        title: "Illuminated band",
        body: format!(
            "<p>The training holograms sent less than {:.0} % of the mean light to <b>{dark:.1} %</b> of the band. For \
             these frequencies the photographs contain no information about the kernel. A smooth model continues its \
             values at neighbouring frequencies there, and a kernel with a value for each frequency keeps its initial \
             values. Holograms with a wide range of initial phases (--phase-range 6.28) illuminate the whole band.</p>",
            100.0 * LitBand::DARK
        ),
        ..Chapter::default()
    };
    chapter.png("lit-band", "Light by frequency, in decibels of the mean", &map.draw())?;
    chapter.array("lit_band", &[power.height_px(), power.width_px()], power.values().iter().map(|&value| value.into()));
    Ok(chapter)
}

fn word(split: Split) -> &'static str {
    match split {
        Split::Train => "training",
        Split::Validation => "validation",
        Split::Test => "test",
    }
}
