//! The photo service.

use crate::api::Api;
use lightpath_proto::v1;
use lightpath_proto::v1::photo_service_server::PhotoService;
use tonic::{Request, Response, Status};

#[tonic::async_trait]
impl PhotoService for Api {
    async fn score_photo(&self, request: Request<v1::ScorePhotoRequest>) -> Result<Response<v1::PhotoScore>, Status> {
        self.answer(request, Self::score_photo).await
    }
}
