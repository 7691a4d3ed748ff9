//! Calls of the gRPC methods in this process, with messages that are encoded already.

use super::refusal::Refusal;
use axum::Router;
use axum::http::Extensions;
use lightpath_proto::routes::Route;
use prost::bytes::{Buf as _, BufMut as _, Bytes};
use tonic::codec::{Codec, DecodeBuf, Decoder, EncodeBuf, Encoder};
use tonic::codegen::http::uri::PathAndQuery;
use tonic::metadata::MetadataMap;
use tonic::{Status, Streaming};

/// The JSON of the answer of a method.
pub(super) async fn unary(
    grpc: Router,
    route: &Route,
    extensions: Extensions,
    message: Bytes,
) -> Result<Vec<u8>, Refusal> {
    let request = tonic::Request::from_parts(MetadataMap::new(), extensions, message);
    // Nothing waits until this client is ready: a router always is.
    let mut client = tonic::client::Grpc::new(grpc);
    let answer = client.unary(request, PathAndQuery::from_static(route.method), Messages).await?.into_inner();
    Ok(route.json(answer).map_err(|error| Status::internal(error.to_string()))?)
}

/// The answers of a method.
pub(super) async fn streaming(
    grpc: Router,
    route: &Route,
    extensions: Extensions,
    message: Bytes,
) -> Result<Streaming<Bytes>, Refusal> {
    let request = tonic::Request::from_parts(MetadataMap::new(), extensions, message);
    let mut client = tonic::client::Grpc::new(grpc);
    let answers = client.server_streaming(request, PathAndQuery::from_static(route.method), Messages).await?;
    Ok(answers.into_inner())
}

/// Messages as they are, for calls whose messages are encoded already.
#[derive(Debug)]
struct Messages;

impl Codec for Messages {
    type Encode = Bytes;
    type Decode = Bytes;
    type Encoder = Self;
    type Decoder = Self;

    fn encoder(&mut self) -> Self {
        Self
    }

    fn decoder(&mut self) -> Self {
        Self
    }
}

impl Encoder for Messages {
    type Item = Bytes;
    type Error = Status;

    fn encode(&mut self, message: Bytes, buffer: &mut EncodeBuf<'_>) -> Result<(), Status> {
        buffer.put(message);
        Ok(())
    }
}

impl Decoder for Messages {
    type Item = Bytes;
    type Error = Status;

    fn decode(&mut self, buffer: &mut DecodeBuf<'_>) -> Result<Option<Bytes>, Status> {
        Ok(Some(buffer.copy_to_bytes(buffer.remaining())))
    }
}
