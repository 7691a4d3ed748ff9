//! Pictures of artifacts for people.

use super::{Files, unreadable};
use crate::call::Call;
use crate::error::Result;
use crate::field::Field;
use lightpath_domain::dataset::Encoding;
use lightpath_domain::job::Fit;
use lightpath_media::figures::{Drawn, Subtracted, View, view};
use lightpath_media::pictures::{Channel, Rectangle};

/// Memory for a pixel of a view \[bytes\]: three planes of light and their colours.
const VIEW_PIXEL_BYTES: u64 = 3 * 4 + 3 + 3;

/// A picture whose light is subtracted from that of another one.
#[derive(Clone, Debug)]
pub struct Minus {
    /// Digest of the picture.
    pub digest: String,
    /// Encoding of its light.
    pub encoding: Encoding,
    /// How it is fitted to the area.
    pub fit: Fit,
    /// The part of the other one that it fills; `None`: all of it.
    pub area: Option<Rectangle>,
    /// What of it gives its light.
    pub channel: Channel,
}

impl Files {
    /// Memory for drawing a view of an artifact \[bytes\]. `minus` is the digest of the picture whose light is subtracted.
    /// Refuses artifacts that the caller may not read.
    pub async fn view_bytes(
        &self,
        call: &Call,
        (field, digest): (&Field, &str),
        minus: Option<(&Field, &str)>,
    ) -> Result<u64> {
        let mut need_bytes = self.reading_bytes(call, field, digest, 0).await?;
        let pixels = self.picture_pixels(call, field, digest).await?;
        need_bytes += VIEW_PIXEL_BYTES * pixels;
        if let Some((field, minus)) = minus {
            need_bytes += self.reading_bytes(call, field, minus, pixels).await?;
        }
        Ok(need_bytes)
    }

    /// Draws a view of an artifact. `need_bytes` is what [`Self::view_bytes`] returned.
    pub async fn view(
        &self,
        call: &Call,
        need_bytes: u64,
        (field, digest): (&Field, &str),
        minus: Option<Minus>,
        wanted: View,
    ) -> Result<Drawn> {
        let (artifacts, name) = (self.artifacts.clone(), digest.to_owned());
        let draw = move || -> Result<_> {
            let picture = artifacts.read_blocking(&name)?;
            let bytes = minus.as_ref().map(|minus| artifacts.read_blocking(&minus.digest)).transpose()?;
            let subtracted = bytes.as_deref().zip(minus).map(|(bytes, minus)| {
                let Minus { encoding, fit, area, channel, .. } = minus;
                Subtracted { bytes, encoding, fit, area, channel }
            });
            Ok(view(&picture, subtracted, &wanted))
        };
        let drawn = self.computing.run(call, need_bytes, draw).await??;
        drawn.map_err(|error| unreadable(field, digest, &error))
    }
}
