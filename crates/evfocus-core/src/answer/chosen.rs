//! The answer of one sweep that counts: of several windows or depths, the preferred one.

use super::{Prefer, Rules, is_at_edge};
use crate::delay::Delay;
use crate::flags::{Flag, Flags};
use crate::report::{Failure, LegReport};
use crate::search::{LEAST_SIGNIFICANCE, SearchError, StructureAnswer};
use crate::units::LensPosition;

/// The answer of a sweep that counts, and which one that is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chosen {
    pub(super) structure: StructureAnswer,
    pub(super) position: LensPosition,
    pub(super) second_depth: Option<LensPosition>,
    pub(super) window: Option<u8>,
    pub(super) flags: Flags,
}

impl Chosen {
    pub(super) fn of(leg: &LegReport, rules: &Rules) -> Result<Self, Failure> {
        let (structure, window) = choose(leg, rules)?;
        let (mut position, mut second_depth) = (structure.position, structure.rival);
        if let (Some(rival), Prefer::Nearest) = (structure.rival, rules.prefer)
            && is_nearer(rival, position, rules)
        {
            second_depth = Some(core::mem::replace(&mut position, rival));
        }
        let mut flags = leg_flags(leg);
        flags.set(Flag::TwoDepths, structure.rival.is_some());
        flags.set(Flag::Edge, structure.is_at_edge);
        flags.set(Flag::Flat, structure.is_flat);
        flags.set(Flag::Coarse, structure.is_coarse);
        flags.set(Flag::Weak, structure.significance < LEAST_SIGNIFICANCE);
        if is_at_edge(structure.position, rules.range, rules.edge_share) {
            structure.significant().map_err(Failure::of_search)?;
            return Err(Failure::PeakAtEdge { position: structure.position });
        }
        Ok(Self { structure, position, second_depth, window, flags })
    }

    /// Itself, if it may be believed without another sweep that says the same.
    pub(super) fn alone(self, rules: &Rules) -> Result<Self, Failure> {
        self.structure.significant().map_err(Failure::of_search)?;
        if self.structure.is_unsure {
            let position = self.without_delay(self.position, rules);
            Err(Failure::Unsure { position, error_bar: self.structure.scatter })
        } else {
            Ok(self)
        }
    }

    /// Itself, the way back, as if the lens had no play.
    pub(super) fn with_backlash(mut self, rules: &Rules) -> Self {
        let shift = -self.towards() * rules.backlash;
        self.position.0 += shift;
        if let Some(second) = &mut self.second_depth {
            second.0 += shift;
        }
        self
    }

    /// 1 for a lens that went up, -1 for one that went down.
    pub(super) fn towards(&self) -> f64 {
        if self.structure.velocity < 0.0 { -1.0 } else { 1.0 }
    }

    pub(super) fn delay(&self, rules: &Rules) -> Delay {
        rules.delays.at(self.structure.noise_hz)
    }

    pub(super) fn without_delay(&self, position: LensPosition, rules: &Rules) -> LensPosition {
        LensPosition(position.0 - self.structure.velocity * self.delay(rules).seconds)
    }
}

fn is_nearer(one: LensPosition, other: LensPosition, rules: &Rules) -> bool {
    (one > other) == rules.nearest_is_high
}

fn is_sound(said: &StructureAnswer, rules: &Rules) -> bool {
    !said.is_unsure && said.significant().is_ok() && !is_at_edge(said.position, rules.range, rules.edge_share)
}

/// The answer of the whole picture, or that of the preferred window if there are windows. One that may be believed alone comes before any
/// that may not: the nearest chance peak is no subject.
fn choose(leg: &LegReport, rules: &Rules) -> Result<(StructureAnswer, Option<u8>), Failure> {
    let not_asked = Failure::NoAnswer(SearchError::NoLength { at_us: leg.start.0 });
    if leg.windows.first().is_none_or(Option::is_none) {
        return Ok((leg.structure.ok_or(not_asked)?.map_err(Failure::of_search)?, None));
    }
    let mut best: Option<(StructureAnswer, u8)> = None;
    let mut first_error = not_asked;
    for (index, (_, said)) in leg.windows.iter().flatten().enumerate() {
        match (said, rules.prefer) {
            (_, Prefer::Window(wanted)) if usize::from(wanted) != index => {}
            (Err(error), _) => first_error = Failure::of_search(*error),
            (Ok(said), prefer) => {
                let wins = best.is_none_or(|(best, _)| match prefer {
                    _ if is_sound(said, rules) != is_sound(&best, rules) => is_sound(said, rules),
                    Prefer::Nearest => is_nearer(said.position, best.position, rules),
                    Prefer::Strongest | Prefer::Window(_) => said.significance > best.significance,
                });
                if wins {
                    best = Some((*said, index as u8));
                }
            }
        }
    }
    best.map(|(answer, window)| (answer, Some(window))).ok_or(first_error)
}

pub(super) fn leg_flags(leg: &LegReport) -> Flags {
    let mut flags = Flags::default();
    flags.set(Flag::Saturated, leg.quality.is_saturated());
    flags.set(Flag::Flat, leg.quality.is_flat());
    flags.set(Flag::Flicker, leg.quality.has_flicker());
    flags.set(Flag::EventsLost, leg.lost > 0);
    flags
}
