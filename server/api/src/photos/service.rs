//! The photo service.

use super::to_wire;
use crate::api::Api;
use crate::call::answers;
use crate::enumerations::WireField as _;
use crate::optics::from_wire::region_px;
use lightpath_domain::dataset::Encoding;
use lightpath_proto::v1;
use lightpath_proto::v1::photo_service_server::PhotoService;
use lightpath_service::{Call, Field, Result, ScoreRequest};

answers! {
    PhotoService {
        score_photo(v1::ScorePhotoRequest) -> v1::PhotoScore;
    }
}

impl Api {
    pub(crate) async fn score_photo(&self, call: &Call, request: v1::ScorePhotoRequest) -> Result<v1::PhotoScore> {
        let encoding = |name: &str, number: i32| Field::new(name).enum_value::<Encoding>(number);
        let request = ScoreRequest {
            photo: Field::new("photo").digest(&request.photo)?,
            target: Field::new("target").digest(&request.target)?,
            photo_encoding: encoding("photo_encoding", request.photo_encoding)?.unwrap_or(Encoding::Linear),
            target_encoding: encoding("target_encoding", request.target_encoding)?.unwrap_or(Encoding::Srgb),
            region_px: request.region.map(region_px),
        };
        Ok(to_wire::photo_score(self.service.photos.score(call, request).await?))
    }
}
