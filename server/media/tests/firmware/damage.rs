//! Damaged kernels. The decoder in C and Lightpath's own must agree about each of them.

use crate::compiler::{Program, run};
use crate::kernels;
use crate::refusals::renew_checksum;
use lightpath_media::kernel_formats::compact;
use std::fs;
use std::path::Path;

/// Number of damaged kernels.
const KERNELS: usize = 10_000;
/// Numbers that lie at the ends of allowed ranges or beyond.
const WORDS: [u32; 12] = [
    0,
    1,
    16_384,
    16_385,
    u32::MAX,
    0x7f80_0000, // infinity
    0x7fc0_0000, // no number
    0x8000_0000, // −0
    0x3f19_999a, // 0.6
    0x3f19_999b, // the next number
    0xbf80_0000, // −1
    0x0000_0001, // the smallest number
];

/// Numbers that look random, the same in every run.
struct Numbers(u64);

impl Numbers {
    /// A number below `end`.
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % end
    }

    fn byte(&mut self) -> u8 {
        self.below(256) as u8
    }
}

fn damage(numbers: &mut Numbers, file: &mut Vec<u8>) {
    let at = numbers.below(file.len());
    match numbers.below(6) {
        0 => file[at] = numbers.byte(),
        1 => file[at] ^= 1 << numbers.below(8),
        // The header's small numbers.
        2 => file[4 + at % 8] = numbers.byte() % 16,
        // A whole number or a number of 32 bits.
        3 => {
            let (place, word) = (at / 4 * 4, WORDS[numbers.below(WORDS.len())]);
            let end = (place + 4).min(file.len());
            file[place..end].copy_from_slice(&word.to_le_bytes()[..end - place]);
        }
        // A length of the optics, between a tenth of it and ten times it.
        4 => {
            let place = [20, 28, 36][at % 3];
            let Some(chunk) = file.get_mut(place..).and_then(|rest| rest.first_chunk_mut::<8>()) else { return };
            let factor = 10.0_f64.powf(numbers.below(2001) as f64 / 1000.0 - 1.0);
            *chunk = (f64::from_le_bytes(*chunk) * factor).to_le_bytes();
        }
        _ => file.resize((file.len() + numbers.below(9)).saturating_sub(4).max(1), 0),
    }
}

/// Gives the file the length that its header says, so that most damage reaches the later checks.
fn fit_length(file: &mut Vec<u8>) {
    let Some(&[version, _, kernel, source, harmonics, _, variation, uneven]) =
        file.get(4..).and_then(|rest| rest.first_chunk::<8>())
    else {
        return;
    };
    let terms = |order: u8| (usize::from(order) + 1) * (usize::from(order) + 2) / 2 - 1;
    let is_uneven = usize::from(version == 3);
    let uneven = uneven.checked_sub(1).map_or(0, |order| 1 + terms(order));
    let pairs = terms(kernel) + terms(source) + usize::from(harmonics) + 5 * terms(variation);
    file.resize(60 + 4 * (2 * pairs + 2 * is_uneven + uneven) + 4, 0);
}

fn damaged_kernels() -> Vec<Vec<u8>> {
    let files: Vec<_> = kernels::all().iter().map(|case| compact::encode(&case.model, case.kind).unwrap()).collect();
    let mut numbers = Numbers(0x6c69_6768_7470_6174);
    let mut damaged = || {
        let mut file = files[numbers.below(files.len())].clone();
        for _ in 0..=numbers.below(3) {
            damage(&mut numbers, &mut file);
        }
        if numbers.below(4) > 0 {
            fit_length(&mut file);
        }
        if numbers.below(16) > 0 {
            renew_checksum(&mut file);
        }
        file
    };
    (0..KERNELS).map(|_| damaged()).collect()
}

/// Gives both decoders the same damaged kernels.
pub(crate) fn compare_verdicts(vectors: &Path) {
    let kernels = damaged_kernels();
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("damaged_kernels");
    let packed: Vec<u8> =
        kernels.iter().flat_map(|file| [&(file.len() as u32).to_le_bytes()[..], file].concat()).collect();
    fs::write(&path, packed).unwrap();
    let printed = run(Program::Verdicts, &[path.as_os_str()]);
    fs::remove_file(path).unwrap();
    let verdicts: Vec<&str> = printed.lines().collect();
    assert_eq!(verdicts.len(), KERNELS);
    let mut accepted = 0;
    for (file, verdict) in kernels.iter().zip(verdicts) {
        let own = compact::decode(file);
        assert_eq!(own.is_ok(), verdict == "0", "{verdict}, {own:?}, {file:02x?}; vectors: {}", vectors.display());
        accepted += usize::from(own.is_ok());
    }
    assert!((KERNELS / 10..KERNELS * 9 / 10).contains(&accepted), "{accepted} of {KERNELS} were accepted");
}
