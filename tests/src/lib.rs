//! End-to-end tests of Lightpath. This library is empty; the tests are in `main.rs`.
