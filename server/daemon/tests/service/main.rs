//! Tests of the whole server over the network. Each test starts a server on a free port with a new data folder.
#![allow(clippy::unwrap_used)]

mod access;
mod access_matrix;
mod artifact_pictures;
mod artifacts;
mod audit;
mod bucket;
mod captures;
mod decoders;
mod displays;
mod events;
mod forms;
mod holograms;
mod http;
mod interpolation;
mod jobs;
mod kernels;
mod lifecycle;
mod live_pictures;
mod malformed;
mod manifests;
mod memory_limits;
mod mutation;
mod openapi;
mod ownership;
mod page;
mod photos;
mod preparing;
mod raw;
mod read_only;
mod rollouts;
mod rough_photographs;
mod serving;
mod several;
mod test_bench;
mod web_pages;
