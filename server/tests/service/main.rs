//! The server, spoken to over the wire: each test starts one on a free port with a fresh data folder.
#![allow(clippy::unwrap_used)]

mod access;
mod artifacts;
mod captures;
mod displays;
mod http;
mod jobs;
mod kernels;
mod lifecycle;
mod optics_lab;
mod ownership;
mod rough_photographs;
mod serving;
