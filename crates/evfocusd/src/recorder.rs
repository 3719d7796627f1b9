//! Records what the camera sends and where the lens is meanwhile: the daemon's camera and lens threads, with files in place of the
//! controller.

mod files;
mod sweep;

use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use evfocus_core::controller::DeviceFailure;
use evfocus_core::{CameraMicros, ClockEvent, ClockMap, EventBatch, Events, HostMicros, LensSample};
use evfocus_hal::{Clock, SystemClock};
use evfocus_record::RecordError;
use rtrb::{Consumer, Producer, RingBuffer};

use crate::config::Config;
use crate::devices::{Devices, OpenError};
use crate::threads::camera::{BATCH_EVENTS, BATCHES, CameraThread};
use crate::threads::lens::{LensThread, SAMPLES};
use crate::threads::orders::{OrderSender, orders};
use crate::threads::{NOTICES, Notice, StopFlag};
use crate::vitals::Vitals;
use files::Files;
pub use files::positions_beside;
use sweep::Sweeper;

/// How long the recorder sleeps unless somebody wakes it.
const NAP: Duration = Duration::from_millis(2);
/// How often what was written is handed to the system, so that it outlives this program.
const FLUSH: Duration = Duration::from_secs(1);
/// How long the camera may take to send what happened before the sweep was over; a simulated one on a busy computer is slow.
const LONGEST_DELAY: Duration = Duration::from_secs(10);
/// A recorded sweep begins after this long even if the lens has not answered, seconds.
const LONGEST_WAIT_FOR_THE_LENS_S: f64 = 1.0;
/// Positions are put on the camera's clock so many microseconds after they came: by then it is known better.
const SETTLE_US: i64 = 2_000_000;

/// What to record, and where.
#[derive(Debug, Clone)]
pub struct RecordPlan {
    /// The recording; the ending of its name says the format. The positions go beside it: [`positions_beside`].
    pub file: PathBuf,
    /// How long; absent: until it is stopped, or the sweep is over.
    pub duration: Option<Duration>,
    /// Whether the lens goes through its range meanwhile, up and down, as fast as it can.
    pub sweep: bool,
    /// Whether files of these names are replaced.
    pub overwrite: bool,
}

/// What has been recorded.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Recorded {
    /// Events in the file.
    pub events: u64,
    /// Events that the camera, the link or this computer is known to have lost.
    pub lost: u64,
    /// Positions beside it.
    pub positions: u64,
    /// Positions from before the camera's clock started anew, which are not.
    pub positions_lost: u64,
    /// Whether the lens failed, if only for a while.
    pub lens_failed: bool,
    /// From the first thing the camera said to the last, seconds.
    pub seconds: f64,
}

/// Why a recording ended early, or could not begin.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The name of the file does not say what it is to be.
    #[error("{}: a recording's name ends in .raw (EVT3, Prophesee) or .aedat4 (iniVation); name it so", path.display())]
    Name {
        /// The file.
        path: PathBuf,
    },
    /// A file of this name is there.
    #[error("{}: is there already and was left alone; choose another name, or allow to overwrite it", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// The devices cannot be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// A thread cannot be started.
    #[error("cannot start the thread {name}: {cause}")]
    Thread {
        /// Its name.
        name: &'static str,
        /// Why.
        cause: std::io::Error,
    },
    /// A file cannot be written, or not any more.
    #[error("{cause}; {} events are in it; make room, or choose another place, and record again", recorded.events)]
    Write {
        /// Which file, and why.
        cause: Box<RecordError>,
        /// What is in the files.
        recorded: Recorded,
    },
    /// The camera ended the recording.
    #[error("the camera failed after {:.1} s: {what}; {} events were recorded", recorded.seconds, recorded.events)]
    Camera {
        /// What happened.
        what: &'static str,
        /// What is in the files.
        recorded: Recorded,
    },
    /// The lens did not make the sweep.
    #[error("the lens did not make the sweep: {what}; {} events were recorded", recorded.events)]
    Lens {
        /// What happened.
        what: String,
        /// What is in the files.
        recorded: Recorded,
    },
}

/// Ends a recording from another thread.
#[derive(Debug, Clone, Default)]
pub struct StopRecording(StopFlag);

impl StopRecording {
    /// Ends it: what has arrived is still written.
    pub fn stop(&self) {
        self.0.stop();
    }
}

