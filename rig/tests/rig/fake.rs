//! A bench whose photographs are the levels themselves, and which hangs or panics when it is told to.

use lightpath_rig::device::{
    Camera, CameraFacts, DeviceError, Devices, Frame, Justified, Levels, Result, Shutter, Slm, SlmFacts,
};
use std::sync::{Arc, Condvar, Mutex};
use std::time::{Duration, Instant};

pub const WIDTH_PX: u32 = 32;
pub const HEIGHT_PX: u32 = 16;

/// The bench; clones are the same one.
#[derive(Clone, Default)]
pub struct Fake {
    inside: Arc<Mutex<Inside>>,
    changed: Arc<Condvar>,
}

#[derive(Default)]
pub struct Inside {
    /// All that was shown, in order.
    pub shown: Vec<Levels>,
    pub is_open: bool,
    /// Frames so far.
    pub frames: u64,
    /// Number of times that the devices were opened.
    pub opened: u32,
    /// Whether a frame waits until it is released.
    pub is_held: bool,
    /// Whether a frame waits now.
    pub is_exposing: bool,
    pub panics_next: bool,
    /// The exposure that the camera chooses, whatever it is told \[s\].
    pub chooses_s: Option<f64>,
}

struct Device(Fake);

impl Fake {
    pub fn devices(&self) -> Devices {
        self.change(|inside| inside.opened += 1);
        Devices {
            slm: Box::new(Device(self.clone())),
            camera: Box::new(Device(self.clone())),
            shutter: Some(Box::new(Device(self.clone()))),
            light: None,
        }
    }

    pub fn change<T>(&self, change: impl FnOnce(&mut Inside) -> T) -> T {
        let changed = change(&mut self.inside.lock().unwrap());
        self.changed.notify_all();
        changed
    }

    /// Waits until something is so.
    pub async fn until(&self, what: &str, is_so: impl Fn(&Inside) -> bool + Send + 'static) {
        let (fake, what) = (self.clone(), what.to_owned());
        let wait = move || {
            let inside = fake.inside.lock().unwrap();
            let limit = Duration::from_secs(20);
            let waited = fake.changed.wait_timeout_while(inside, limit, |inside| !is_so(inside));
            assert!(!waited.unwrap().1.timed_out(), "{what}");
        };
        tokio::task::spawn_blocking(wait).await.unwrap();
    }

    /// Whether the shutter is closed and the safe pattern, level 0, is shown.
    pub fn is_safe(inside: &Inside) -> bool {
        !inside.is_open && inside.shown.last().is_some_and(|levels| levels.values().iter().all(|&level| level == 0))
    }
}

impl Slm for Device {
    fn facts(&self) -> SlmFacts {
        SlmFacts {
            width_px: WIDTH_PX,
            height_px: HEIGHT_PX,
            bit_depth: 8,
            settling: Duration::from_millis(1),
            reads_back: true,
            limit: Duration::from_secs(5),
        }
    }

    fn show(&mut self, levels: &Levels, _: Instant) -> Result<()> {
        self.0.change(|inside| inside.shown.push(levels.clone()));
        Ok(())
    }

    fn read_back(&mut self, _: Instant) -> Result<Levels> {
        self.0.change(|inside| inside.shown.last().cloned()).ok_or_else(|| DeviceError::new("nothing is shown"))
    }
}

impl Camera for Device {
    fn facts(&self) -> CameraFacts {
        CameraFacts {
            width_px: WIDTH_PX,
            height_px: HEIGHT_PX,
            bit_depth: 8,
            justified: Justified::Right,
            exposure_min_s: 1e-3,
            exposure_max_s: 0.5,
            exposure_delay_frames: 0,
            held_frames: 0,
            limit: Duration::from_millis(1500),
        }
    }

    fn set_exposure(&mut self, exposure_s: f64, _: Instant) -> Result<f64> {
        Ok(self.0.change(|inside| inside.chooses_s).unwrap_or(exposure_s))
    }

    fn frame(&mut self, _: Instant) -> Result<Frame> {
        if self.0.change(|inside| std::mem::take(&mut inside.panics_next)) {
            panic!("the driver fell over, as the test wants");
        }
        let begun = Instant::now();
        self.0.change(|inside| inside.is_exposing = true);
        let inside = self.0.inside.lock().unwrap();
        drop(self.0.changed.wait_while(inside, |inside| inside.is_held).unwrap());
        self.0.change(|inside| {
            inside.is_exposing = false;
            inside.frames += 1;
            let light = inside.shown.last().filter(|_| inside.is_open);
            let dark = || vec![0; (WIDTH_PX * HEIGHT_PX) as usize];
            let values = light.map_or_else(dark, |levels| levels.values().to_vec());
            Ok(Frame { number: Some(inside.frames), begun: Some(begun), exposure_s: None, values })
        })
    }
}

impl Shutter for Device {
    fn open(&mut self, _: Instant) -> Result<()> {
        self.0.change(|inside| inside.is_open = true);
        Ok(())
    }

    fn close(&mut self, _: Instant) -> Result<()> {
        self.0.change(|inside| inside.is_open = false);
        Ok(())
    }
}
