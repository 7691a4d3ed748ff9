//! The memory of the agent does not depend on the size of the kernel.

use crate::bench::Bench;
use crate::material::{digest, kernel};
use crate::polling::running;
use std::fs;

/// Size of the kernel of a display of 1920×1080 pixels as complex numbers, with padding \[bytes\].
const LARGE_BYTES: usize = 66 << 20;
/// Largest memory that a large kernel may take beyond that of a small one \[KiB\].
const MORE_KIB_MAX: u64 = 4 << 10;

/// Largest resident memory of an agent that fetches a kernel of this size \[KiB\].
fn peak_kib(size_bytes: usize) -> u64 {
    let bench = Bench::new();
    let bytes = kernel(2, size_bytes);
    bench.server.offer(2, 8, &bytes);
    let running = running(&bench);
    bench.server.wait_for(|requests| requests.iter().any(|request| request.body.contains("\"version\":2")));
    let status = fs::read_to_string(format!("/proc/{}/status", running.0.id())).unwrap();
    drop(running);
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    assert_eq!(crate::bench::in_use(&bench.directory()), Some(digest(&bytes)));
    line.trim().strip_suffix(" kB").unwrap().parse().unwrap()
}

#[test]
fn memory_does_not_grow_with_the_kernel() {
    let (small, large) = (peak_kib(1000), peak_kib(LARGE_BYTES));
    eprintln!("largest memory: {small} KiB with a kernel of 1000 bytes, {large} KiB with one of {LARGE_BYTES} bytes");
    assert!(large <= small + MORE_KIB_MAX, "{small} KiB, {large} KiB");
}
