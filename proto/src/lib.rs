//! The Lightpath API as Rust types: messages, clients and servers of package `lightpath.v1`.
//!
//! The `.proto` files document the API, with the unit, range and default of every field. Every message implements the
//! traits of serde for the JSON form of protobuf, and every enumeration implements [`Words`]. [`routes`] has the methods over HTTP.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod codes;
mod displays;
pub mod judgements;
mod kernel_choice;
mod place;
pub mod routes;
mod words;

pub use codes::code_name;
/// Which fields of a message an update changes.
pub use pbjson_types::FieldMask;
/// A time in messages.
pub use pbjson_types::Timestamp;
pub use words::{Word, Words};

/// Generated types of package `lightpath.v1`.
pub mod v1 {
    #![allow(missing_docs, unreachable_pub, clippy::all, clippy::too_many_lines)] // generated
    tonic::include_proto!("lightpath.v1");
    include!(concat!(env!("OUT_DIR"), "/lightpath.v1.serde.rs"));
}

/// Encoded file descriptors of the API, for gRPC reflection.
pub const DESCRIPTORS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/descriptors.bin"));

/// The OpenAPI document of the API over HTTP, as JSON.
pub const OPENAPI: &str = include_str!(concat!(env!("OUT_DIR"), "/openapi.json"));
