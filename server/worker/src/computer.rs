//! What computes: the version of the program, and the kind of processor.
//!
//! Two of the same kind compute the same bytes from the same state. Transforms and functions such as the sine have a
//! variant for each set of instructions, which round differently.

use std::env::consts::ARCH;
use std::sync::LazyLock;

/// Version of the program and kind of processor, such as `lightpath 0.1.0, x86_64 with AVX, FMA`.
pub(super) fn computer() -> &'static str {
    static COMPUTER: LazyLock<String> = LazyLock::new(|| {
        let instructions = instructions();
        let with = if instructions.is_empty() { String::new() } else { format!(" with {}", instructions.join(", ")) };
        format!("lightpath {}, {ARCH}{with}", env!("CARGO_PKG_VERSION"))
    });
    &COMPUTER
}

/// The instructions by which variants are chosen.
#[cfg(target_arch = "x86_64")]
fn instructions() -> Vec<&'static str> {
    let has = [
        ("AVX512F", std::is_x86_feature_detected!("avx512f")),
        ("AVX2", std::is_x86_feature_detected!("avx2")),
        ("AVX", std::is_x86_feature_detected!("avx")),
        ("FMA", std::is_x86_feature_detected!("fma")),
        ("SSE4.1", std::is_x86_feature_detected!("sse4.1")),
    ];
    has.into_iter().filter(|(_, has)| *has).map(|(name, _)| name).collect()
}

/// All processors of other kinds have the same instructions.
#[cfg(not(target_arch = "x86_64"))]
fn instructions() -> Vec<&'static str> {
    Vec::new()
}
