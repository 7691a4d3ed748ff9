//! The artifact service.

use super::to_wire;
use crate::api::Api;
use crate::call::answers;
use lightpath_proto::v1;
use lightpath_proto::v1::artifact_service_server::ArtifactService;
use lightpath_service::{Call, Field, Result};
use tonic::Streaming;

answers! {
    ArtifactService {
        get_artifact(v1::GetArtifactRequest) -> v1::Artifact;
        get_upload(v1::GetUploadRequest) -> v1::Upload;
        write_artifact(Streaming<v1::WriteArtifactRequest>) -> v1::Artifact;
    }
    streams {
        read_artifact(v1::ReadArtifactRequest) -> v1::ReadArtifactResponse as ReadArtifactStream;
    }
}

impl Api {
    async fn get_artifact(&self, call: &Call, request: v1::GetArtifactRequest) -> Result<v1::Artifact> {
        let field = Field::new("digest");
        let digest = field.digest(&request.digest)?;
        // The answer counts as a use, because clients that find the artifact use it next.
        Ok(to_wire::artifact(self.service.files.uploaded(call, &field, &digest).await?))
    }
}
