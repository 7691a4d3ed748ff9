//! Lightpath.
