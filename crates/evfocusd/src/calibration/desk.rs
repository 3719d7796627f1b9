//! The calibration that counts, and the one under way.

use evfocus_core::controller::{Action, Command, DeviceFailure, Mode, Pause, PauseState, Snapshot};
use evfocus_core::{Controller, ControllerConfig, DelayModel, HostMicros, LensSample, LensSpeed};
use evfocus_hal::LensInfo;
use evfocus_ipc::Calibration;

use super::{CalibrationFailure, Calibrator};
use crate::config::{BadValue, Config};
use crate::devices;

/// Play that differs by less than this from what was counted on leaves what was learnt of the pixels' delay, counts.
const SAME_PLAY: f64 = 1.0;

/// What is known of the lens in use by measurement.
#[derive(Debug)]
pub(crate) struct Desk {
    config: Config,
    lens: LensInfo,
    known: Option<Calibration>,
    /// With what was known of the pixels' delay before: the focus runs of a calibration do not know of the play.
    under_way: Option<(Calibrator, DelayModel)>,
    /// Continuous mode was at work when the calibration began.
    to_resume: bool,
}

impl Desk {
    /// For `lens`, of which `known` was measured before.
    pub(crate) fn new(config: Config, lens: LensInfo, known: Option<Calibration>) -> Self {
        Self { config, lens, known, under_way: None, to_resume: false }
    }

    /// The controller's settings.
    pub(crate) fn settings(&self) -> Result<ControllerConfig, BadValue> {
        self.config.controller(&self.lens, self.known.as_ref())
    }

    /// `action` as the lens must be told it, so that it does what the controller means: where speeds are shares of the fastest one,
    /// and that is another than the configuration says, they are asked for in proportion.
    pub(crate) fn order(&self, action: Action, controller: &Controller) -> Action {
        let Action::MoveLens { target, speed } = action else { return action };
        let (said, is) =
            (self.lens.max_speed.counts_per_second(), controller.config().max_speed.counts_per_second());
        if !self.lens.speed_is_share {
            return action;
        }
        let told = (speed.counts_per_second() * said / is).min(said);
        Action::MoveLens { target, speed: LensSpeed::new(told).unwrap_or(speed) }
    }

    /// Takes a new configuration for the same lens.
    pub(crate) fn configure(&mut self, config: Config) {
        self.config = config;
    }

    pub(crate) fn is_calibrating(&self) -> bool {
        self.under_way.is_some()
    }

    /// Begins to calibrate; there must be a lens, and no run. A motion by hand ends.
    ///
    /// # Errors
    /// In words; the lens does not move.
    pub(crate) fn begin(
        &mut self,
        controller: &mut Controller,
        now: HostMicros,
        actions: &mut Vec<Action>,
    ) -> Result<(), String> {
        // Of the lens as it is configured: what was measured before does not count.
        let settings = self.config.controller(&self.lens, None).map_err(|bad| bad.to_string())?;
        let Snapshot { mode, pause, .. } = controller.snapshot();
        self.to_resume = mode == Mode::Continuous && pause == PauseState::Running;
        // That pauses continuous mode, too.
        controller.command(Command::Abort, now, actions).map_err(|refusal| refusal.to_string())?;
        let lens = devices::name(&self.lens.model, &self.lens.serial);
        tracing::info!(lens, limits = %settings.limits, "calibrating the lens");
        let calibrator = Calibrator::new(&settings, &self.lens, now);
        self.under_way = Some((calibrator, controller.delays()));
        Ok(())
    }

    pub(crate) fn sample(&mut self, sample: LensSample) {
        if let Some((calibrator, _)) = &mut self.under_way {
            calibrator.sample(sample);
        }
    }

    pub(crate) fn lens_failed(&mut self, failure: DeviceFailure) {
        if let Some((calibrator, _)) = &mut self.under_way {
            calibrator.lens_failed(failure);
        }
    }

    pub(crate) fn abort(&mut self) {
        if let Some((calibrator, _)) = &mut self.under_way {
            calibrator.abort();
        }
    }

    /// Goes on with the calibration under way; says how it ended, once. What was measured counts from then on.
    pub(crate) fn advance(
        &mut self,
        controller: &mut Controller,
        now: HostMicros,
        actions: &mut Vec<Action>,
    ) -> Option<Result<Calibration, CalibrationFailure>> {
        let (calibrator, _) = self.under_way.as_mut()?;
        let ended = calibrator.advance(controller, now, actions)?;
        let (_, mut delays) = self.under_way.take()?;
        if let Ok(calibration) = &ended {
            tracing::info!(?calibration, "the lens is calibrated");
            let play = |desk: &Self| desk.settings().map_or(0.0, |settings| settings.backlash);
            let before = play(self);
            self.known = Some(calibration.clone());
            if (play(self) - before).abs() > SAME_PLAY {
                // It was taken for delay.
                delays = DelayModel::default();
            }
        }
        match self.settings() {
            Ok(settings) => {
                // A run that was aborted has ended.
                controller.reconfigure(settings);
                controller.set_delays(delays);
            }
            Err(error) => tracing::error!(%error, "the calibration does not suit the configuration"),
        }
        if core::mem::take(&mut self.to_resume)
            && let Err(refusal) = controller.command(Command::Pause(Pause::Resume), now, actions)
        {
            tracing::debug!(%refusal, "continuous mode does not go on");
        }
        Some(ended)
    }
}
