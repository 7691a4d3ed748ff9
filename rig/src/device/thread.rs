//! A device on a thread of its own, so that one that hangs or panics does not take the program with it.

use super::{DeviceError, Result};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::{Duration, Instant};

/// Time beyond its deadline after which a call counts as hanging. Drivers that keep their deadlines need some of it to say so.
const GRACE: Duration = Duration::from_millis(300);

/// Time between two looks at whether a wait still makes sense.
const LOOK: Duration = Duration::from_millis(50);

type Call<D> = Box<dyn FnOnce(&mut D) + Send>;

/// A device that only its thread touches. Calls are done in the order in which they were sent.
#[derive(Debug)]
pub struct OnThread<D: ?Sized> {
    name: &'static str,
    calls: mpsc::Sender<Call<Box<D>>>,
    has_panicked: Arc<AtomicBool>,
}

/// A call that was sent to the device.
#[must_use]
#[derive(Debug)]
pub struct Sent<T> {
    name: &'static str,
    what: &'static str,
    limit: Duration,
    answer: mpsc::Receiver<Result<T>>,
}

impl<D: ?Sized + Send + 'static> OnThread<D> {
    /// Gives a device to a thread.
    ///
    /// # Errors
    ///
    /// The system has no thread.
    pub fn start(name: &'static str, mut device: Box<D>) -> Result<Self> {
        let (calls, received) = mpsc::channel::<Call<Box<D>>>();
        let has_panicked = Arc::new(AtomicBool::new(false));
        let panicked = Arc::clone(&has_panicked);
        let work = move || {
            for call in received {
                call(&mut device);
                // Nobody knows in which state the device is after a panic.
                if panicked.load(Ordering::Acquire) {
                    return;
                }
            }
        };
        let started = thread::Builder::new().name(format!("rig {name}")).spawn(work);
        started.map_err(|error| DeviceError(format!("no thread for the {name}: {error}")))?;
        Ok(Self { name, calls, has_panicked })
    }

    /// Sends a call, which is told when to give up. `what` says what it does, such as `show a pattern`.
    pub fn send<T: Send + 'static>(
        &self,
        what: &'static str,
        limit: Duration,
        call: impl FnOnce(&mut D, Instant) -> Result<T> + Send + 'static,
    ) -> Sent<T> {
        let (sender, answer) = mpsc::sync_channel(1);
        let deadline = Instant::now() + limit;
        let panicked = Arc::clone(&self.has_panicked);
        let work: Call<Box<D>> = Box::new(move |device| {
            match catch_unwind(AssertUnwindSafe(|| call(&mut **device, deadline))) {
                // Nobody waits any more if the answer comes too late.
                Ok(answer) => drop(sender.send(answer)),
                // The mark is set before the sender is dropped, so that who waits finds it.
                Err(_) => panicked.store(true, Ordering::Release),
            }
        });
        // If the thread has ended, the answer's sender is dropped, and `wait` says so.
        let _ = self.calls.send(work);
        Sent { name: self.name, what, limit, answer }
    }

    /// Whether the thread has ended by a panic: the device must be opened anew.
    #[must_use]
    pub fn has_panicked(&self) -> bool {
        self.has_panicked.load(Ordering::Acquire)
    }
}

impl<T> Sent<T> {
    /// Waits for the answer.
    ///
    /// # Errors
    ///
    /// That of the device; or the device hangs, or its code panicked.
    pub fn wait(self) -> Result<T> {
        let limit = self.limit;
        self.wait_while(|| true).unwrap_or_else(|| Err(DeviceError(format!("no answer within {limit:?}"))))
    }

    /// Waits for the answer for as long as `goes_on` says so; `None`: it said no. The device goes on all the same.
    pub fn wait_while(self, goes_on: impl Fn() -> bool) -> Option<Result<T>> {
        let (name, what, end) = (self.name, self.what, Instant::now() + self.limit + GRACE);
        loop {
            match self.answer.recv_timeout(LOOK.min(end.saturating_duration_since(Instant::now()))) {
                Ok(answer) => {
                    return Some(answer.map_err(|error| DeviceError(format!("the {name} could not {what}: {error}"))));
                }
                Err(mpsc::RecvTimeoutError::Disconnected) => {
                    let text = format!("the adapter of the {name} panicked when it was told to {what}");
                    return Some(Err(DeviceError(text)));
                }
                Err(mpsc::RecvTimeoutError::Timeout) if !goes_on() => return None,
                Err(mpsc::RecvTimeoutError::Timeout) if Instant::now() >= end => {
                    let limit_s = self.limit.as_secs_f64();
                    return Some(Err(DeviceError(format!(
                        "the {name} hangs: it was told to {what} and did not answer within {limit_s:.1} s; see whether it \
                         has power and its cable"
                    ))));
                }
                Err(mpsc::RecvTimeoutError::Timeout) => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_that_hangs_or_panics_is_named_and_the_program_goes_on() {
        let device = OnThread::<Vec<u8>>::start("camera", Box::new(vec![1, 2])).unwrap();
        let second = Duration::from_secs(5);
        assert_eq!(device.send("count", second, |list, _| Ok(list.len())).wait(), Ok(2));
        let (go, gone) = mpsc::channel::<()>();
        let hang = device.send("wait", Duration::from_millis(1), move |_, _| {
            let _ = gone.recv();
            Ok(())
        });
        let error = hang.wait().unwrap_err().0;
        assert!(error.contains("the camera hangs: it was told to wait and did not answer within 0.0 s"), "{error}");
        drop(go);
        assert_eq!(device.send("count", second, |list, _| Ok(list.len())).wait(), Ok(2), "it came back");
        let panicked: Result<()> = device.send("fall", second, |_, _| panic!("fallen")).wait();
        assert!(panicked.unwrap_err().0.contains("the adapter of the camera panicked when it was told to fall"));
        assert!(device.send("count", second, |list, _| Ok(list.len())).wait().is_err());
        assert!(device.has_panicked());
    }
}
