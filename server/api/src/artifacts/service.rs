//! The artifact service.

use super::to_wire;
use crate::api::Api;
use crate::call::StatusStream;
use lightpath_proto::v1;
use lightpath_proto::v1::artifact_service_server::ArtifactService;
use lightpath_service::{Call, Field, ServiceError};
use tonic::{Request, Response, Status, Streaming};

#[tonic::async_trait]
impl ArtifactService for Api {
    async fn get_artifact(&self, request: Request<v1::GetArtifactRequest>) -> Result<Response<v1::Artifact>, Status> {
        self.answer(request, Self::get_artifact).await
    }

    async fn get_upload(&self, request: Request<v1::GetUploadRequest>) -> Result<Response<v1::Upload>, Status> {
        self.answer(request, Self::get_upload).await
    }

    async fn write_artifact(
        &self,
        request: Request<Streaming<v1::WriteArtifactRequest>>,
    ) -> Result<Response<v1::Artifact>, Status> {
        self.answer(request, Self::write_artifact).await
    }

    type ReadArtifactStream = StatusStream<v1::ReadArtifactResponse>;

    async fn read_artifact(
        &self,
        request: Request<v1::ReadArtifactRequest>,
    ) -> Result<Response<Self::ReadArtifactStream>, Status> {
        self.answer_with_stream(request, Self::read_artifact).await
    }
}

impl Api {
    async fn get_artifact(&self, call: &Call, request: v1::GetArtifactRequest) -> Result<v1::Artifact, ServiceError> {
        let field = Field::new("digest");
        let digest = field.digest(&request.digest)?;
        // The answer counts as a use, because clients that find the artifact use it next.
        Ok(to_wire::artifact(self.service.files.uploaded(call, &field, &digest).await?))
    }
}
