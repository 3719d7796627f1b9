//! The operators against numbers made by other libraries (`data/operators.py`), against pictures worked out by hand, and on blur.

use std::collections::BTreeMap;

use evfocus_eval::{GreyImage, Operator};
use serde::Deserialize;

#[derive(Deserialize)]
struct Picture {
    name: String,
    width: usize,
    levels: Vec<u8>,
    values: BTreeMap<String, f64>,
}

#[derive(Deserialize)]
struct Pictures {
    pictures: Vec<Picture>,
}

#[test]
fn values_are_those_of_other_libraries() -> anyhow::Result<()> {
    let made: Pictures = serde_json::from_str(include_str!("data/operators.json"))?;
    let mut compared = 0;
    for picture in made.pictures {
        let image = GreyImage::from_bytes(picture.width, &picture.levels);
        for (name, expected) in picture.values {
            let operator: Operator = name.parse()?;
            let value = operator.value(&image);
            assert!(
                (value - expected).abs() <= 1e-9 * expected.abs() + 1e-15,
                "{name} of {}: {value}, not {expected}",
                picture.name
            );
            compared += 1;
        }
        let enough = |operator: &Operator| image.width().min(image.height()) >= operator.smallest_side();
        assert!(Operator::ALL.iter().filter(|operator| enough(operator)).count() >= 6);
    }
    assert_eq!(compared, 51);
    Ok(())
}

/// 16 x 16, `left` up to column 8 and `right` beyond.
fn step(left: f64, right: f64) -> GreyImage {
    GreyImage::new(16, (0..256).map(|index| if index % 16 < 8 { left } else { right }).collect())
}

#[test]
fn an_even_picture_has_no_sharpness() {
    for operator in Operator::ALL {
        let nothing = if operator == Operator::Helm { 1.0 } else { 0.0 };
        let value = operator.value(&step(0.5, 0.5));
        assert!((value - nothing).abs() < 1e-12, "{operator}: {value}");
        let black = operator.value(&step(0.0, 0.0));
        assert!((black - nothing).abs() < 1e-12, "{operator} of black: {black}");
    }
}

#[test]
fn a_step_has_the_values_worked_out_by_hand() {
    // From 0.2 to 0.8: the two columns at the step have second differences of 0.6; Sobel sees 4 x 0.6 on both.
    let image = step(0.2, 0.8);
    let columns = 2.0 / 16.0;
    let by_hand = [
        (Operator::Sml, columns * 0.6),
        // On both diagonals the same 0.6, over the root of two.
        (Operator::Lap3, columns * 0.6 * (1.0 + 2.0 / 2.0_f64.sqrt())),
        (Operator::Grad, columns * 2.4 * 2.4),
        (Operator::Acmo, 0.3 * 255.0),
        // The upper and the lower half of the mask cancel on a vertical edge.
        (Operator::Dctm, 0.0),
    ];
    for (operator, expected) in by_hand {
        let value = operator.value(&image);
        assert!((value - expected).abs() < 1e-9, "{operator}: {value}, not {expected}");
    }
}

/// A picture with the 1/f spectrum of natural scenes: waves in all directions, octave by octave.
fn natural(seed: f64) -> GreyImage {
    let side = 64;
    let value = |index: usize| {
        let (x, y) = ((index % side) as f64, (index / side) as f64);
        let wave = |wave: u32| {
            let wave = f64::from(wave);
            let cycles = 1.19_f64.powf(wave) / side as f64;
            let (sin, cos) = (wave * 2.399 + seed).sin_cos();
            (std::f64::consts::TAU * cycles * (x * cos + y * sin) + 7.0 * wave * seed).sin()
                / (cycles * side as f64)
        };
        0.5 + 0.12 * (0..18).map(wave).sum::<f64>()
    };
    GreyImage::new(side, (0..side * side).map(value).collect())
}

fn blurred(image: &GreyImage, sigma: f64) -> GreyImage {
    let weight = |at: isize| (-0.5 * (at as f64 / sigma).powi(2)).exp();
    let total: f64 = (-12..=12).map(weight).sum();
    let weights: [f64; 25] = std::array::from_fn(|index| weight(index as isize - 12) / total);
    image.correlate(&[weights]).correlate(&weights.map(|weight| [weight]))
}

#[test]
fn blur_never_makes_a_picture_sharper() {
    for seed in [0.3, 1.1, 2.7] {
        let image = natural(seed);
        for operator in Operator::ALL {
            let mut before = operator.value(&image);
            for sigma in [0.5, 0.8, 1.2, 1.8, 2.6] {
                let value = operator.value(&blurred(&image, sigma));
                assert!(value <= before, "{operator} at sigma {sigma}: {value} after {before}");
                before = value;
            }
        }
    }
}
