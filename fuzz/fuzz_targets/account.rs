//! Runs a decoder with no more memory than the server counts for it.

use cap::Cap;
use lightpath_server::fuzzing::Decoder;
use std::alloc::System;

#[global_allocator]
static ALLOCATOR: Cap<System> = Cap::new(System, usize::MAX);

/// Allocations that are not counted [bytes]: of error texts and small tables.
const UNCOUNTED_BYTES: usize = 64 << 10;

/// Decodes `bytes`. An allocation beyond the account fails, which ends the fuzzer with this input.
pub fn decode(decoder: Decoder, bytes: &[u8]) {
    let limit = decoder.counted_bytes(bytes).and_then(|counted| usize::try_from(counted).ok()).map_or(usize::MAX, |counted| {
        ALLOCATOR.allocated().saturating_add(counted).saturating_add(UNCOUNTED_BYTES)
    });
    ALLOCATOR.set_limit(limit).expect("less is allocated");
    let _ = decoder.accepts(bytes);
    ALLOCATOR.set_limit(usize::MAX).expect("there is no limit");
}
