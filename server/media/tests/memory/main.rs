//! Reading a file allocates no more memory than is counted for it, whatever is in the file, and neither does the conversion
//! of a kernel to another form.
//!
//! This test is a program of its own, because it counts the allocations of the whole process. What it compares them with
//! is what servers count: [`importing_bytes`] of a kernel, [`reading_bytes`] of a picture, and
//! [`exporting_bytes`](lightpath_media::kernel_formats::exporting_bytes) of a conversion. All include the file itself,
//! which is in memory before the count starts.
#![allow(clippy::unwrap_used)]

/// Valid files, and files that are damaged in many ways.
mod damaged;
/// Conversions of kernels to other forms.
mod exports;
/// Kernel files that were made to take much.
mod hostile_kernels;
/// Picture files that were made to take much.
mod hostile_pictures;

use lightpath_domain::dataset::Encoding;
use lightpath_domain::job::Fit;
use lightpath_media::budget::Budget;
use lightpath_media::figures::{View, view};
use lightpath_media::kernel_file;
use lightpath_media::kernel_formats::{import, importing_bytes};
use lightpath_media::photo_scores::EncodedPicture;
use lightpath_media::pictures::{self, PhotoReading, Placement, reading_bytes};
use lightpath_optics::{Grid, OpticalSetup};
use std::sync::{Mutex, MutexGuard, PoisonError};

#[global_allocator]
static ALLOCATOR: dhat::Alloc = dhat::Alloc;

/// Allocations that are not counted \[bytes\]: of error texts and small tables.
const UNCOUNTED_BYTES: u64 = 64 << 10;
/// Longest message of an error \[bytes\].
const MESSAGE_BYTES_MAX: usize = 2000;
/// Rows and columns of the display in all tests \[px\].
const DISPLAY_PX: [usize; 2] = [48, 64];

/// Lets one test at a time run: the allocations of all threads are counted.
fn alone() -> MutexGuard<'static, ()> {
    static RUNNING: Mutex<()> = Mutex::new(());
    RUNNING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs `read`, which may allocate `counted_bytes`. Its result is a message, empty if the file was read.
fn require_counted(name: &str, counted_bytes: u64, read: impl FnOnce() -> String) -> String {
    let profiler = dhat::Profiler::builder().testing().build();
    let message = read();
    let allocated_bytes = dhat::HeapStats::get().max_bytes as u64;
    drop(profiler);
    assert!(
        allocated_bytes <= counted_bytes + UNCOUNTED_BYTES,
        "{name}: allocated {allocated_bytes} of {counted_bytes} bytes; {message}"
    );
    assert!(message.len() <= MESSAGE_BYTES_MAX, "{name}: a message of {} bytes", message.len());
    message
}

fn message<T, E: std::fmt::Display>(read: Result<T, E>) -> String {
    read.err().map_or_else(String::new, |error| error.to_string())
}

fn setup() -> OpticalSetup {
    let [height_px, width_px] = DISPLAY_PX;
    OpticalSetup::try_new(Grid::try_new(height_px, width_px, 8e-6).unwrap(), 515e-9, 0.05).unwrap()
}

/// Imports a kernel within what a server counts for it, but at most `budget_bytes`.
fn import_within(name: &str, file: &[u8], budget_bytes: u64) -> String {
    let counted_bytes = require_header(name, file, || importing_bytes(file)).min(budget_bytes);
    let allowed_bytes = counted_bytes.saturating_sub(file.len() as u64);
    let stored_bytes = kernel_file::decoding_bytes(file.len() as u64) - file.len() as u64;
    require_counted(name, stored_bytes, || message(kernel_file::decode(file)));
    require_counted(name, allowed_bytes, || message(import(file, &setup(), &Budget::new(counted_bytes))))
}

/// Reads a picture as everything that a picture can be. Returns the messages of target and photograph.
fn read_within(name: &str, file: &[u8], [height_px, width_px]: [usize; 2]) -> [String; 2] {
    let fitted_px = (height_px * width_px) as u64;
    let own_bytes = require_header(name, file, || reading_bytes(file, 0)) - file.len() as u64;
    let fitted_bytes = reading_bytes(file, fitted_px) - file.len() as u64;
    let target = [Fit::Contain, Fit::Cover, Fit::Stretch].map(|fit| {
        let read =
            || message(pictures::target_intensity(file, Encoding::Srgb, &Placement::whole(fit, height_px, width_px)));
        require_counted(&format!("{name}, {fit:?}"), fitted_bytes, read)
    });
    let reading = PhotoReading { encoding: Encoding::Linear, bit_depth: 0, black_level: 0.1 };
    let photo = require_counted(name, own_bytes, || message(pictures::photo(file, &reading)));
    require_counted(name, fitted_bytes, || message(pictures::levels(file, 8, height_px, width_px)));
    require_counted(name, fitted_bytes, || message(pictures::phase_npy(file, height_px, width_px)));
    // Two more planes of colours, which those who read them count.
    let colours_bytes = own_bytes + 8 * pictures::pixels(file);
    require_counted(name, colours_bytes, || message(EncodedPicture::read(file, Encoding::Srgb)));
    // What a view takes besides is counted with it.
    let view_bytes = colours_bytes + 10 * pictures::pixels(file);
    require_counted(&format!("{name}, view"), view_bytes, || message(view(file, None, &View::default())));
    let [target, ..] = target;
    [target, photo]
}

/// Reads a header, for which a server counts the file twice and 16 MiB (4 MiB for a kernel).
fn require_header(name: &str, file: &[u8], read: impl FnOnce() -> u64) -> u64 {
    let is_tiff = file.starts_with(b"II") || file.starts_with(b"MM");
    let header_bytes = file.len() as u64 + if is_tiff { 16 << 20 } else { 4 << 20 };
    let mut counted_bytes = 0;
    require_counted(&format!("{name}, header"), header_bytes, || {
        counted_bytes = read();
        String::new()
    });
    counted_bytes
}
