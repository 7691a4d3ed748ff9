//! The devices of a bench on their threads, and the safe state.
//!
//! Whoever photographs holds a [`Permit`]. [`Bench::make_safe`] takes all permits back before it closes the shutter, and
//! each device does its calls in their order: so nothing that was begun earlier opens the shutter again afterwards.

use crate::device::thread::{OnThread, Sent};
use crate::device::{Camera, CameraFacts, DeviceError, Devices, Levels, Light, Result, Shutter, Slm, SlmFacts};
use std::fmt;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Time for a shutter to open or close.
const SHUTTER_LIMIT: Duration = Duration::from_secs(5);
/// Time for a laser to change its wavelength.
const LIGHT_LIMIT: Duration = Duration::from_secs(30);

/// Opens the devices. It is called again after the code of one has panicked.
pub type Open = Box<dyn Fn() -> Result<Devices> + Send + Sync>;

/// The devices of a bench. All calls block.
pub struct Bench {
    open: Open,
    slm: SlmFacts,
    camera: CameraFacts,
    has_shutter: bool,
    safe_pattern: Levels,
    threads: Mutex<Arc<Threads>>,
    /// The permits that count.
    epoch: Mutex<u64>,
    moved: Condvar,
}

struct Threads {
    slm: OnThread<dyn Slm>,
    camera: OnThread<dyn Camera>,
    shutter: Option<OnThread<dyn Shutter>>,
    light: Option<OnThread<dyn Light>>,
}

/// The right to use the devices, until the next safe state.
#[derive(Clone, Copy, Debug)]
pub struct Permit(u64);

/// Why a use of the devices came to nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Halt {
    /// The bench was made safe meanwhile.
    Stopped,
    /// A device failed.
    Device(DeviceError),
}

impl From<DeviceError> for Halt {
    fn from(error: DeviceError) -> Self {
        Self::Device(error)
    }
}

impl Bench {
    /// Opens the devices. `safe_pattern` makes the pattern of the safe state.
    ///
    /// # Errors
    ///
    /// A device cannot be opened, or the pattern does not fit the SLM.
    pub fn open(open: Open, safe_pattern: impl FnOnce(&SlmFacts) -> Result<Levels>) -> Result<Self> {
        let devices = open()?;
        let (slm, camera, has_shutter) = (devices.slm.facts(), devices.camera.facts(), devices.shutter.is_some());
        let safe_pattern = safe_pattern(&slm)?;
        let threads = Mutex::new(Arc::new(Threads::start(devices)?));
        let (epoch, moved) = (Mutex::new(0), Condvar::new());
        Ok(Self { open, slm, camera, has_shutter, safe_pattern, threads, epoch, moved })
    }

    /// What the SLM is.
    #[must_use]
    pub fn slm(&self) -> &SlmFacts {
        &self.slm
    }

    /// What the camera is.
    #[must_use]
    pub fn camera(&self) -> &CameraFacts {
        &self.camera
    }

    /// Whether the light can be kept from the bench.
    #[must_use]
    pub fn has_shutter(&self) -> bool {
        self.has_shutter
    }

    /// The right to use the devices from now on.
    #[must_use]
    pub fn permit(&self) -> Permit {
        Permit(*lock(&self.epoch))
    }

    /// Closes the shutter and shows the safe pattern, whatever is being done, and opens devices anew whose code panicked.
    ///
    /// # Errors
    ///
    /// The bench is not known to be safe: a device failed. The other has been told all the same.
    pub fn make_safe(&self) -> Result<()> {
        // Light goes off before anything is opened anew, which can take long.
        let told = self.tell_safe();
        if self.renew()? { self.tell_safe() } else { told }
    }

    fn tell_safe(&self) -> Result<()> {
        let (shutter, slm) = {
            let mut epoch = lock(&self.epoch);
            *epoch += 1;
            self.moved.notify_all();
            let threads = self.threads();
            let close = |shutter: &OnThread<dyn Shutter>| shutter.send("close", SHUTTER_LIMIT, |s, by| s.close(by));
            let pattern = self.safe_pattern.clone();
            let show = threads.slm.send("show the safe pattern", self.slm.limit, move |slm, by| slm.show(&pattern, by));
            (threads.shutter.as_ref().map(close), show)
        };
        let closed = shutter.map_or(Ok(()), Sent::wait);
        let shown = slm.wait();
        closed.and(shown)
    }

    /// Opens all devices anew if the code of one has panicked: nobody knows in which state it was left. True if so.
    fn renew(&self) -> Result<bool> {
        let mut threads = lock(&self.threads);
        if !threads.have_panicked() {
            return Ok(false);
        }
        let devices = (self.open)()?;
        if devices.slm.facts() != self.slm || devices.camera.facts() != self.camera {
            return Err(DeviceError::new("the devices are others than before; start the rig anew"));
        }
        *threads = Arc::new(Threads::start(devices)?);
        Ok(true)
    }

