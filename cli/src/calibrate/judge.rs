//! The judgement of a calibration: photographs of new pictures, with and without what was learned.

use super::steps::Steps;
use super::{Bench, pattern_of};
use crate::failure::Failure;
use crate::session::{Session, print_note};
use crate::show;
use crate::table::Table;
use lightpath::photos_result;
use lightpath::v1::capture_photos::Pattern;
use lightpath::v1::{self, job_spec};
use std::path::Path;

/// Numbers of the test pictures, which no hologram to learn from showed.
const PICTURES: [u32; 2] = [140, 145];
/// Steps of their holograms.
const ITERATIONS: u32 = 100;

/// Photographs new pictures through ideal optics and through the version, and compares both with the pictures.
pub(super) async fn judged(
    session: &Session,
    bench: &Bench,
    steps: &Steps<'_>,
    version: &str,
    folder: Option<&Path>,
) -> Result<String, Failure> {
    let mut targets = Vec::new();
    let mut kinds = Vec::new();
    for number in PICTURES {
        let request = v1::CreateCalibrationTargetRequest { display: bench.display.clone(), picture: Some(number) };
        let target = session.client.create_calibration_target(request).await?.target;
        for (name, kernel) in [("ideal", v1::KernelChoice::ideal()), ("learned", v1::KernelChoice::version(version))] {
            let mut kind = bench.hologram(&target, ITERATIONS, None);
            if let job_spec::Kind::OptimizeHologram(spec) = &mut kind {
                spec.kernel = Some(kernel);
            }
            let version = version.rsplit('/').next().unwrap_or_default();
            kinds.push((format!("judge-{number}-{name}-{version}"), kind));
        }
        targets.push((number, target));
    }
    let jobs = steps.jobs("compute holograms of new pictures, without and with the kernel", kinds).await?;
    let mut patterns = Vec::new();
    for (id, job) in jobs {
        patterns.push(Pattern { id, pattern: pattern_of(&job)? });
    }
    let name = format!("judge-{}", version.rsplit('/').next().unwrap_or_default());
    let taken = steps.job(&name, "photograph them", bench.capture(&patterns, true)).await?;
    let photos = &photos_result(&taken)?.photos;
    let mut table = Table::new("new picture|>ideal optics|>learned|>gain");
    for ((number, target), two) in targets.iter().zip(photos.chunks(2)) {
        let mut found_db = Vec::new();
        for photo in two {
            if let Some(folder) = folder {
                session.client.download_to(&photo.photo, &folder.join(format!("{}.png", photo.id))).await?;
            }
            found_db.push(score_db(session, &photo.photo, target).await?);
        }
        let gain = match found_db.as_slice() {
            [Some(ideal_db), Some(learned_db)] => format!("{:+.1} dB", learned_db - ideal_db),
            _ => "–".to_owned(),
        };
        let mut cells = found_db.iter().map(|found| found.map_or_else(|| "not found".to_owned(), show::decibel));
        table.row([format!("{number}"), cells.next().unwrap_or_default(), cells.next().unwrap_or_default(), gain]);
    }
    Ok(table.text())
}

/// PSNR of a photograph of a target \[dB\]; `None`: the target was not found in it.
async fn score_db(session: &Session, photo: &str, target: &str) -> Result<Option<f64>, Failure> {
    let request = v1::ScorePhotoRequest { photo: photo.to_owned(), target: target.to_owned(), ..Default::default() };
    match session.client.score_photo(request).await {
        Ok(score) => Ok(score.channels.first().map(|channel| channel.psnr_db)),
        Err(error) if error.code() == Some(lightpath::Code::InvalidArgument) => {
            print_note(&error.to_string());
            Ok(None)
        }
        Err(error) => Err(error.into()),
    }
}
