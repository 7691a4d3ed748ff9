//! End to end: real servers with real databases in temporary folders, spoken to over the wire.
#![allow(clippy::unwrap_used)]

// What the tests work with.

/// What a server has promised.
mod ledger;
/// Displays, pictures and job specs.
mod material;
/// The binaries `lightpath` and `lightpathd`, as processes.
mod process;
/// A server inside the test's process.
mod server;

// The tests.

/// Bad input through the command line: the same, and exit codes.
mod bad_input_cli;
/// Bad input through raw gRPC: refused with a code, a field and a fix, and no harm done.
mod bad_input_grpc;
/// Killing the server at random moments, and stopping it past its leases.
mod crash;
/// Many small jobs from two clients at once.
mod crowd;
/// Same request, same bytes.
mod determinism;
/// Little room on the disk, and none.
mod disk;
/// Clients that send much and end nothing, or ask for much and take nothing.
mod hoards;
/// Slow connections, and those that speak nonsense.
mod hostile;
/// Whether each crate and module imports only what it may.
mod imports;
/// Cancelling, retrying, watching, repeating.
mod jobs;
/// Several planes, wavelengths and frames, every method, through the command line.
mod planes_and_colours;
/// Everything at once, for as long as wanted.
mod soak;
/// Large uploads, cut and damaged ones.
mod uploads;
/// The main job through the command line, from the display to the learned kernel.
mod whole_loop;