    /// Waits until a time, or until the permit counts no more.
    ///
    /// # Errors
    ///
    /// [`Halt::Stopped`].
    pub fn wait_until(&self, permit: Permit, time: Instant) -> std::result::Result<(), Halt> {
        let mut epoch = lock(&self.epoch);
        loop {
            if *epoch != permit.0 {
                return Err(Halt::Stopped);
            }
            let left = time.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(());
            }
            epoch = self.moved.wait_timeout(epoch, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Uses the SLM. `what` says for what.
    ///
    /// # Errors
    ///
    /// [`Halt`].
    pub fn with_slm<T: Send + 'static>(
        &self,
        permit: Permit,
        what: &'static str,
        call: impl FnOnce(&mut dyn Slm, Instant) -> Result<T> + Send + 'static,
    ) -> std::result::Result<T, Halt> {
        self.done(permit, |threads| Ok(threads.slm.send(what, self.slm.limit, |slm, by| call(slm, by))))
    }

    /// Uses the camera, which may take `beyond` more than its own limit.
    ///
    /// # Errors
    ///
    /// [`Halt`].
    pub fn with_camera<T: Send + 'static>(
        &self,
        permit: Permit,
        what: &'static str,
        beyond: Duration,
        call: impl FnOnce(&mut dyn Camera, Instant) -> Result<T> + Send + 'static,
    ) -> std::result::Result<T, Halt> {
        let limit = self.camera.limit + beyond;
        self.done(permit, |threads| Ok(threads.camera.send(what, limit, |camera, by| call(camera, by))))
    }

    /// Opens the shutter, if there is one.
    ///
    /// # Errors
    ///
    /// [`Halt`].
    pub fn open_shutter(&self, permit: Permit) -> std::result::Result<(), Halt> {
        if !self.has_shutter {
            return Ok(());
        }
        self.done(permit, |threads| Ok(threads.shutter()?.send("open", SHUTTER_LIMIT, |shutter, by| shutter.open(by))))
    }

    /// Closes the shutter, if there is one, whether the permit still counts or not.
    ///
    /// # Errors
    ///
    /// That of the shutter.
    pub fn close_shutter(&self) -> Result<()> {
        let threads = self.threads();
        let close = |shutter: &OnThread<dyn Shutter>| shutter.send("close", SHUTTER_LIMIT, |s, by| s.close(by));
        threads.shutter.as_ref().map_or(Ok(()), |shutter| close(shutter).wait())
    }

    /// Lights the SLM with a wavelength \[m\], if there are several.
    ///
    /// # Errors
    ///
    /// [`Halt`].
    pub fn choose_light(&self, permit: Permit, wavelength_m: f64) -> std::result::Result<(), Halt> {
        if self.threads().light.is_none() {
            return Ok(());
        }
        self.done(permit, |threads| {
            let light = threads.light()?;
            Ok(light.send("choose the wavelength", LIGHT_LIMIT, move |light, by| light.choose(wavelength_m, by)))
        })
    }

    /// Sends a call if the permit counts, and waits for its answer.
    fn done<T>(&self, permit: Permit, send: impl FnOnce(&Threads) -> Result<Sent<T>>) -> std::result::Result<T, Halt> {
        let sent = {
            // While the lock is held, nothing makes the bench safe: what is sent here comes before that, or not at all.
            let epoch = lock(&self.epoch);
            if *epoch != permit.0 {
                return Err(Halt::Stopped);
            }
            send(&self.threads())?
        };
        let counts = || *lock(&self.epoch) == permit.0;
        match sent.wait_while(counts) {
            Some(answer) if counts() => Ok(answer?),
            _ => Err(Halt::Stopped),
        }
    }

    fn threads(&self) -> Arc<Threads> {
        Arc::clone(&lock(&self.threads))
    }
}

impl Threads {
    fn start(devices: Devices) -> Result<Self> {
        Ok(Self {
            slm: OnThread::start("SLM", devices.slm)?,
            camera: OnThread::start("camera", devices.camera)?,
            shutter: devices.shutter.map(|shutter| OnThread::start("shutter", shutter)).transpose()?,
            light: devices.light.map(|light| OnThread::start("light", light)).transpose()?,
        })
    }

    fn have_panicked(&self) -> bool {
        self.slm.has_panicked()
            || self.camera.has_panicked()
            || self.shutter.as_ref().is_some_and(OnThread::has_panicked)
            || self.light.as_ref().is_some_and(OnThread::has_panicked)
    }

    fn shutter(&self) -> Result<&OnThread<dyn Shutter>> {
        self.shutter.as_ref().ok_or_else(|| DeviceError::new("the bench has no shutter"))
    }

    fn light(&self) -> Result<&OnThread<dyn Light>> {
        self.light.as_ref().ok_or_else(|| DeviceError::new("the bench has no choice of wavelengths"))
    }
}

impl fmt::Debug for Bench {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Bench").field("slm", &self.slm).field("camera", &self.camera).finish_non_exhaustive()
    }
}

/// What a lock protects is replaced as a whole, so it is whole after a panic, too.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
