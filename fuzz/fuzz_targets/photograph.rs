#![no_main]

use lightpath_server::fuzzing::Decoder;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = Decoder::Photograph.accepts(bytes);
});
