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

/// Duration in seconds of the pause before the next period.
const HOLD_S: f64 = 2.0;

/// Rules and keyframes of a picture, collected while it is drawn.
pub(super) struct Keyframes {
    pub period: Period,
    rules: String,
    count: usize,
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
        let total_s = n(period.total_s(), 3);
        let rules = format!(
            ".a,.s,.w{{animation:{total_s}s linear infinite}}\
             .s,.w{{animation-timing-function:step-end}}\
             @media (prefers-reduced-motion:reduce){{.a,.s,.w{{animation:none!important}}}}"
        );
        Keyframes {
            period,
            rules,
            count: 0,
        }
    }

    /// Returns the style sheet.
    pub(super) fn into_css(self) -> String {
        self.rules
    }

    /// Adds a `transform` that changes linearly between values.
    ///
    /// Returns the CSS class of the moving element.
    pub(super) fn moving(&mut self, values: &[(f64, String)]) -> String {
        let values = values
            .iter()
            .map(|(at, it)| (*at, format!("transform:{it}")));
        format!("a {}", self.animation(values))
    }

    /// Adds a visibility: visible from each `true` to the next `false`.
    ///
    /// Returns the CSS class of the element.
    pub(super) fn seen(&mut self, turns: &[(f64, bool)]) -> String {
        let values = turns.iter().map(|(at, seen)| {
            let seen = if *seen { "visible" } else { "hidden" };
            (*at, format!("visibility:{seen}"))
        });
        format!("s {}", self.animation(values))
    }

    /// Adds keyframes without repeated values, and returns their class.
    fn animation(&mut self, values: impl Iterator<Item = (f64, String)>) -> String {
        let values: Vec<(f64, String)> = values.collect();
        let name = format!("k{}", self.count);
        self.count += 1;
        let is_needed = |i: usize| {
            let same = |other: Option<&(f64, String)>| other.is_some_and(|it| it.1 == values[i].1);
            // A value between two equal values is interpolated anyway.
            !(i > 0 && same(values.get(i - 1)) && same(values.get(i + 1)))
        };
        let mut frames = String::new();
        for (i, (time_s, value)) in values.iter().enumerate() {
            if is_needed(i) {
                frames += &format!("{}%{{{value}}}", self.period.percent(*time_s));
            }
        }
        // The last value holds through the pause.
        if let Some((_, last)) = values.last() {
            frames += &format!("100%{{{last}}}");
        }
        self.rules += &format!("@keyframes {name}{{{frames}}}.{name}{{animation-name:{name}}}");
        name
    }
}
