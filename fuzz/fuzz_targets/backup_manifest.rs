#![no_main]

mod account;

use lightpath_server::fuzzing::Decoder;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| account::decode(Decoder::BackupManifest, bytes));
