//! `machinery`: all ways in which a job can end, with simple tasks. `whole_loop`: the real tasks, on a small display.
//! `bench`: the test bench of both.

mod bench;
mod machinery;
mod whole_loop;
