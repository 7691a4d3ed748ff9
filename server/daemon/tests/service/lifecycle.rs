//! Tests of health, reflection, and stopping.

use crate::http::get;
use crate::serving::{Serving, expect};
use lightpath_proto::v1;
use lightpath_server::server;
use std::time::Duration;
use tokio::net::TcpListener;
use tonic::{Code, Streaming};
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;
use tonic_health::pb::{HealthCheckRequest, HealthCheckResponse};
use tonic_reflection::pb::v1::ServerReflectionRequest;
use tonic_reflection::pb::v1::server_reflection_client::ServerReflectionClient;
use tonic_reflection::pb::v1::server_reflection_request::MessageRequest;
use tonic_reflection::pb::v1::server_reflection_response::MessageResponse;

#[tokio::test]
async fn health_and_reflection_answer() {
    let serving = Serving::start().await;
    for service in ["", "lightpath.v1.JobService"] {
        let request = HealthCheckRequest { service: service.into() };
        let health = HealthClient::new(serving.channel.clone()).check(request).await.unwrap().into_inner();
        assert_eq!(health.status().as_str_name(), "SERVING");
    }
    let list = MessageRequest::ListServices(String::new());
    let request = ServerReflectionRequest { host: String::new(), message_request: Some(list) };
    let mut client = ServerReflectionClient::new(serving.channel.clone());
    let mut answers = client.server_reflection_info(tokio_stream::iter([request])).await.unwrap().into_inner();
    let Some(MessageResponse::ListServicesResponse(list)) = answers.message().await.unwrap().unwrap().message_response
    else {
        panic!("no list")
    };
    assert!(list.service.iter().any(|service| service.name == "lightpath.v1.KernelService"));
}

/// Waits until the server reports this status.
async fn until_health_is(watch: &mut Streaming<HealthCheckResponse>, wanted: ServingStatus) {
    let reported = async { while watch.message().await.unwrap().unwrap().status() != wanted {} };
    tokio::time::timeout(Duration::from_secs(30), reported).await.expect("the health did not change in time");
}

async fn watch_health(serving: &Serving) -> Streaming<HealthCheckResponse> {
    let request = HealthCheckRequest::default();
    HealthClient::new(serving.channel.clone()).watch(request).await.unwrap().into_inner()
}

#[tokio::test]
async fn health_reports_low_disk_space() {
    // The reserve is larger than any disk.
    let serving = Serving::start_with(|config| config.disk_reserve_mib = 1e12).await;
    until_health_is(&mut watch_health(&serving).await, ServingStatus::NotServing).await;
    let (code, text) = get(&serving, "/healthz").await;
    assert_eq!(code, 503);
    assert!(text.contains("are reserved for accepted work"), "{text}");
}

#[tokio::test]
async fn health_reports_that_the_server_stops() {
    let serving = Serving::start_with(|config| config.drain_deadline_s = 2.0).await;
    let mut watch = watch_health(&serving).await;
    until_health_is(&mut watch, ServingStatus::Serving).await;
    serving.begin_to_stop();
    until_health_is(&mut watch, ServingStatus::NotServing).await;
    serving.stop().await.unwrap();
}

#[tokio::test]
async fn unknown_methods_are_unimplemented() {
    let serving = Serving::start().await;
    let mut grpc = tonic::client::Grpc::new(serving.channel.clone());
    grpc.ready().await.unwrap();
    let codec = tonic_prost::ProstCodec::<v1::GetJobRequest, v1::Job>::default();
    let path = tonic::codegen::http::uri::PathAndQuery::from_static("/lightpath.v1.NoService/Nothing");
    let answer = grpc.unary(tonic::Request::new(v1::GetJobRequest::default()), path, codec).await;
    expect(answer, Code::Unimplemented, "the method /lightpath.v1.NoService/Nothing does not exist");
}

#[tokio::test]
async fn stopping_ends_watchers_and_refuses_calls() {
    let serving = Serving::start().await;
    let job = crate::jobs::submit_long(&serving).await;
    let request = v1::WatchJobRequest { name: job.name.clone() };
    let mut stream = serving.jobs().watch_job(request).await.unwrap().into_inner();
    stream.message().await.unwrap().unwrap();
    serving.begin_to_stop();
    let end = loop {
        match stream.message().await {
            Ok(Some(_)) => {}
            end => break end,
        }
    };
    expect(end, Code::Unavailable, "the server is stopping");
    let late = serving.jobs().get_job(v1::GetJobRequest { name: job.name.clone() }).await;
    assert_eq!(late.unwrap_err().code(), Code::Unavailable, "the call is refused, or the connection is closed");
    serving.stop().await.unwrap();
}

#[tokio::test]
async fn second_server_on_the_same_folder_is_refused() {
    let serving = Serving::start().await;
    // An answered call proves that the server has locked the folder.
    serving.display("lab").await;
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let refused = server::run(listener, serving.config.clone(), std::future::pending()).await.unwrap_err();
    assert!(refused.to_string().contains("is locked by another process"), "{refused}");
    serving.display("lab").await;
}
