//! End-to-end tests. They start real servers with real databases in temporary folders, and call them over the network.
#![allow(clippy::unwrap_used)]

// Shared by the tests.

/// Runs the command line against a server of its own.
mod command_line;
/// A proxy that disturbs the connections of one process to one server.
mod fault_proxy;
/// Jobs of all kinds and sizes.
mod job_shapes;
/// A record of everything that a server has acknowledged.
mod ledger;
/// Displays, pictures, kernels and job specs.
mod material;
/// Runs the programs `lightpath`, `lightpathd` and `lightpath-agent` as processes.
mod process;
/// A server inside the test's process.
mod rigs;
mod server;

// The tests.

/// Attackers of every kind at once, and an honest client beside them.
mod attack;
/// Invalid input on the command line: exit codes and messages.
mod bad_input_cli;
/// Invalid input over gRPC: refused with a code, a field and a fix, without effect on the server.
mod bad_input_grpc;
/// Cancelled jobs and stopped servers: how soon the work ends.
mod cancelling;
/// Everyday use of the command line: beginnings of ids, folders, pipes, forms of output, broken-off waits.
mod command_line_use;
/// Servers that are killed at random moments, or suspended until their leases have ended.
mod crash;
/// Many small jobs from two clients at once.
mod crowd;
/// Equal requests give equal bytes.
mod determinism;
/// A low disk and a full disk.
mod disk;
/// What `lightpath doctor` finds.
mod doctor;
/// Estimates of memory against the measured memory, for jobs of all kinds.
mod estimates;
/// Twenty devices and their agents: promotions, staged rollouts and rollbacks through the command line.
mod fleet;
/// Slow connections, and connections with invalid bytes.
mod hostile;
/// The import rules of crates and modules.
mod import_circles;
mod imports;
/// Jobs: cancelling, retrying, watching, priorities.
mod jobs;
/// `lightpath kernel watch` and `kernel fetch --dry-run`.
mod kernel_watch;
/// A large kernel in every form, until agents use it.
mod large_kernels;
/// `lightpath kernel mirror`, and an agent that uses what it writes.
mod mirror;
/// A server that moves to PostgreSQL and a bucket.
mod moving;
/// Photographs and how well they show a target.
mod photos;
/// Several planes, wavelengths and subframes, every method, through the command line.
mod planes_and_colours;
/// Servers whose database is on a PostgreSQL server.
mod postgresql;
/// Several servers and workers on one database and one bucket, and faults of every kind.
mod processes;
/// Datasets in the folders of published ones.
mod published_datasets;
/// All kinds of calls for a long time.
mod soak;
/// Clients that never finish their messages or never read their answers.
mod stalled_streams;
/// Large, interrupted and damaged uploads.
mod uploads;
/// Webhooks: killed servers, failing receivers, and addresses that are not allowed.
mod webhooks;
/// The main use of the command line, from the display to the learned kernel.
mod whole_loop;
