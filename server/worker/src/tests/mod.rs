//! `machinery`: all the ways in which a job can end, with toy tasks. `whole_loop`: the real tasks, on a small display.
//! `bench`: what both run on.
mod bench;
mod machinery;
mod whole_loop;
