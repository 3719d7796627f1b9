//! The energy of fine structure on pictures small enough to work out by hand, and against the definition.

use core::time::Duration;

use evfocus_core::search::{
    ApexFinder, Bookings, Filter, LEAST_SIGNIFICANCE, StructureKernel, TileSet, TravelStep,
};
use evfocus_core::{CameraMicros, Event, Geometry, Method, Polarity, SearchError, Searcher, Window};
use proptest::prelude::*;

use crate::random::Xorshift;
use crate::stream::{GEOMETRY, poisson, position_is_time, record};

const SMALL: Geometry = Geometry { width: 5, height: 5 };

/// An event of pixel (x, y) when the lens is in the middle of `bin`.
fn take(kernel: &mut StructureKernel, (x, y): (u16, u16), on: bool, bin: u16) {
    let event = Event { t: CameraMicros(0), x, y, polarity: Polarity::from_on(on) };
    kernel.take(&event, TravelStep(bin * TravelStep::PER_BIN + TravelStep::PER_BIN / 2));
}

/// What is booked in each bin with the fine filter.
fn growth(bookings: &Bookings) -> Vec<i64> {
    bookings.by_bin(Filter::Fine, TileSet::ALL).collect()
}

/// The bins in which anything is booked.
fn booked(kernel: &StructureKernel) -> Vec<(usize, i64)> {
    growth(kernel.first_pass()).into_iter().enumerate().filter(|&(_, growth)| growth != 0).collect()
}

/// Half the sum over all pixels of E (K E), read off the definition.
fn half_energy(kernel: &StructureKernel, geometry: Geometry) -> i64 {
    let state = |x: i32, y: i32| -> i64 {
        match (u16::try_from(x), u16::try_from(y)) {
            (Ok(x), Ok(y)) => kernel.state(x, y).into(),
            _ => 0,
        }
    };
    let mut energy = 0;
    for (x, y) in (0..geometry.width).flat_map(|x| (0..geometry.height).map(move |y| (x.into(), y.into()))) {
        let cross = |d: i32| state(x - d, y) + state(x + d, y) + state(x, y - d) + state(x, y + d);
        energy += state(x, y) * (cross(1) - cross(2));
    }
    energy / 2
}

#[test]
fn neighbours_add_and_those_at_distance_two_take_away() {
    let mut kernel = StructureKernel::new(Window::whole(SMALL));
    kernel.begin();
    // Alone, beside one, between one beside and one at distance 2, at distance 2.
    for (place, bin) in [((2, 2), 10), ((2, 3), 20), ((2, 1), 30), ((4, 3), 40)] {
        take(&mut kernel, place, true, bin);
    }
    assert_eq!(booked(&kernel), [(20, 1), (40, -1)]);
    // Its only event before was in bin 10, so the first of two crossings is taken to lie midway. Two neighbours are at 1.
    take(&mut kernel, (2, 2), false, 50);
    assert_eq!(booked(&kernel), [(20, 1), (30, -2), (40, -1), (50, -2)]);
    assert_eq!(kernel.state(2, 2), -1);
    assert_eq!(half_energy(&kernel, SMALL), -4);
}

#[test]
fn a_turn_is_booked_where_the_last_gap_puts_it() {
    for (second, turn, earlier) in [(14, 30, 26), (30, 35, 32), (10, 30, 30)] {
        let mut kernel = StructureKernel::new(Window::whole(SMALL));
        kernel.begin();
        take(&mut kernel, (2, 2), true, 10);
        take(&mut kernel, (2, 2), true, second);
        take(&mut kernel, (2, 3), true, second);
        take(&mut kernel, (2, 2), false, turn);
        let growth = growth(kernel.first_pass());
        let total: i64 = growth[usize::from(second) + 1..].iter().sum();
        assert_eq!((total, kernel.state(2, 2)), (-2, 0));
        assert!(growth[earlier] < 0 && growth[usize::from(turn)] < 0, "{:?}", booked(&kernel));
    }
}

#[test]
fn the_picture_ends_at_its_edges_and_a_broken_pixel_at_thirty() {
    let mut kernel = StructureKernel::new(Window::whole(SMALL));
    kernel.begin();
    // Next to one another in memory, not on the sensor; and one beyond the sensor.
    for place in [(4, 1), (0, 2), (5, 2), (0, 5)] {
        take(&mut kernel, place, true, 10);
    }
    assert_eq!(booked(&kernel), []);
    for bin in 0..100 {
        take(&mut kernel, (3, 1), true, bin);
    }
    assert_eq!(kernel.state(3, 1), 30);
    assert_eq!(growth(kernel.first_pass()).iter().sum::<i64>(), half_energy(&kernel, SMALL));
}

