//! The queue of jobs as a whole: who waits, and pausing it.

mod service_methods;
mod to_wire;
