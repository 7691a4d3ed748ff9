//! Memory for large fields.

use bytemuck::Zeroable;

/// Values that are all zero. The operating system gives zeroed pages when they are first used, by the threads that use
/// them. So this takes no time, unlike `vec![zero; len]` of complex numbers, which writes every page on one thread and
/// cannot be [interrupted](crate::interrupt) for seconds on large displays.
pub(crate) fn zeros<T: Zeroable>(len: usize) -> Vec<T> {
    bytemuck::zeroed_vec(len)
}
