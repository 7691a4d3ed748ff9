//! The commands `lightpath photo`.

use super::arguments::region;
use super::destination::{self, Destination, PNG};
use super::failure::Failure;
use super::inputs;
use super::session::{Output, Session};
use super::table::{Facts, Table};
use super::words::WordParser;
use clap::Args;
use lightpath::v1;
use serde::Serialize;
use std::path::{Path, PathBuf};

const ALIGNED: Destination = Destination { option: "--aligned", suffix: "-aligned.png", formats: &[PNG] };
const ERROR: Destination = Destination { option: "--error", suffix: "-error.png", formats: &[PNG] };

/// Several scores as one document.
#[derive(Serialize)]
struct Scores<'a> {
    scores: Vec<&'a v1::PhotoScore>,
}

commands! {
    /// Commands about photographs of what displays show.
    PhotoCommand {
        Score(Score),
    }
}

/// Measure how well photographs show a target.
///
/// Finds the target in each photograph, corrects perspective and lens distortion, and compares the two in the middle 80
/// % of each axis. Needs no display and no dataset: any photograph of any display will do, sharp and not saturated. It
/// may show the surroundings, too. The target may be turned by up to 12 degrees, upside down or mirrored.
///
/// PSNR and SSIM are computed after the gain that fits best; PSNR+ after gain and offset. SPECKLE is the standard
/// deviation over the mean in flat bright blocks of 16x16 px. RESOLUTION is the finest detail that photograph and
/// target share, in cycles per pixel of the target, and as a part of the highest frequency that the target can have.
/// RESIDUAL is the root mean square and the largest displacement that the alignment leaves. Above 1 px, do not trust
/// the figures.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath photo score bench.png --target indian_head.png
  lightpath photo score ideal.png learned.png --target usaf1951.png \\
      --aligned aligned/ --error errors/

Look at the pictures of --error before you trust a figure: coloured rims along
the edges mean that the target was not found exactly.")]
pub(crate) struct Score {
    /// Score these photographs: PNG, JPEG, TIFF, BMP or .npy, grey or colour, at least 32x32 px; a folder stands for all pictures
    /// in it
    #[arg(required = true, value_name = "PHOTO")]
    photos: Vec<PathBuf>,

    /// Find and compare this target: PNG, JPEG, TIFF, BMP or .npy, grey or colour, at least 32x32 px
    #[arg(long, value_name = "FILE")]
    target: PathBuf,

    /// Set the encoding of the photographs' values
    #[arg(long, value_name = "ENCODING", default_value = "linear", value_parser = WordParser::<v1::Encoding>::new())]
    photo_encoding: v1::Encoding,

    /// Set the encoding of the target's values
    #[arg(long, value_name = "ENCODING", default_value = "srgb", value_parser = WordParser::<v1::Encoding>::new())]
    target_encoding: v1::Encoding,

    /// Compare this rectangle of the target: x,y,width,height in pixels [default: the middle 80 % of each axis]
    #[arg(long, value_name = "X,Y,W,H", value_parser = region)]
    region: Option<v1::Region>,

    /// Write each photograph, aligned with the target, to this file (PNG), folder or pattern with {name}
    #[arg(long, value_name = "FILE")]
    aligned: Option<PathBuf>,

    /// Write each error, gain · photograph − target, in colours to this file (PNG), folder or pattern with {name}
    #[arg(long, value_name = "FILE")]
    error: Option<PathBuf>,
}

impl Score {
    async fn run(mut self, session: &Session) -> Result<(), Failure> {
        self.photos = inputs::expanded(&self.photos, inputs::PICTURES)?;
        let names: Vec<String> = self.photos.iter().map(|photo| destination::name_of(photo)).collect();
        let files = |destination: Destination, place: &Option<PathBuf>| match place {
            Some(place) => destination.files(&session.stdout, place, &names),
            None => Ok(Vec::new()),
        };
        let aligned = files(ALIGNED, &self.aligned)?;
        let errors = files(ERROR, &self.error)?;
        inputs::check_readable(self.photos.iter().chain([&self.target]))?;
        let inputs = self.photos.iter().chain([&self.target]).map(PathBuf::as_path);
        destination::check_distinct(inputs, aligned.iter().chain(&errors).map(PathBuf::as_path))?;
        let target = session.upload(&self.target).await?;
        let mut scores = Vec::new();
        for (i, photo) in self.photos.iter().enumerate() {
            let score = self.score(session, photo, &target).await?;
            for (digest, files) in [(&score.aligned, &aligned), (&score.error, &errors)] {
                if let Some(file) = files.get(i) {
                    destination::save(session, digest, file).await?;
                }
            }
            session.print_line(&score)?;
            scores.push((names[i].clone(), score));
        }
        match (session.output, scores.as_slice()) {
            (Output::Json, [(_, score)]) => session.print(score, |_| String::new()),
            (Output::Json, scores) => {
                let scores = Scores { scores: scores.iter().map(|(_, score)| score).collect() };
                session.print(&scores, |_| String::new())
            }
            (Output::Table | Output::Jsonl, scores) => session.print_text(&text(scores)),
        }
    }

