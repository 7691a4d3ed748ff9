//! The routes of all services.

use crate::api::Api;
use lightpath_proto::v1::artifact_service_server::ArtifactServiceServer;
use lightpath_proto::v1::dataset_service_server::DatasetServiceServer;
use lightpath_proto::v1::device_service_server::DeviceServiceServer;
use lightpath_proto::v1::display_service_server::DisplayServiceServer;
use lightpath_proto::v1::event_service_server::EventServiceServer;
use lightpath_proto::v1::job_service_server::JobServiceServer;
use lightpath_proto::v1::kernel_service_server::KernelServiceServer;
use lightpath_proto::v1::photo_service_server::PhotoServiceServer;
use lightpath_proto::v1::rig_service_server::RigServiceServer;
use lightpath_proto::v1::rollout_service_server::RolloutServiceServer;
use lightpath_proto::v1::server_service_server::ServerServiceServer;
use lightpath_proto::v1::webhook_service_server::WebhookServiceServer;
use tonic::service::Routes;
use tonic_health::server::HealthReporter;

/// Largest message that clients may send \[bytes\]: twice the largest chunk of an upload.
pub(crate) const MESSAGE_BYTES_MAX: usize = 4 << 20;

impl Api {
    /// Routes of all services, with health and reflection, and a reporter for the health of the server.
    pub fn routes(self) -> Result<(Routes, HealthReporter), tonic_reflection::server::Error> {
        let (health, health_service) = tonic_health::server::health_reporter();
        let reflection = || {
            tonic_reflection::server::Builder::configure()
                .register_encoded_file_descriptor_set(lightpath_proto::DESCRIPTORS)
                .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
        };
        let limit = MESSAGE_BYTES_MAX;
        let routes = Routes::default()
            .add_service(DisplayServiceServer::new(self.clone()).max_decoding_message_size(limit))
            .add_service(DatasetServiceServer::new(self.clone()).max_decoding_message_size(limit))
            .add_service(JobServiceServer::new(self.clone()).max_decoding_message_size(limit))
            .add_service(KernelServiceServer::new(self.clone()).max_decoding_message_size(limit))
            .add_service(RolloutServiceServer::new(self.clone()).max_decoding_message_size(limit))
            .add_service(DeviceServiceServer::new(self.clone()).max_decoding_message_size(limit))
            .add_service(EventServiceServer::new(self.clone()).max_decoding_message_size(limit))
            .add_service(RigServiceServer::new(self.clone()).max_decoding_message_size(limit))
            .add_service(PhotoServiceServer::new(self.clone()).max_decoding_message_size(limit))
            .add_service(WebhookServiceServer::new(self.clone()).max_decoding_message_size(limit))
            .add_service(ServerServiceServer::new(self.clone()).max_decoding_message_size(limit))
            .add_service(ArtifactServiceServer::new(self).max_decoding_message_size(limit))
            .add_service(health_service)
            .add_service(reflection().build_v1()?)
            .add_service(reflection().build_v1alpha()?);
        Ok((routes, health))
    }
}
