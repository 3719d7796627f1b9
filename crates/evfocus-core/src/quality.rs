//! What makes a sweep's counts unfit to find focus with, read off the counter alone.

use crate::counter::{CounterError, CumulativeCounter, EventCounts};
use crate::sweep::Sweep;

/// What the counts of a sweep look like.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SweepQuality {
    /// Share of the 5 ms windows whose rate lies above 90 % of the rate's 99th percentile: a rate that sits at a ceiling.
    pub share_at_ceiling: f64,
    /// Variance over mean of the counts of neighbouring 5 ms windows at the ceiling: 1 for chance, near 0 for a rate that is held down.
    /// A dark scene, in which noise is most of what there is, spends long at its ceiling too, but scatters.
    pub ceiling_dispersion: f64,
    /// Variance over mean of the counts in 0.2 ms bins during the busiest half of the sweep: 1 for chance, near 0 for a read-out that
    /// is the bottleneck.
    pub regularity: f64,
    /// Variance over mean of the counts in fiftieths of the sweep: 1 for a rate that only varies by chance.
    pub dispersion: f64,
    /// The mains frequency, 100 or 120 Hz, at which ON and OFF alternate most, and by how much: amplitude of the
    /// ON minus OFF rate at that frequency over the mean event rate, 0 to 2.
    pub flicker_hz: u32,
    /// See [`flicker_hz`](Self::flicker_hz).
    pub flicker_depth: f64,
}

const CEILING_WINDOW_US: f64 = 5_000.0;
const REGULARITY_BIN_US: f64 = 200.0;
const DISPERSION_PARTS: u32 = 50;
const FLICKER_BIN_US: f64 = 1_000.0;
/// Bins of the histogram that finds percentiles without keeping the values.
const HISTOGRAM: usize = 512;

impl SweepQuality {
    /// Looks at the counts of `sweep`. Allocates nothing; a few passes over windows, not over events.
    ///
    /// # Errors
    /// [`CounterError`] if the counter does not cover the sweep.
    pub fn of(sweep: &Sweep<'_>) -> Result<Self, CounterError> {
        let Ceiling { share, dispersion: ceiling_dispersion, busy_count } = Ceiling::of(sweep)?;
        let (flicker_hz, flicker_depth) = flicker(sweep)?;
        Ok(Self {
            share_at_ceiling: share,
            ceiling_dispersion,
            regularity: regularity(sweep, busy_count)?,
            dispersion: dispersion(sweep)?,
            flicker_hz,
            flicker_depth,
        })
    }

    /// The rate was capped by the read-out or the link: more than 30 % of the windows at the ceiling without the scatter of chance, or
    /// counts far more regular than chance.
    pub fn is_saturated(&self) -> bool {
        (self.share_at_ceiling > 0.3 && self.ceiling_dispersion < 0.5) || self.regularity < 0.1
    }

    /// The rate does not depend on the lens: its variation is what chance alone makes.
    pub fn is_flat(&self) -> bool {
        self.dispersion < 2.0
    }

    /// A good part of the events follows the mains.
    pub fn has_flicker(&self) -> bool {
        self.flicker_depth > 0.3
    }
}

/// Counts in consecutive windows of `width_us` that lie wholly within the sweep.
fn windows<'a>(sweep: &'a Sweep<'a>, width_us: f64) -> impl Iterator<Item = Result<f64, CounterError>> + 'a {
    let start = sweep.start.0 as f64;
    let count = libm::floor(sweep.length_us() / width_us) as u32;
    let counter: &CumulativeCounter = sweep.counter;
    (0..count).map(move |index| {
        let from = start + f64::from(index) * width_us;
        counter.count_between(from, from + width_us).map(EventCounts::total)
    })
}

/// The rate at its highest.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Ceiling {
    share: f64,
    dispersion: f64,
    /// The median count of a 5 ms window.
    busy_count: f64,
}

