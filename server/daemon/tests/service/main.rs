//! The server, spoken to over the wire: each test starts one on a free port with a fresh data folder.
#![allow(clippy::unwrap_used)]

mod access;
mod artifacts;
mod captures;
mod decoders;
mod displays;
mod http;
mod interpolation;
mod jobs;
mod kernels;
mod lifecycle;
mod malformed;
mod mutation;
mod optics_lab;
mod ownership;
mod preparing;
mod raw;
mod rough_photographs;
mod serving;
mod under_way;