/// Records with the devices of `config` until the plan is fulfilled, `stop` is used, or something fails. Whatever ends it, the files are
/// complete up to there. `started` is called once the devices are open.
///
/// # Errors
/// [`RecordingError`], which says what was recorded all the same.
pub fn record(
    config: &Config,
    plan: &RecordPlan,
    stop: &StopRecording,
    started: impl FnOnce(),
) -> Result<Recorded, RecordingError> {
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    files::check(plan)?;
    let devices = Devices::open(config, &clock)?;
    let (geometry, lens_info) = (devices.camera.info().geometry, devices.lens.info());
    let files = Files::create(plan, geometry)?;

    let (filled_in, filled) = RingBuffer::new(BATCHES);
    let (mut empty, empty_out) = RingBuffer::new(BATCHES);
    while empty.push(EventBatch::with_capacity(BATCH_EVENTS)).is_ok() {}
    let (samples_in, samples) = RingBuffer::new(SAMPLES);
    let (camera_notices, camera_notices_out) = RingBuffer::new(NOTICES);
    let (lens_notices, lens_notices_out) = RingBuffer::new(NOTICES);
    let (orders_in, orders_out) = orders();
    let (control, camera_stop) = (std::thread::current(), StopFlag::default());
    let vitals = Vitals::default();
    let camera = CameraThread {
        camera: devices.camera,
        clock: Arc::clone(&clock),
        empty: empty_out,
        filled: filled_in,
        notices: camera_notices,
        control: control.clone(),
        stop: camera_stop.clone(),
    };
    let lens = LensThread {
        lens: devices.lens,
        clock: Arc::clone(&clock),
        poll: config.lens_poll,
        orders: orders_out,
        samples: samples_in,
        notices: lens_notices,
        control,
        vitals: vitals.clone(),
    };
    let mut recorder = Recorder {
        vitals,
        files,
        empty,
        filled,
        samples,
        camera_notices: camera_notices_out,
        lens_notices: lens_notices_out,
        map: ClockMap::new(None),
        waiting: Vec::new(),
        from: None,
        began: None,
        recorded: Recorded::default(),
        sweeper: plan.sweep.then(|| Sweeper::new(&lens_info)),
    };
    let camera = spawn("evfocus-camera", move || camera.run())?;
    let lens = spawn("evfocus-lens", move || lens.run())?;
    started();
    let end = plan.duration.map(|duration| clock.now() + duration);
    let outcome = recorder.run(clock.as_ref(), &orders_in, end, &stop.0);
    camera_stop.stop();
    // The end of the orders stops the lens.
    drop(orders_in);
    for thread in [camera, lens] {
        if thread.join().is_err() {
            tracing::error!("a device's thread has panicked; the log says where");
        }
    }
    recorder.finish(outcome)
}

fn spawn(name: &'static str, body: impl FnOnce() + Send + 'static) -> Result<JoinHandle<()>, RecordingError> {
    let thread = std::thread::Builder::new().name(name.to_owned()).spawn(body);
    thread.map_err(|cause| RecordingError::Thread { name, cause })
}

/// The recording under way.
struct Recorder {
    /// Tells the lens's thread that this one still looks after it.
    vitals: Vitals,
    files: Files,
    empty: Producer<EventBatch>,
    filled: Consumer<EventBatch>,
    samples: Consumer<LensSample>,
    camera_notices: Consumer<Notice>,
    lens_notices: Consumer<Notice>,
    map: ClockMap,
    /// Samples that are not yet on the camera's clock, oldest first.
    waiting: Vec<LensSample>,
    /// A recorded sweep begins here: where the lens was before its first answer nobody knows.
    from: Option<CameraMicros>,
    /// The first camera time.
    began: Option<CameraMicros>,
    recorded: Recorded,
    sweeper: Option<Sweeper>,
}

/// What ended it, other than its plan.
enum Trouble {
    Write(RecordError),
    Camera(&'static str),
    Lens(String),
}

impl From<RecordError> for Trouble {
    fn from(error: RecordError) -> Self {
        Self::Write(error)
    }
}

impl Recorder {
    fn run(
        &mut self,
        clock: &dyn Clock,
        orders: &OrderSender,
        end: Option<HostMicros>,
        stop: &StopFlag,
    ) -> Result<(), Trouble> {
        let mut flushed = clock.now();
        let mut sweep_ended: Option<HostMicros> = None;
        loop {
            std::thread::park_timeout(NAP);
            self.vitals.beat();
            let now = clock.now();
            self.take_batches()?;
            self.take_samples(HostMicros(now.0.saturating_sub(SETTLE_US)))?;
            if now.since(flushed) >= FLUSH {
                flushed = now;
                self.files.flush()?;
            }
            if stop.is_stopped() || end.is_some_and(|end| now >= end) {
                return Ok(());
            }
            self.take_notices()?;
            let Some(sweeper) = &mut self.sweeper else { continue };
            let Some(ended) = sweep_ended else {
                if sweeper.step(now, orders).map_err(Trouble::Lens)? {
                    sweep_ended = Some(now);
                }
                continue;
            };
            // What happened while the lens moved may still be on its way.
            if self.is_recorded(ended) || now.since(ended) > LONGEST_DELAY {
                return Ok(());
            }
        }
    }

