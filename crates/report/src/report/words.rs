//! Words in a picture, placed clear of curves and of each other.

use super::canvas::{BOTTOM, HEIGHT, LEFT, RIGHT, TOP, WIDTH};

/// Width of a letter and height of a line on the canvas.
const LETTER: f64 = 5.3;
const LINE: f64 = 11.0;
/// Number of positions along a line that are tried.
const TRIED: usize = 12;
/// Distance of the samples of a curve.
const STEP: f64 = 2.0;

/// Word with its left end on the base line.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PlacedWord {
    pub word: String,
    pub x: f64,
    pub y: f64,
    pub class: &'static str,
}

/// Obstacles for words: points of curves, and placed words.
#[derive(Default)]
pub(super) struct Words {
    points: Vec<(f64, f64)>,
    pub placed: Vec<PlacedWord>,
}

impl Words {
    /// Adds a curve on the canvas as an obstacle.
    pub(super) fn avoid(&mut self, curve: &[(f64, f64)]) {
        self.points.extend(curve.first());
        for pair in curve.windows(2) {
            let ((x0, y0), (x1, y1)) = (pair[0], pair[1]);
            // Sampled densely enough that no word fits between two points.
            let steps = (libm::hypot(x1 - x0, y1 - y0) / STEP).ceil().max(1.0);
            let shares = (1..=steps as usize).map(|i| i as f64 / steps);
            self.points
                .extend(shares.map(|s| (x0 + s * (x1 - x0), y0 + s * (y1 - y0))));
        }
    }

    /// Places a word beside a vertical line, as high as possible.
    pub(super) fn beside(&mut self, x: f64, word: &str) {
        let width = width(word);
        let rows = ((HEIGHT - BOTTOM - TOP) / LINE) as usize;
        let places = (0..rows).flat_map(|row| {
            let y = TOP + 10.0 + LINE * row as f64;
            [(x - 3.0 - width, y), (x + 4.0, y)]
        });
        self.put(word, places, "word");
    }

    /// Places a word along a horizontal line, above or below it.
    pub(super) fn along(&mut self, y: f64, word: &str) {
        let room = WIDTH - RIGHT - 4.0 - width(word) - LEFT - 4.0;
        let places = (0..=TRIED).flat_map(|nth| {
            let x = LEFT + 4.0 + room.max(0.0) * nth as f64 / TRIED as f64;
            [(x, y - 5.0), (x, y + LINE)]
        });
        self.put(word, places, "word");
    }

    /// Places a word in a rectangle (left, top, right, bottom), or close to it.
    pub(super) fn within(&mut self, [left, top, right, bottom]: [f64; 4], word: &str) {
        let width = width(word);
        let rows = ((bottom - top) / LINE).floor().max(0.0) as usize;
        let inside = (1..=rows)
            .flat_map(|row| {
                let y = top + LINE * row as f64;
                [(right - 4.0 - width, y), (left + 4.0, y)]
            })
            .filter(|(x, _)| left < *x && width < right - left);
        let outside = [
            (right - width, top - 4.0),
            (right - width, bottom + LINE),
            (left - width - 4.0, 0.5 * (top + bottom)),
        ];
        self.put(word, inside.chain(outside), "word bad");
    }

    /// Places a word at the first free position, or at the position that covers
    /// the least.
    fn put(&mut self, word: &str, places: impl Iterator<Item = (f64, f64)>, class: &'static str) {
        let width = width(word);
        let on_canvas = |(x, y): &(f64, f64)| {
            *x >= 2.0 && x + width <= WIDTH - 2.0 && y - 7.0 >= TOP && *y <= HEIGHT - BOTTOM - 2.0
        };
        let costs = places
            .filter(on_canvas)
            .map(|(x, y)| (self.in_the_way(x, y, width), (x, y)));
        // The strict comparison keeps the first of equal positions, so the
        // layout is stable.
        let best = costs.reduce(|a, b| if b.0 < a.0 { b } else { a });
        // A word that fits nowhere on the canvas is left out.
        if let Some((_, (x, y))) = best {
            self.placed.push(PlacedWord {
                word: word.to_owned(),
                x,
                y,
                class,
            });
        }
    }

    /// Cost of a word at a position.
    fn in_the_way(&self, x: f64, y: f64, w: f64) -> usize {
        let on = |&&(px, py): &&(f64, f64)| {
            x - 2.0 <= px && px <= x + w + 2.0 && y - 10.0 <= py && py <= y + 4.0
        };
        let covers = |other: &&PlacedWord| {
            let apart = y - other.y;
            x < other.x + width(&other.word) && other.x < x + w && apart.abs() < LINE
        };
        let words = self.placed.iter().filter(covers).count();
        // Words over words are unreadable, so they count far more than curves.
        self.points.iter().filter(on).count() + 1000 * words
    }
}

/// Width of a word, rather over- than underestimated.
fn width(word: &str) -> f64 {
    LETTER * word.chars().count() as f64
}

/// Breaks a text into lines of at most so many letters.
pub(super) fn wrapped(text: &str, letters: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            // One letter fewer than the limit, for the space before the word.
            Some(line) if line.chars().count() + word.chars().count() < letters => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn covered(words: &Words) -> usize {
        let placed = words.placed.iter();
        let alone = |it: &PlacedWord| {
            let others = Words {
                points: words.points.clone(),
                placed: Vec::new(),
            };
            others.in_the_way(it.x, it.y, width(&it.word))
        };
        placed.map(alone).sum()
    }

    #[test]
    fn words_keep_clear_of_curves_and_of_each_other() {
        let mut words = Words::default();
        // The curve crosses the upper left corner, where the first positions
        // are.
        words.avoid(&[
            (LEFT, TOP + 5.0),
            (250.0, TOP + 8.0),
            (WIDTH - RIGHT, 180.0),
        ]);
        words.beside(300.0, "ψ_ego violated");
        words.beside(310.0, "contact, 4.2 m/s");
        words.along(TOP + 12.0, "bound of ψ_ego, 4.70");
        assert_eq!(words.placed.len(), 3);
        assert_eq!(covered(&words), 0, "{:?}", words.placed);
        let rows: Vec<f64> = words.placed.iter().map(|it| it.y).collect();
        assert!((rows[0] - rows[1]).abs() >= LINE || words.placed[1].x != words.placed[0].x);
    }
}
