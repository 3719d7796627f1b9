//! Runs with things going wrong at random moments, in virtual time, and what must hold whatever goes wrong.
//!
//! A trial is the daemon's controller on the simulated rig with a small sensor; between the two stand a camera and a lens that fail as
//! their script says, and what the runs come to is kept in a state directory on a disk that does so too. Clients throw commands in, and
//! the process may be killed and started again. All of it follows from a seed.

mod devices;
mod disk;
mod draw;
mod judge;
mod memory;
mod mishap;
pub mod page;
pub mod record;
mod shelf;

use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Duration;

use anyhow::Result;
use evfocus_core::controller::{Accepted, Command, FocusRequest, Mode};
use evfocus_core::{HostMicros, LensPosition};
use evfocusd::devices::Devices;
use evfocusd::{Config, VirtualRig};

use devices::{CameraFault, FaultyCamera, FaultyLens, LensFault, Spell, Witness};
use disk::{Death, DiskFault, FaultyDisk};
use judge::Judge;
use shelf::{Keeper, Shelf};

pub use mishap::Mishap;

/// What the service manager waits before it tries to start the process again.
const RESTART: Duration = Duration::from_secs(2);
/// A fault that ends lasts no longer than this.
const LONGEST_SPELL: Duration = Duration::from_secs(8);
/// Nothing new goes wrong after this.
const LAST_FAULT: Duration = Duration::from_secs(9);
/// How long a trial in continuous mode goes on, at least: what happens to the scene is to be noticed.
const CONTINUOUS_END: Duration = Duration::from_secs(18);

/// A trial, drawn.
#[derive(Debug, Clone)]
pub struct Trial {
    /// What goes wrong.
    pub mishaps: BTreeSet<Mishap>,
    /// Whether runs start by themselves from the beginning.
    pub is_continuous: bool,
    seed: u64,
    config: Config,
    request: FocusRequest,
    camera: Vec<Spell<CameraFault>>,
    lens: Vec<Spell<LensFault>>,
    disk: Vec<Spell<DiskFault>>,
    commands: Vec<(HostMicros, Command)>,
    starved: Vec<(HostMicros, Duration)>,
    killed: Option<HostMicros>,
    /// In which step of the disk the process ends, and how.
    death: Option<(u32, Death)>,
}

/// How a trial went.
#[derive(Debug, Clone)]
pub struct Ended {
    /// How each call to focus ended, by `focused`, `aborted`, `killed`, `refused` or the reason.
    pub outcomes: Vec<&'static str>,
    /// The invariants that did not hold, in words.
    pub broken: Vec<String>,
    /// Virtual time that it took.
    pub lasted: Duration,
    /// The most that memory grew by while it lasted, bytes.
    pub grown: u64,
}

fn at(time: Duration) -> HostMicros {
    HostMicros(0) + time
}

impl Trial {
    fn of(seed: u64, config: Config, request: FocusRequest) -> Self {
        Self {
            mishaps: BTreeSet::new(),
            is_continuous: false,
            seed,
            config,
            request,
            camera: Vec::new(),
            lens: Vec::new(),
            disk: Vec::new(),
            commands: Vec::new(),
            starved: Vec::new(),
            killed: None,
            death: None,
        }
    }

    /// Makes the runs and judges them. A panic is a broken invariant.
    ///
    /// # Errors
    /// A rig that is refused, which is a fault of this file; a temporary folder that cannot be used.
    pub fn run(&self) -> Result<Ended> {
        match catch_unwind(AssertUnwindSafe(|| self.run_guarded())) {
            Ok(ended) => ended,
            Err(panic) => {
                let words = panic.downcast_ref::<String>().cloned();
                let words = words.or_else(|| panic.downcast_ref::<&str>().map(|words| (*words).to_owned()));
                let broken = vec![format!("a panic: {}", words.unwrap_or_default())];
                Ok(Ended { outcomes: vec!["panicked"], broken, lasted: Duration::ZERO, grown: 0 })
            }
        }
    }

