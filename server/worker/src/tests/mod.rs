//! `machinery`: all ways in which a job can end, with simple tasks. `whole_loop`: the real tasks, on a small display.
//! `suggestion`: holograms to photograph next. `bench`: the test bench of all.

mod bench;
mod machinery;
mod suggestion;
mod whole_loop;
