//! The queue of jobs as a whole: its waiting jobs and its pauses.

mod service_methods;
mod to_wire;
