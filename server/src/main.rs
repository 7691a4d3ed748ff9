//! Lightpath.
fn main() {}
