//! The gRPC services and HTTP on one port, and who may call them.
//!
//! # Layout
//!
//! - [`api`]: the gRPC services. [`http`]: health, metrics, JSON, and the gate that every request passes.
//! - [`connections`]: both on one port. [`tls`]: certificates. [`audit`]: what was done and refused.
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod api;
pub mod audit;
pub mod connections;
pub mod http;
pub mod tls;