    /// Whether the camera has sent all that happened until `time`.
    fn is_recorded(&self, time: HostMicros) -> bool {
        let newest = self.map.newest().and_then(|newest| self.map.to_host(newest).ok());
        newest.is_some_and(|newest| newest >= time)
    }

    fn take_batches(&mut self) -> Result<(), RecordError> {
        // No more than there are batches: a camera that fills them as fast as they are written must not keep a stop from being seen.
        for _ in 0..BATCHES {
            let Ok(mut batch) = self.filled.pop() else { break };
            self.recorded.lost += batch.lost;
            if let Some(reached) = batch.reached {
                if self.map.observe(reached, batch.arrival) == ClockEvent::Reset {
                    // The camera's clock started anew: where the lens was on the old one can no longer be told.
                    self.recorded.positions_lost += self.waiting.len() as u64;
                    self.waiting.clear();
                }
                let first = batch.events.first().map_or(reached, |event| event.t);
                let began = *self.began.get_or_insert(first);
                self.recorded.seconds = reached.micros_since(began) as f64 * 1e-6;
            }
            let unknown = self.unknown(batch.events.as_slice());
            let events = batch.events.as_slice().from(unknown);
            self.files.write(events)?;
            self.recorded.events += events.len() as u64;
            batch.clear();
            // There is a place for every batch, so the way back is never full.
            if self.empty.push(batch).is_err() {
                tracing::error!("a batch did not find its way back");
            }
        }
        Ok(())
    }

    /// How many of `events` came before the lens's first answer; of use to nobody in a recorded sweep.
    fn unknown(&mut self, events: Events<'_>) -> usize {
        if self.sweeper.is_none() {
            return 0;
        }
        let answered = self.waiting.first().and_then(|first| self.map.to_camera(first.time()).ok());
        let late = self.began.filter(|_| self.recorded.seconds > LONGEST_WAIT_FOR_THE_LENS_S);
        self.from = self.from.or(answered).or(late);
        self.from.map_or(events.len(), |from| events.first_at_or_after(from))
    }

    /// Takes the lens's answers, and writes those that came before `settled`.
    fn take_samples(&mut self, settled: HostMicros) -> Result<(), RecordError> {
        while let Ok(sample) = self.samples.pop() {
            if let Some(sweeper) = &mut self.sweeper {
                sweeper.see(&sample);
            }
            self.waiting.push(sample);
        }
        let due = self.waiting.partition_point(|sample| sample.replied <= settled);
        if self.map.newest().is_none() {
            return Ok(());
        }
        for sample in self.waiting.drain(..due) {
            if let Ok(time) = self.map.to_camera(sample.time()) {
                self.files.position(time, sample.position)?;
                self.recorded.positions += 1;
            }
        }
        Ok(())
    }

    fn take_notices(&mut self) -> Result<(), Trouble> {
        while let Ok(notice) = self.lens_notices.pop() {
            if matches!(notice, Notice::LensFailed(_)) {
                self.recorded.lens_failed = true;
                if self.sweeper.is_some() {
                    return Err(Trouble::Lens("it failed".to_owned()));
                }
            }
        }
        match self.camera_notices.pop() {
            Ok(Notice::CameraFailed(DeviceFailure::Gone)) => Err(Trouble::Camera("it is gone")),
            Ok(Notice::CameraFailed(DeviceFailure::Silent)) => Err(Trouble::Camera("it does not answer")),
            Ok(Notice::CameraFailed(DeviceFailure::Fault)) => Err(Trouble::Camera("it reports a fault")),
            Ok(Notice::CameraReady | Notice::LensFailed(_) | Notice::LensReady) | Err(_) => Ok(()),
        }
    }

    /// Writes what is still on its way, and ends the files.
    fn finish(mut self, outcome: Result<(), Trouble>) -> Result<Recorded, RecordingError> {
        let trouble = match outcome {
            // What came after it cannot be written either.
            Err(Trouble::Write(cause)) => Some(Trouble::Write(cause)),
            ended => self.drain().map_or_else(|cause| Some(Trouble::Write(cause)), |()| ended.err()),
        };
        let closed = self.files.finish(self.map.newest()).map_err(Trouble::Write);
        let recorded = self.recorded;
        let trouble = match trouble {
            Some(Trouble::Write(cause)) => Some(Trouble::Write(cause)),
            ended => closed.err().or(ended),
        };
        match trouble {
            None => Ok(recorded),
            Some(Trouble::Write(cause)) => Err(RecordingError::Write { cause: Box::new(cause), recorded }),
            Some(Trouble::Camera(what)) => Err(RecordingError::Camera { what, recorded }),
            Some(Trouble::Lens(what)) => Err(RecordingError::Lens { what, recorded }),
        }
    }

    fn drain(&mut self) -> Result<(), RecordError> {
        self.take_batches()?;
        self.take_samples(HostMicros(i64::MAX))
    }
}
