//! Lightpath's API as Rust types: messages, clients and servers of package `lightpath.v1`.
//!
//! The `.proto` files are the documentation: every field has its unit, range and default there.
//! Every message also implements serde's traits in protobuf's JSON form, and every enumeration [`Words`].

mod words;

pub use words::{Word, Words};

/// Package `lightpath.v1`.
pub mod v1 {
    #![allow(missing_docs, unreachable_pub, clippy::all)] // generated
    tonic::include_proto!("lightpath.v1");
    include!(concat!(env!("OUT_DIR"), "/lightpath.v1.serde.rs"));
}

/// The encoded file descriptors, for gRPC reflection.
pub const DESCRIPTORS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/descriptors.bin"));
