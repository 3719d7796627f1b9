//! A page of random letters.

use rand::RngExt;
use rand_xoshiro::Xoshiro256PlusPlus;

use super::chart::{BLACK, WHITE};
use crate::fourier::Texture;

/// Letters of 5 x 7 dots, one byte a row, the lowest five bits from left to right.
const LETTERS: [[u8; 7]; 16] = [
    [0x0E, 0x11, 0x11, 0x1F, 0x11, 0x11, 0x11],
    [0x1E, 0x11, 0x11, 0x1E, 0x11, 0x11, 0x1E],
    [0x0E, 0x11, 0x10, 0x10, 0x10, 0x11, 0x0E],
    [0x1F, 0x10, 0x10, 0x1E, 0x10, 0x10, 0x1F],
    [0x1F, 0x10, 0x10, 0x1E, 0x10, 0x10, 0x10],
    [0x11, 0x11, 0x11, 0x1F, 0x11, 0x11, 0x11],
    [0x0E, 0x04, 0x04, 0x04, 0x04, 0x04, 0x0E],
    [0x11, 0x12, 0x14, 0x18, 0x14, 0x12, 0x11],
    [0x10, 0x10, 0x10, 0x10, 0x10, 0x10, 0x1F],
    [0x11, 0x1B, 0x15, 0x15, 0x11, 0x11, 0x11],
    [0x11, 0x19, 0x15, 0x13, 0x11, 0x11, 0x11],
    [0x0E, 0x11, 0x11, 0x11, 0x11, 0x11, 0x0E],
    [0x1E, 0x11, 0x11, 0x1E, 0x14, 0x12, 0x11],
    [0x0F, 0x10, 0x10, 0x0E, 0x01, 0x01, 0x1E],
    [0x1F, 0x04, 0x04, 0x04, 0x04, 0x04, 0x04],
    [0x11, 0x11, 0x0A, 0x04, 0x0A, 0x11, 0x11],
];

/// Lines of letters whose dots are 4, 3, 2 and 1 pixels large, from top to bottom and again, dark on light paper.
pub(super) fn page(canvas: &mut Texture, rng: &mut Xoshiro256PlusPlus) {
    canvas.values.fill(WHITE);
    let margin = 6;
    let mut top = margin;
    for dot in [4, 3, 2, 2, 1, 1].into_iter().cycle() {
        if top + 7 * dot + margin > canvas.height {
            break;
        }
        let mut left = margin;
        while left + 5 * dot + margin <= canvas.width {
            // One place in six stays empty, as between words.
            if rng.random_range(0..6) > 0 {
                letter(canvas, (left, top), dot, LETTERS[rng.random_range(0..LETTERS.len())]);
            }
            left += 6 * dot;
        }
        top += 9 * dot + 2;
    }
}

fn letter(canvas: &mut Texture, (left, top): (usize, usize), dot: usize, rows: [u8; 7]) {
    for (row, bits) in rows.into_iter().enumerate() {
        for column in (0..5).filter(|column| bits & (0x10 >> column) != 0) {
            for y in top + row * dot..top + (row + 1) * dot {
                let start = y * canvas.width + left + column * dot;
                canvas.values[start..start + dot].fill(BLACK);
            }
        }
    }
}
