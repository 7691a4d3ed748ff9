//! Named places around every flush, rename, removal and commit, at which this crate's own tests make the process die or
//! the call fail. In every other build [`point`] is empty, and nothing is left of it.

#[cfg(test)]
mod armed;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod workload;

#[cfg(test)]
pub(crate) use armed::point;

/// What happens next matters for what is on disk.
///
/// # Errors
///
/// Never, outside of tests.
#[cfg(not(test))]
#[inline(always)]
pub(crate) fn point(_name: &'static str) -> std::io::Result<()> {
    Ok(())
}
