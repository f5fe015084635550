//! CSS animations of one period: what plays in a picture without a script.
//!
//! CSS rather than SMIL, since a reader who wants no motion then gets none.

use crate::report::animation::write::n;

/// Time that passes in the picture, and how long the end then stands.
#[derive(Clone, Copy)]
pub(super) struct Period {
    /// The episode's time when the picture begins.
    pub from_s: f64,
    /// When the motion ends.
    pub until_s: f64,
}

/// How long the end stands before all begins anew.
const HOLD_S: f64 = 2.0;

/// The rules and keyframes of a picture, collected while it is drawn.
pub(super) struct Keyframes {
    pub period: Period,
    rules: String,
    count: usize,
}

impl Period {
    /// The length of a period.
    pub fn total_s(&self) -> f64 {
        self.until_s - self.from_s + HOLD_S
    }

    /// The share of the period at a time of the episode, in percent.
    fn percent(&self, time_s: f64) -> String {
        n(100.0 * (time_s - self.from_s) / self.total_s(), 2)
    }
}

impl Keyframes {
    /// None yet.
    pub fn new(period: Period) -> Keyframes {
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

    /// The style sheet.
    pub fn into_css(self) -> String {
        self.rules
    }

    /// A `transform` that goes from value to value in straight lines; the class
    /// of what moves so.
    pub fn moving(&mut self, values: &[(f64, String)]) -> String {
        let values = values
            .iter()
            .map(|(at, it)| (*at, format!("transform:{it}")));
        format!("a {}", self.animation(values))
    }

    /// Something that is seen at some times only, from each `true` to the next
    /// `false`; the class of it.
    pub fn seen(&mut self, turns: &[(f64, bool)]) -> String {
        let values = turns.iter().map(|(at, seen)| {
            let seen = if *seen { "visible" } else { "hidden" };
            (*at, format!("visibility:{seen}"))
        });
        format!("s {}", self.animation(values))
    }

    /// Keyframes with equal values in a row left out; the class that has them.
    fn animation(&mut self, values: impl Iterator<Item = (f64, String)>) -> String {
        let values: Vec<(f64, String)> = values.collect();
        let name = format!("k{}", self.count);
        self.count += 1;
        let is_told = |i: usize| {
            let same = |other: Option<&(f64, String)>| other.is_some_and(|it| it.1 == values[i].1);
            !(0 < i && same(values.get(i - 1)) && same(values.get(i + 1)))
        };
        let mut frames = String::new();
        for (i, (time_s, value)) in values.iter().enumerate() {
            if is_told(i) {
                frames += &format!("{}%{{{value}}}", self.period.percent(*time_s));
            }
        }
        if let Some((_, last)) = values.last() {
            frames += &format!("100%{{{last}}}");
        }
        self.rules += &format!("@keyframes {name}{{{frames}}}.{name}{{animation-name:{name}}}");
        name
    }
}