    fn run_guarded(&self) -> Result<Ended> {
        let (mut judge, mut shelf) = (Judge::default(), Shelf::new()?);
        let mut commands = self.commands.iter().peekable();
        let mut starved = self.starved.iter().peekable();
        let mut life = Life::begin(self, &self.config, HostMicros(0), &shelf, self.death)?;
        self.set_mode(&mut life, &mut judge);
        let (mut killed, mut held) = (self.killed, memory::held());
        let end = at(if self.is_continuous { CONTINUOUS_END } else { LAST_FAULT });
        while life.now() < end || !judge.is_settled() {
            let is_killed = killed.is_some_and(|moment| life.now() >= moment);
            let has_died = judge.take_ended() && life.keeper.keep(&life.rig, &mut shelf)?.is_some();
            if is_killed || has_died {
                killed = killed.filter(|_| !is_killed);
                life = life.end(self, &mut judge, &shelf)?;
                held = memory::held();
                self.set_mode(&mut life, &mut judge);
                // Who had called has lost the connection, and calls again.
                judge.command(&mut life.rig, Command::Focus(self.request));
            }
            if let Some((_, length)) = starved.next_if(|(time, _)| *time <= life.now()) {
                life.rig.starve(*length);
                judge.starved();
            }
            while let Some((_, command)) = commands.next_if(|(time, _)| *time <= life.now()) {
                judge.command(&mut life.rig, *command);
            }
            life.rig.step();
            judge.watch(&life.rig, &life.witness, life.age);
            judge.weigh(memory::held() - held);
            if judge.is_hopeless() {
                break;
            }
        }
        judge.count(&life.rig, &life.witness);
        let lasted = life.now().since(HostMicros(0));
        drop(life);
        judge.blame(shelf.check()?);
        Ok(judge.verdict(lasted))
    }

    /// The mode that the configuration names.
    fn set_mode(&self, life: &mut Life, judge: &mut Judge) {
        if self.is_continuous {
            judge.command(&mut life.rig, Command::SetMode(Mode::Continuous));
        }
    }
}

/// The life of a process: from a start to a kill or the end.
struct Life {
    rig: VirtualRig,
    witness: Arc<Witness>,
    keeper: Keeper,
    /// When it began; the rig's own clock begins anew with each.
    age: Duration,
}

impl Life {
    fn begin(
        trial: &Trial,
        config: &Config,
        now: HostMicros,
        shelf: &Shelf,
        death: Option<(u32, Death)>,
    ) -> Result<Self> {
        let witness = Arc::new(Witness::new(config.rig.lens.range));
        let age = now.since(HostMicros(0));
        let rig = VirtualRig::with_devices(config, |rig, clock| {
            let (camera, lens) = rig.devices();
            let camera = FaultyCamera::new(
                camera,
                shifted(&trial.camera, age),
                Arc::clone(&clock),
                Arc::clone(&witness),
            );
            let lens = FaultyLens::new(lens, shifted(&trial.lens, age), clock, Arc::clone(&witness));
            Ok(Devices { camera: Box::new(camera), lens: Box::new(lens) })
        })?;
        let keeper = shelf.open(FaultyDisk::new(shifted(&trial.disk, age), death, trial.seed))?;
        Ok(Self { rig, witness, keeper, age })
    }

    /// Trial time.
    fn now(&self) -> HostMicros {
        self.rig.now() + self.age
    }

    /// The process ends here, without a word to anybody, and starts again: the lens is where it was, and knows nothing.
    fn end(self, trial: &Trial, judge: &mut Judge, shelf: &Shelf) -> Result<Self> {
        judge.count(&self.rig, &self.witness);
        judge.killed();
        let mut config = trial.config.clone();
        let (low, high) = (config.rig.lens.range.min().0, config.rig.lens.range.max().0);
        config.rig.lens.start = LensPosition(self.rig.rig().glass(self.rig.now()).0.clamp(low, high));
        config.rig.faults.clear();
        let mut start = self.now();
        self.keeper.end()?;
        judge.blame(shelf.check()?);
        // A camera that is away keeps the process from starting; the service manager tries again.
        loop {
            match Self::begin(trial, &config, start, shelf, None) {
                Err(_) if start < at(LAST_FAULT) + LONGEST_SPELL => start += RESTART,
                begun => return begun,
            }
        }
    }
}

/// The script as a process sees it that started at `age`.
fn shifted<Kind: Copy>(script: &[Spell<Kind>], age: Duration) -> Vec<Spell<Kind>> {
    let shift = |time: HostMicros| HostMicros(time.0 - age.as_micros() as i64);
    script
        .iter()
        .map(|spell| Spell { kind: spell.kind, from: shift(spell.from), until: shift(spell.until) })
        .filter(|spell| spell.until > HostMicros(0))
        .collect()
}

/// Whether a command began something that moves the lens.
fn moves(command: Command, accepted: Accepted) -> bool {
    matches!((command, accepted), (Command::MoveTo(_), Accepted::Done))
}