proptest! {
    /// What is booked adds up to half the energy of the picture, whatever happened; the second pass, which holds each picture against
    /// the one at the end, adds up to all of it.
    #[test]
    fn bookings_add_up_to_the_energy(seed in any::<u64>(), number in 0..2_000_usize) {
        let geometry = Geometry { width: 7, height: 6 };
        let mut random = Xorshift::new(seed);
        let mut kernel = StructureKernel::new(Window::whole(geometry));
        let mut events = Vec::new();
        for index in 0..number {
            let place = random.next();
            let (x, y) = ((place >> 8) as u16 % 8, (place >> 24) as u16 % 8);
            let polarity = Polarity::from_on(random.uniform() < 0.3);
            let step = (index * usize::from(TravelStep::END.0) / number) as u16;
            events.push((Event { t: CameraMicros(0), x, y, polarity }, TravelStep(step)));
        }
        for _ in 0..2 {
            kernel.begin();
            for (event, step) in &events {
                kernel.take(event, *step);
            }
            let energy = half_energy(&kernel, geometry);
            prop_assert_eq!(growth(kernel.first_pass()).iter().sum::<i64>(), energy);
            kernel.begin_again();
            for (event, step) in &events {
                kernel.take_again(event, *step);
            }
            prop_assert_eq!(growth(kernel.second_pass()).iter().sum::<i64>(), 2 * energy);
        }
    }

    /// A window sees what a sensor of its size would.
    #[test]
    fn a_window_is_a_sensor_of_its_own(seed in any::<u64>(), left in 0..4_u16, top in 0..4_u16) {
        let window = Window { x: left, y: top, width: 6, height: 5 };
        let mut random = Xorshift::new(seed);
        let mut within = StructureKernel::new(window);
        let mut alone = StructureKernel::new(Window::whole(Geometry { width: 6, height: 5 }));
        within.begin();
        alone.begin();
        for bin in 0..350 {
            let place = random.next();
            let (x, y) = ((place >> 8) as u16 % 10, (place >> 24) as u16 % 10);
            take(&mut within, (x, y), place.is_multiple_of(3), bin);
            if let Some((x, y)) = window.place_of(x, y) {
                take(&mut alone, (x, y), place.is_multiple_of(3), bin);
            }
        }
        prop_assert_eq!(booked(&within), booked(&alone));
    }

    /// A parabola's apex is found between the bins, and the significance of a smooth curve is high.
    #[test]
    fn the_apex_of_a_bell_is_its_middle(middle in 60.0..290.0_f64, width in 12.0..40.0_f64) {
        let bell = |bin: usize| 1e6 * libm::exp(-((bin as f64 + 1.0 - middle) / width).powi(2));
        let curve: Vec<f64> = (0..Bookings::BINS).map(bell).collect();
        for top in [0.7, 0.85] {
            let apex = ApexFinder::new().find(&curve, top).unwrap();
            prop_assert!((apex.at - middle).abs() < 0.3, "{apex:?}");
            prop_assert!(apex.significance > LEAST_SIGNIFICANCE, "{apex:?}");
        }
    }
}

#[test]
fn curves_without_a_peak_have_an_apex_within_the_sweep_and_no_significance() {
    let mut finder = ApexFinder::new();
    assert_eq!(finder.find(&[], 0.85), None);
    assert!(finder.find(&[0.0; Bookings::BINS], 0.85).unwrap().significance < LEAST_SIGNIFICANCE);
    let mut random = Xorshift::new(5);
    for _ in 0..200 {
        let mut sum = 0.0;
        let walk = (0..Bookings::BINS).map(|_| {
            sum += (random.uniform() - 0.5) * 1e4;
            sum
        });
        let apex = finder.find(&walk.collect::<Vec<f64>>(), 0.85).unwrap();
        assert!((0.0..=351.0).contains(&apex.at) && apex.significance < LEAST_SIGNIFICANCE, "{apex:?}");
    }
}

#[test]
fn events_without_a_picture_are_refused() {
    let mut random = Xorshift::new(11);
    let events = poisson(&mut random, 2e6, 1e5, |t| 1e3 + 9.9e4 * libm::exp(-((t - 1.3e6) / 2e5).powi(2)));
    let (recorder, trace) = (record(&events, events.len()), position_is_time(2_000_000));
    let sweep = recorder.sweep(&trace).unwrap();
    let answer = Searcher::new(GEOMETRY).search(Method::Structure, &sweep, Duration::ZERO);
    let Err(error @ SearchError::Weak { significance }) = answer else { panic!("{answer:?}") };
    assert!(significance < LEAST_SIGNIFICANCE);
    assert!(error.to_string().contains("nothing with texture is in view, or it is too dark"));
}
