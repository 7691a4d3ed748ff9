//! Artifacts as pictures for people, and the colours of their bars.

use super::etags::{IMMUTABLE, etag, has, unless_known};
use super::refusal::{Refusal, checked};
use crate::api::Api;
use axum::Extension;
use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use lightpath_domain::dataset::Encoding;
use lightpath_domain::job::Fit;
use lightpath_media::figures::{ColourMap, View, ViewColours};
use lightpath_media::pictures::{Channel, Rectangle, SIDE_PX_MAX, rgb_png};
use lightpath_optics::Plane;
use lightpath_service::{Call, Field, Minus, Result, ServiceError};
use serde::Deserialize;
use tonic::{Code, Status};

/// Number of colours of a map that clients get.
const COLOURS: usize = 256;
/// Largest number of decades of a logarithmic scale: more than light of 16 bits has.
const DECADES_MAX: f64 = 9.0;
/// Columns and rows of the whole picture, such as `1920x1080`: pages need them to ask for a part of it.
const PICTURE_SIZE: header::HeaderName = header::HeaderName::from_static("picture-size");
/// PSNR of the shown part against the picture that is subtracted \[dB\], such as `41.73`: with the best gain, and with the best
/// gain and offset.
const PICTURE_PSNR: [header::HeaderName; 2] =
    [header::HeaderName::from_static("picture-psnr"), header::HeaderName::from_static("picture-psnr-with-offset")];
const PNG: [(header::HeaderName, &str); 1] = [(header::CONTENT_TYPE, "image/png")];

/// The query of a picture.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Wish {
    /// Largest number of columns \[px\].
    width: Option<u32>,
    colormap: Option<Colours>,
    /// Decades of a logarithmic scale.
    log: Option<f32>,
    /// Light at the end of the scale.
    range: Option<f32>,
    /// `x,y,width,height` \[px\].
    region: Option<String>,
    encoding: Option<Encoding>,
    /// Digest of the picture whose light is subtracted.
    minus: Option<String>,
    /// How that picture is fitted to its region.
    minus_fit: Fit,
    /// The part of the first picture that it fills, `x,y,width,height` \[px\]; `None`: all of it.
    minus_region: Option<String>,
    minus_encoding: Option<Encoding>,
    /// The colour of that picture which gives its light; `None`: the mean of all.
    minus_channel: Option<ColourChannel>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
enum ColourChannel {
    Red,
    Green,
    Blue,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Colours {
    Grey,
    Sequential,
    Diverging,
    Cyclic,
}

/// Handles `GET /v1/artifacts/{digest}/picture`.
pub(super) async fn get_picture(
    State(api): State<Api>,
    Extension(call): Extension<Call>,
    Path(digest): Path<String>,
    query: Result<Query<Wish>, QueryRejection>,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    let Query(wish) = checked(query)?;
    let (field, minus_field) = (Field::new("digest"), Field::new("minus"));
    let digest = field.digest(&digest)?;
    let minus = wish.minus.as_deref().map(|minus| minus_field.digest(minus)).transpose()?;
    let wanted = wish.view()?;
    let area = wish.minus_region.as_deref().map(|text| region("minus_region", text)).transpose()?;
    let subtracted = minus.as_deref().map(|minus| (&minus_field, minus));
    let need_bytes = api.service.files.view_bytes(&call, (&field, &digest), subtracted).await?;
    let etag = etag(format!("{digest} {wish:?}"));
    if has(&headers, &etag) {
        return Ok(unless_known(&headers, &etag, IMMUTABLE, ()));
    }
    let (fit, encoding) = (wish.minus_fit, wish.minus_encoding.unwrap_or(Encoding::Srgb));
    let channel = wish.minus_channel.map_or(Channel::Mean, |colour| Channel::Colour(colour as usize));
    let minus = minus.map(|digest| Minus { digest, encoding, fit, area, channel });
    let drawn = api.service.files.view(&call, need_bytes, (&field, &digest), minus, wanted).await?;
    let size = [(PICTURE_SIZE, format!("{}x{}", drawn.width_px, drawn.height_px))];
    let psnr = drawn.closeness.map(|found| {
        let [gain, offset] = PICTURE_PSNR;
        [(gain, format!("{:.2}", found.psnr_db)), (offset, format!("{:.2}", found.psnr_with_offset_db))]
    });
    Ok(unless_known(&headers, &etag, IMMUTABLE, (size, psnr, PNG, drawn.png)))
}

/// Handles `GET /v1/colormaps/{colormap}`: the colours of a map from its start to its end, 256 in a row.
pub(super) async fn get_colormap(colours: Result<Path<Colours>, PathRejection>) -> Result<Response, Refusal> {
    let Path(colours) = colours.map_err(|error| {
        let fix = "use grey, sequential, diverging or cyclic";
        Refusal::new(StatusCode::NOT_FOUND, Code::NotFound, "NO_SUCH_PATH", error.body_text(), fix)
    })?;
    let row = Plane::from_fn(1, COLOURS, |_, x| match ViewColours::from(colours) {
        ViewColours::Map(map) => map.colour(x as f32 / (COLOURS - 1) as f32),
        ViewColours::Own | ViewColours::Grey => [x as u8; 3],
    });
    let png = rgb_png(&row).map_err(|error| Status::internal(error.to_string()))?;
    Ok(([(header::CACHE_CONTROL, IMMUTABLE)], PNG, png).into_response())
}

impl Wish {
    fn view(&self) -> Result<View> {
        let side = 1..=SIDE_PX_MAX;
        let width = self.width.map(|width| Field::new("width").integer(width, side)).transpose()?;
        let positive = |name: &str, value: f32, most: f64| {
            let value = Field::new(name).number(value.into(), f64::from(f32::EPSILON)..=most)?;
            Ok::<_, ServiceError>(value as f32)
        };
        Ok(View {
            encoding: self.encoding.unwrap_or(Encoding::Srgb),
            region: self.region.as_deref().map(|text| region("region", text)).transpose()?,
            width_px: width.map(|width| width as usize),
            colours: self.colormap.map_or(ViewColours::Own, Into::into),
            decades: self.log.map(|decades| positive("log", decades, DECADES_MAX)).transpose()?,
            range: positive("range", self.range.unwrap_or(1.0), 1.0)?,
        })
    }
}

fn region(name: &str, text: &str) -> Result<Rectangle> {
    let numbers = text.split(',').map(str::parse).collect::<Result<Vec<usize>, _>>();
    match numbers.as_deref() {
        Ok(&[x_px, y_px, width_px, height_px]) => Ok(Rectangle { x_px, y_px, width_px, height_px }),
        _ => Err(Field::new(name).but(format!("is {text:?}"), "must be x,y,width,height in px, such as 0,0,640,480")),
    }
}

impl From<Colours> for ViewColours {
    fn from(colours: Colours) -> Self {
        match colours {
            Colours::Grey => Self::Grey,
            Colours::Sequential => Self::Map(ColourMap::Sequential),
            Colours::Diverging => Self::Map(ColourMap::Diverging),
            Colours::Cyclic => Self::Map(ColourMap::Cyclic),
        }
    }
}
