//! What one sweep says, as the socket and the files show it.

use evfocus_core::{Estimate, LegReport, Method, SearchError};
use evfocus_ipc as ipc;

/// What was counted and read off on one way.
pub(crate) fn sweep((leg, direction): (&LegReport, ipc::Direction)) -> ipc::Sweep {
    let points = leg.curve.points();
    ipc::Sweep {
        direction,
        from: leg.from.0,
        to: leg.to.0,
        start_us: leg.start.0,
        end_us: leg.end.0,
        curve: ipc::Curve {
            position: points.iter().map(|point| point.position.0).collect(),
            rate: points.iter().map(|point| point.rate.0).collect(),
            t_us: points.iter().map(|point| point.t_us.round() as i64).collect(),
        },
        estimators: Method::ALL
            .into_iter()
            .filter_map(|method| Some(estimate(method, leg.estimate(method)?, leg.on + leg.off)))
            .collect(),
        quality: ipc::Quality {
            share_at_ceiling: leg.quality.share_at_ceiling,
            regularity: leg.quality.regularity,
            dispersion: leg.quality.dispersion,
            flicker_hz: u64::from(leg.quality.flicker_hz),
            flicker_depth: leg.quality.flicker_depth,
        },
        structure: structure(leg),
    }
}

/// What the fine structure of the whole picture says of `leg`; nothing if it was not asked or found no peak.
pub fn structure(leg: &LegReport) -> Option<ipc::Structure> {
    let said = leg.structure.and_then(Result::ok)?;
    Some(ipc::Structure {
        position: said.position.0,
        width: said.width,
        significance: said.significance,
        scatter: said.scatter,
        noise_hz: said.noise_hz,
        second_depth: said.rival.map(|rival| rival.0),
        passes: said.passes.into(),
    })
}

fn estimate(method: Method, said: Result<Estimate, SearchError>, events: u64) -> ipc::Estimate {
    let found = said.ok();
    ipc::Estimate {
        method: method.name().to_owned(),
        state: if found.is_some() { ipc::State::Focused } else { ipc::State::Failed },
        reason: said.err().map(|error| error.to_string()),
        position: found.map(|estimate| estimate.position.0),
        t_us: found.map(|estimate| estimate.t_us.round() as i64),
        iterations: found.map_or(0, |estimate| u64::from(estimate.iterations)),
        events,
    }
}