impl Ceiling {
    fn of(sweep: &Sweep<'_>) -> Result<Self, CounterError> {
        let mut highest: f64 = 0.0;
        let mut number = 0_u32;
        for count in windows(sweep, CEILING_WINDOW_US) {
            highest = highest.max(count?);
            number += 1;
        }
        // Too short to speak of percentiles.
        if number < 20 || highest <= 0.0 {
            return Ok(Self::default());
        }
        let mut histogram = [0_u32; HISTOGRAM];
        for count in windows(sweep, CEILING_WINDOW_US) {
            let place = (count? / highest * (HISTOGRAM - 1) as f64) as usize;
            if let Some(cell) = histogram.get_mut(place) {
                *cell += 1;
            }
        }
        let percentile = |share: f64| {
            let wanted = share * f64::from(number);
            let mut below = 0.0;
            let place = histogram.iter().position(|&cell| {
                below += f64::from(cell);
                below >= wanted
            });
            (place.unwrap_or(HISTOGRAM - 1) as f64 + 0.5) / (HISTOGRAM - 1) as f64 * highest
        };
        let ceiling = 0.9 * percentile(0.99);
        let (mut at_ceiling, mut squares, mut sum) = (0_u32, 0.0, 0.0);
        let mut before = 0.0;
        for count in windows(sweep, CEILING_WINDOW_US) {
            let count = count?;
            at_ceiling += u32::from(count > ceiling);
            // Differences of neighbours, so that a slow change of the rate drops out. Chosen by their mean, which says nothing of how
            // far chance puts them apart; choosing each of them would leave out what is far apart.
            let mean = f64::midpoint(before, count);
            if mean > ceiling {
                squares += (count - before) * (count - before) / 2.0;
                sum += mean;
            }
            before = count;
        }
        Ok(Self {
            share: f64::from(at_ceiling) / f64::from(number),
            dispersion: if sum > 0.0 { squares / sum } else { 1.0 },
            busy_count: percentile(0.5),
        })
    }
}

/// Variance over mean of 0.2 ms counts within the 5 ms windows that hold at least `busy_count` events, with the slow change of
/// the rate taken out: differences of neighbours have twice the variance.
fn regularity(sweep: &Sweep<'_>, busy_count: f64) -> Result<f64, CounterError> {
    let (mut squares, mut sum, mut number) = (0.0, 0.0, 0_u32);
    let busy_bin = busy_count * REGULARITY_BIN_US / CEILING_WINDOW_US;
    let mut before: Option<f64> = None;
    for count in windows(sweep, REGULARITY_BIN_US) {
        let count = count?;
        if let Some(before) = before
            && f64::midpoint(before, count) >= busy_bin
        {
            squares += (count - before) * (count - before) / 2.0;
            sum += f64::midpoint(before, count);
            number += 1;
        }
        before = Some(count);
    }
    // A handful of events in a bin is regular only by accident of the grid.
    if number < 100 || sum / f64::from(number) < 10.0 { Ok(1.0) } else { Ok(squares / sum) }
}

fn dispersion(sweep: &Sweep<'_>) -> Result<f64, CounterError> {
    let (mut sum, mut squares, mut number) = (0.0, 0.0, 0.0);
    for count in windows(sweep, sweep.length_us() / f64::from(DISPERSION_PARTS)) {
        let count = count?;
        sum += count;
        squares += count * count;
        number += 1.0;
    }
    if number < 2.0 || sum <= 0.0 {
        return Ok(0.0);
    }
    let mean = sum / number;
    Ok((squares / number - mean * mean) / mean)
}

/// Amplitude of ON minus OFF at 100 and 120 Hz by Goertzel's sums, less that at the frequencies beside it.
fn flicker(sweep: &Sweep<'_>) -> Result<(u32, f64), CounterError> {
    let amplitude = |frequency_hz: f64| -> Result<f64, CounterError> {
        let step = 2.0 * core::f64::consts::PI * frequency_hz * FLICKER_BIN_US * 1e-6;
        let (mut cosine, mut sine, mut total) = (0.0, 0.0, 0.0);
        let bins = libm::floor(sweep.length_us() / FLICKER_BIN_US) as u32;
        for index in 0..bins {
            let from = sweep.start.0 as f64 + f64::from(index) * FLICKER_BIN_US;
            let counts = sweep.counter.count_between(from, from + FLICKER_BIN_US)?;
            let difference = counts.on - counts.off;
            cosine += difference * libm::cos(step * f64::from(index));
            sine += difference * libm::sin(step * f64::from(index));
            total += counts.total();
        }
        Ok(if total > 0.0 { 2.0 * libm::hypot(cosine, sine) / total } else { 0.0 })
    };
    let mut strongest = (100, 0.0);
    for frequency in [100_u32, 120] {
        let beside = amplitude(f64::from(frequency) - 7.0)?.max(amplitude(f64::from(frequency) + 7.0)?);
        let above = (amplitude(f64::from(frequency))? - beside).max(0.0);
        if above > strongest.1 {
            strongest = (frequency, above);
        }
    }
    Ok(strongest)
}
