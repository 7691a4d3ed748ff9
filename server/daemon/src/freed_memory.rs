//! Gives large blocks of freed memory back to the system.
//!
//! The GNU C library raises the size from which a block has pages of its own (`M_MMAP_THRESHOLD` of mallopt(3))
//! whenever such a block is freed. Later blocks come from one of many heaps, each of which keeps what is freed in its
//! middle. A server then holds several times the memory that it counts. A threshold in the environment is fixed, but
//! the library reads it only at the start of a program.

#[cfg(all(target_os = "linux", target_env = "gnu"))]
use std::os::unix::process::CommandExt as _;

/// The threshold, as the library names it.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const THRESHOLD: &str = "MALLOC_MMAP_THRESHOLD_";
/// Blocks from this size on have pages of their own \[bytes\]. Pictures, kernels and the fields of the engine are
/// larger, messages and rows of the database are smaller.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const BLOCK_BYTES: &str = "1048576";

/// Replaces this process by the same program with a fixed threshold, unless it has one. Other systems need none.
pub(crate) fn give_back() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    if std::env::var_os(THRESHOLD).is_none()
        && let Ok(program) = std::env::current_exe()
    {
        let mut arguments = std::env::args_os();
        let name = arguments.next().unwrap_or_else(|| program.clone().into_os_string());
        let error = std::process::Command::new(&program).arg0(name).args(arguments).env(THRESHOLD, BLOCK_BYTES).exec();
        tracing::warn!(%error, program = %program.display(), "the program could not be restarted; it may keep freed memory");
    }
}