    async fn score(&self, session: &Session, photo: &Path, target: &str) -> Result<v1::PhotoScore, Failure> {
        let request = v1::ScorePhotoRequest {
            photo: session.upload(photo).await?,
            target: target.to_owned(),
            photo_encoding: self.photo_encoding.into(),
            target_encoding: self.target_encoding.into(),
            region: self.region,
        };
        Ok(session.client.score_photo(request).await?)
    }
}

/// A table with a line for each channel of each photograph; for a single photograph also its place.
fn text(scores: &[(String, v1::PhotoScore)]) -> String {
    let mut table =
        Table::new("photo~|channel|>psnr|>psnr+?|>ssim?|>speckle????|>resolution???|>saturated?????|>residual??");
    for (name, score) in scores {
        for (i, channel) in score.channels.iter().enumerate() {
            let name = if i == 0 { name.clone() } else { String::new() };
            table.row([
                name,
                if score.channels.len() == 1 { "grey" } else { ["red", "green", "blue"][i.min(2)] }.to_owned(),
                format!("{:.1} dB", channel.psnr_db),
                format!("{:.1} dB", channel.psnr_with_offset_db),
                format!("{:.3}", channel.ssim),
                channel.speckle_contrast.map_or("-".to_owned(), |contrast| format!("{contrast:.3}")),
                resolution(channel.resolution_cycles_per_px),
                format!("{:.1} %", 100.0 * score.saturated),
                residual(score),
            ]);
        }
    }
    let places = match scores {
        [(_, score)] => score.place.as_ref().map(place).unwrap_or_default(),
        _ => String::new(),
    };
    format!("{}{places}", table.text())
}

fn resolution(cycles_per_px: f64) -> String {
    format!("{cycles_per_px:.3} c/px, {:.0} %", 200.0 * cycles_per_px)
}

fn residual(score: &v1::PhotoScore) -> String {
    let px = score.place.as_ref().and_then(|place| place.residual_rms_px.zip(place.residual_largest_px));
    px.map_or("-".to_owned(), |(rms, largest)| format!("{rms:.2} px, at most {largest:.2} px"))
}

/// Where the target was found.
fn place(place: &v1::PhotoPlace) -> String {
    let mut facts = Facts::default();
    if let [xx, xy, x, yx, yy, y, ..] = place.homography[..] {
        facts.add("upper left corner", format!("x {x:.1} px, y {y:.1} px of the photograph"));
        let scale = (xx * yy - xy * yx).abs().sqrt();
        facts.add("magnification", format!("{scale:.3} camera px per target px, in that corner"));
    }
    facts.add(
        "distortion",
        format!("k1 {:+.4}, k2 {:+.4}, p1 {:+.4}, p2 {:+.4}", place.k1, place.k2, place.p1, place.p2),
    );
    facts.add("mirrored", if place.mirrored { "yes" } else { "no" });
    facts.add("correlation", format!("{:.2} of the details; 1 is best, below 0.35 is refused", place.correlation));
    format!("\n{}", facts.text())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn score(channels: usize) -> v1::PhotoScore {
        let channel = v1::ChannelScore {
            psnr_db: 17.42,
            psnr_with_offset_db: 18.5,
            ssim: 0.61,
            speckle_contrast: Some(0.2),
            resolution_cycles_per_px: 0.125,
            ..Default::default()
        };
        let place = v1::PhotoPlace {
            homography: vec![1.2, 0.0, 300.0, 0.0, 1.2, 40.0, 0.0, 0.0, 1.0],
            correlation: 0.5,
            residual_rms_px: Some(0.31),
            residual_largest_px: Some(0.8),
            ..Default::default()
        };
        v1::PhotoScore { channels: vec![channel; channels], place: Some(place), saturated: 0.02, ..Default::default() }
    }

    #[test]
    fn every_channel_has_a_line_with_units() {
        let grey = text(&[("bench".to_owned(), score(1))]);
        let line =
            "bench  grey     17.4 dB  18.5 dB  0.610    0.200  0.125 c/px, 25 %      2.0 %  0.31 px, at most 0.80 px";
        assert!(grey.contains(line), "{grey}");
        assert!(grey.contains("x 300.0 px, y 40.0 px") && grey.contains("1.200 camera px"), "{grey}");
        let both = text(&[("a".to_owned(), score(3)), ("b".to_owned(), score(1))]);
        assert!(both.lines().count() == 5 && both.contains("green") && !both.contains("magnification"), "{both}");
    }
}
