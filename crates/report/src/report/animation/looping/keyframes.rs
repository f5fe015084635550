//! CSS animations of one period, which play in a picture without a script.
//!
//! CSS and not SMIL, because it respects a reader's wish for reduced motion.

use crate::report::animation::write::n;

/// Time span of the picture, which is followed by a pause at the end.
#[derive(Clone, Copy)]
pub(super) struct Period {
    /// Time of the episode at which the picture begins.
    pub from_s: f64,
    /// Time of the episode at which the motion ends.
    pub until_s: f64,
}

/// Duration in seconds of the pause before a looping picture plays again.
pub const HOLD_S: f64 = 2.0;

/// Animations of a picture, collected while it is drawn.
pub(super) struct Keyframes {
    pub period: Period,
    animations: Vec<Animation>,
}

/// Values of one property over time, at least one.
struct Animation {
    /// Name of its keyframes and of its class.
    name: String,
    /// Declarations, each with its time of the episode in seconds.
    values: Vec<(f64, String)>,
    /// True if a value holds until the next one.
    is_stepped: bool,
}

impl Period {
    /// Duration of a period in seconds.
    pub(super) fn total_s(&self) -> f64 {
        self.until_s - self.from_s + HOLD_S
    }

    /// Share of the period at a time of the episode, in percent.
    fn percent(&self, time_s: f64) -> String {
        n(100.0 * (time_s - self.from_s) / self.total_s(), 2)
    }
}

impl Keyframes {
    /// Returns an empty collection.
    pub(super) fn new(period: Period) -> Keyframes {
        Keyframes {
            period,
            animations: Vec::new(),
        }
    }

    /// Returns the style sheet of a picture that plays.
    pub(super) fn css(&self) -> String {
        let total_s = n(self.period.total_s(), 3);
        let animations = self.animations.iter().map(|it| it.css(self.period));
        format!(
            ".a,.s,.w{{animation:{total_s}s linear infinite}}\
             .s,.w{{animation-timing-function:step-end}}\
             @media (prefers-reduced-motion:reduce){{.a,.s,.w{{animation:none!important}}}}{}",
            animations.collect::<String>()
        )
    }

    /// Returns the style sheet of one instant, for programs that know no animations.
    pub(super) fn css_at(&self, time_s: f64) -> String {
        let animations = self.animations.iter();
        let rules = animations.map(|it| format!(".{}{{{}}}", it.name, it.at(time_s)));
        rules.collect()
    }

    /// Adds a `transform` that changes linearly between values.
    ///
    /// Returns the CSS class of the moving element.
    pub(super) fn moving(&mut self, values: &[(f64, String)]) -> String {
        let declared = values
            .iter()
            .map(|(at, it)| (*at, format!("transform:{it}")));
        format!("a {}", self.add(declared.collect(), false))
    }

    /// Adds a visibility: visible from each `true` to the next `false`.
    ///
    /// Returns the CSS class of the element.
    pub(super) fn seen(&mut self, turns: &[(f64, bool)]) -> String {
        let values = turns.iter().map(|(at, seen)| {
            let seen = if *seen { "visible" } else { "hidden" };
            (*at, format!("visibility:{seen}"))
        });
        format!("s {}", self.add(values.collect(), true))
    }

    /// Adds an animation, and returns its class.
    fn add(&mut self, values: Vec<(f64, String)>, is_stepped: bool) -> String {
        let name = format!("k{}", self.animations.len());
        self.animations.push(Animation {
            name: name.clone(),
            values,
            is_stepped,
        });
        name
    }
}

impl Animation {
    /// Returns the keyframes without repeated values, and the rule of their class.
    fn css(&self, period: Period) -> String {
        let Animation { name, values, .. } = self;
        let is_needed = |i: usize| {
            let same = |other: Option<&(f64, String)>| other.is_some_and(|it| it.1 == values[i].1);
            // A value between two equal values is interpolated anyway.
            !(i > 0 && same(values.get(i - 1)) && same(values.get(i + 1)))
        };
        let mut frames = String::new();
        for (i, (time_s, value)) in values.iter().enumerate() {
            if is_needed(i) {
                frames += &format!("{}%{{{value}}}", period.percent(*time_s));
            }
        }
        // The last value holds through the pause.
        if let Some((_, last)) = values.last() {
            frames += &format!("100%{{{last}}}");
        }
        format!("@keyframes {name}{{{frames}}}.{name}{{animation-name:{name}}}")
    }

    /// Returns the declaration at a time, in the numbers without units of SVG.
    fn at(&self, time_s: f64) -> String {
        let next = self.values.partition_point(|(at_s, _)| *at_s <= time_s);
        // Before the first value, the first one holds.
        let (from_s, from) = &self.values[next.saturating_sub(1)];
        let declaration = match self.values.get(next) {
            // Two values of one time would divide by 0.
            Some((until_s, until)) if !self.is_stepped && from_s < until_s => between(
                from,
                until,
                ((time_s - from_s) / (until_s - from_s)).max(0.0),
            ),
            _ => from.clone(),
        };
        declaration.replace("px", "").replace("deg", "")
    }
}

/// Returns a text whose numbers lie between those of two texts with equal words.
fn between(from: &str, until: &str, share: f64) -> String {
    let is_number = |letter: &u8| letter.is_ascii_digit() || b"-.".contains(letter);
    let parts = |text: &str| -> Vec<String> {
        let bytes = text.as_bytes();
        let parts = bytes.chunk_by(|one, next| is_number(one) == is_number(next));
        parts
            .map(|part| String::from_utf8_lossy(part).into_owned())
            .collect()
    };
    let pairs = parts(from).into_iter().zip(parts(until));
    let mixed = pairs.map(
        |(from, until)| match (from.parse::<f64>(), until.parse::<f64>()) {
            // Words between the numbers are equal, because one function writes
            // both texts.
            (Ok(one), Ok(other)) => n(one + share * (other - one), 3),
            _ => from,
        },
    );
    mixed.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_instant_lies_between_two_values_and_has_no_units() {
        let mut keyframes = Keyframes::new(Period {
            from_s: 1.0,
            until_s: 3.0,
        });
        let place = |x: f64, turn: f64| format!("translate({x}px,-4px) rotate({turn}deg)");
        keyframes.moving(&[(1.0, place(-2.0, 10.0)), (3.0, place(2.0, 20.0))]);
        keyframes.seen(&[(1.0, false), (2.0, true)]);
        let at = |time_s| keyframes.css_at(time_s);
        let moved = |x: f64, turn: f64, seen: &str| {
            format!(".k0{{transform:translate({x},-4) rotate({turn})}}.k1{{visibility:{seen}}}")
        };
        assert_eq!(at(1.0), moved(-2.0, 10.0, "hidden"));
        assert_eq!(at(1.5), moved(-1.0, 12.5, "hidden"));
        assert_eq!(at(2.0), moved(0.0, 15.0, "visible"));
        // Outside of the period the first and the last values hold.
        assert_eq!(at(0.0), moved(-2.0, 10.0, "hidden"));
        assert_eq!(at(9.0), moved(2.0, 20.0, "visible"));
    }
}
