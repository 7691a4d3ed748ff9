//! Tests of every call with every role, scope and protocol, generated from the API. A method, a field or a changing
//! call that these tests do not know fails them.
//!
//! # Layout
//!
//! - `roles`: which callers may make each call, over which protocol. `http_routes`: the same over HTTP.
//!   `protocols`: requests in any protocol.
//! - `foreign`: what a token may not see does not exist for it. `own`: what it may see is answered, and every change is
//!   logged. `fields`: what each field of each request names. `examples`: a valid request for every method.
//! - `two_worlds`: a server with two displays. `world`: the things on one display. `traces`: what reveals them. `person`:
//!   a client with a token.

mod examples;
mod fields;
mod foreign;
mod http_routes;
mod own;
mod person;
mod protocols;
mod roles;
mod traces;
mod two_worlds;
mod world;
