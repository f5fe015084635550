//! Robustness by the book: every window walked, every sample on its own.
//!
//! Formulas here are a type of their own, written out as text for the library.

use brakecheck_stl::trace::{Schema, Signal, Trace};
use brakecheck_stl::{Formula, Monitor, Names, Settings, TraceEnd, Until};
use proptest::prelude::*;

/// A formula over the signals `x`, `y` and the Boolean `on`, one sample a second.
#[derive(Clone, Debug)]
pub enum Wff {
    True,
    On,
    /// `x op number`
    X(&'static str, i32),
    /// `x - 2 * y op number`
    Both(&'static str, i32),
    /// `x op y`
    Signals(&'static str),
    /// `x / y op number`: no number where both are 0.
    Ratio(&'static str, i32),
    Not(Box<Wff>),
    Gate(&'static str, Box<Wff>, Box<Wff>),
    /// always, eventually, historically, once
    Window(&'static str, Range, Box<Wff>),
    /// next, prev, s_next, s_prev, rise, fall
    Step(&'static str, Box<Wff>),
    /// until, unless, release, since
    Pair(&'static str, Range, Box<Wff>, Box<Wff>),
}

/// Bounds in samples.
#[derive(Clone, Copy, Debug)]
pub struct Range {
    pub from: usize,
    pub to: Option<usize>,
}

fn op() -> impl Strategy<Value = &'static str> {
    prop::sample::select(vec!["<", "<=", ">", ">=", "==", "!="])
}

/// Formulas in which every comparison always has a value.
pub fn wff() -> impl Strategy<Value = Wff> {
    over(prop_oneof![
        1 => Just(Wff::True),
        2 => Just(Wff::On),
        4 => (op(), -3..4i32).prop_map(|(op, c)| Wff::X(op, c)),
        3 => (op(), -3..4i32).prop_map(|(op, c)| Wff::Both(op, c)),
        2 => op().prop_map(Wff::Signals),
    ])
}

/// Formulas with comparisons that can be undefined.
pub fn doubtful() -> impl Strategy<Value = Wff> {
    over(prop_oneof![
        1 => Just(Wff::On),
        2 => (op(), -3..4i32).prop_map(|(op, c)| Wff::X(op, c)),
        3 => (op(), -3..4i32).prop_map(|(op, c)| Wff::Ratio(op, c)),
    ])
}

/// An `always` or an `eventually` over logic of further future operators.
pub fn nested() -> impl Strategy<Value = Wff> {
    let select = |names: &[&'static str]| prop::sample::select(names.to_vec());
    let leaf = prop_oneof![
        1 => Just(Wff::On),
        3 => (op(), -3..4i32).prop_map(|(op, c)| Wff::X(op, c)),
        1 => (0..4usize, 0..4usize, op(), -3..4i32).prop_map(|(from, w, op, c)| {
            let range = Range { from, to: Some(from + w) };
            Wff::Window("once", range, Wff::X(op, c).into())
        }),
    ];
    let range = || {
        prop_oneof![
            1 => Just(Range { from: 0, to: None }),
            4 => (0..20usize).prop_map(|to| Range { from: 0, to: Some(to) }),
            2 => (0..4usize, 0..9usize).prop_map(|(from, w)| Range { from, to: Some(from + w) }),
        ]
    };
    let future = move |inner: BoxedStrategy<Wff>| {
        let boxed = inner.prop_map(Box::new).boxed();
        prop_oneof![
            3 => (select(&["always", "eventually"]), range(), boxed.clone())
                .prop_map(|(op, range, a)| Wff::Window(op, range, a)),
            1 => (select(&["until", "unless", "release"]), range(), boxed.clone(), boxed)
                .prop_map(|(op, range, a, b)| Wff::Pair(op, range, a, b)),
        ]
    };
    let inner = leaf.prop_recursive(4, 12, 2, move |inner| {
        let boxed = inner.clone().prop_map(Box::new);
        prop_oneof![
            3 => future(inner.boxed()),
            1 => boxed.clone().prop_map(Wff::Not),
            2 => (select(&["and", "or", "implies", "iff", "xor"]), boxed.clone(), boxed)
                .prop_map(|(op, a, b)| Wff::Gate(op, a, b)),
        ]
    });
    (select(&["always", "eventually"]), range(), inner)
        .prop_map(|(op, range, a)| Wff::Window(op, range, a.into()))
}

fn over(leaf: impl Strategy<Value = Wff> + 'static) -> impl Strategy<Value = Wff> {
    let range = prop_oneof![
        1 => Just(Range { from: 0, to: None }),
        1 => (0..4usize).prop_map(|from| Range { from, to: None }),
        4 => (0..6usize, 0..9usize).prop_map(|(from, w)| Range { from, to: Some(from + w) }),
        1 => (0..6usize, 0..60usize).prop_map(|(from, w)| Range { from, to: Some(from + w) }),
    ];
    leaf.prop_recursive(4, 24, 2, move |inner| {
        let boxed = inner.clone().prop_map(Box::new);
        let select = |names: &[&'static str]| prop::sample::select(names.to_vec());
        prop_oneof![
            1 => boxed.clone().prop_map(Wff::Not),
            2 => (select(&["and", "or", "implies", "iff", "xor"]), boxed.clone(), boxed.clone())
                .prop_map(|(op, a, b)| Wff::Gate(op, a, b)),
            4 => (select(&["always", "eventually", "historically", "once"]), range.clone(), boxed.clone())
                .prop_map(|(op, range, a)| Wff::Window(op, range, a)),
            1 => (select(&["next", "prev", "s_next", "s_prev", "rise", "fall"]), boxed.clone())
                .prop_map(|(op, a)| Wff::Step(op, a)),
            3 => (select(&["until", "unless", "release", "since"]), range.clone(), boxed.clone(), boxed)
                .prop_map(|(op, range, a, b)| Wff::Pair(op, range, a, b)),
        ]
    })
}

/// As [`rows`], with zeros of both signs and more of them.
pub fn zeros() -> impl Strategy<Value = Vec<[f64; 3]>> {
    let zero = || prop::sample::select(vec![-0.0, 0.0, -0.0, 0.0, 0.25, -0.25, 1.0]);
    prop::collection::vec([zero(), zero(), zero()], 1..30)
}

/// Rows of `x`, `y` and `on`, with many ties.
pub fn rows() -> impl Strategy<Value = Vec<[f64; 3]>> {
    let row = (-16..17i32, -8..9i32, any::<bool>()).prop_map(|(x, y, on)| {
        [
            f64::from(x) / 4.0,
            f64::from(y) / 4.0,
            f64::from(u8::from(on)),
        ]
    });
    prop_oneof![
        1 => prop::collection::vec(row.clone(), 1..4),
        4 => prop::collection::vec(row, 1..40),
    ]
}

pub fn schema() -> Schema {
    let x = Signal::real("x", "m", "a number");
    let y = Signal::real("y", "m", "a number");
    let on = Signal::boolean("on", "true or false");
    Schema::new(1.0, [x, y, on]).unwrap()
}

pub fn trace(rows: &[[f64; 3]]) -> Trace {
    let mut trace = Trace::new(schema().into());
    for row in rows {
        trace.push(row).unwrap();
    }
    trace
}

pub fn settings(until: Until, end: TraceEnd) -> Settings {
    Settings {
        until,
        end,
        ..Settings::default()
    }
}

impl Wff {
    pub fn text(&self) -> String {
        match self {
            Wff::True => "true".into(),
            Wff::On => "on".into(),
            Wff::X(op, c) => format!("x {op} {c}"),
            Wff::Both(op, c) => format!("x - 2 * y {op} {c}"),
            Wff::Signals(op) => format!("x {op} y"),
            Wff::Ratio(op, c) => format!("x / y {op} {c}"),
            Wff::Not(a) => format!("not ({})", a.text()),
            Wff::Gate(op, a, b) => format!("({}) {op} ({})", a.text(), b.text()),
            Wff::Window(op, range, a) => format!("{op}{} ({})", range.text(), a.text()),
            Wff::Step(op, a) => format!("{op} ({})", a.text()),
            Wff::Pair(op, range, a, b) => {
                format!("({}) {op}{} ({})", a.text(), range.text(), b.text())
            }
        }
    }

    pub fn operands(&self) -> impl Iterator<Item = &Wff> {
        let (a, b) = match self {
            Wff::True | Wff::On | Wff::X(..) | Wff::Both(..) => (None, None),
            Wff::Signals(..) | Wff::Ratio(..) => (None, None),
            Wff::Not(a) | Wff::Window(_, _, a) | Wff::Step(_, a) => (Some(a), None),
            Wff::Gate(_, a, b) | Wff::Pair(_, _, a, b) => (Some(a), Some(b)),
        };
        a.into_iter().chain(b).map(|a| &**a)
    }

    /// The sum of all bounds.
    fn bounds(&self) -> usize {
        let own = match self {
            Wff::Window(_, range, _) | Wff::Pair(_, range, ..) => range.to.unwrap_or(range.from),
            Wff::Step(..) => 1,
            _ => 0,
        };
        own + self.operands().map(Wff::bounds).sum::<usize>()
    }

    pub fn formula(&self) -> Formula {
        self.text().parse().unwrap()
    }

    pub fn monitor(&self, settings: &Settings) -> Monitor {
        self.formula()
            .bind_with(&schema(), &Names::default(), settings)
            .unwrap()
    }
}

impl Range {
    fn text(self) -> String {
        match self {
            Range { from: 0, to: None } => String::new(),
            Range { from, to: None } => format!("[{from}, end]"),
            Range { from, to: Some(to) } => format!("[{from}:{to}]"),
        }
    }
}

/// Lower and upper bound.
pub type Pair = (f64, f64);

const ANY: Pair = (f64::NEG_INFINITY, f64::INFINITY);

/// How many samples there are for windows with and without a second bound.
#[derive(Clone, Copy, Debug)]
pub struct Lengths {
    pub bounded: usize,
    pub unbounded: usize,
    pub closed: bool,
}

impl Lengths {
    fn of(self, range: Range) -> usize {
        if range.to.is_some() {
            self.bounded
        } else {
            self.unbounded
        }
    }
}

fn not(a: Pair) -> Pair {
    (-a.1, -a.0)
}

fn and(a: Pair, b: Pair) -> Pair {
    (a.0.min(b.0), a.1.min(b.1))
}

fn or(a: Pair, b: Pair) -> Pair {
    (a.0.max(b.0), a.1.max(b.1))
}

const TOP: Pair = (f64::INFINITY, f64::INFINITY);

fn all(values: impl Iterator<Item = Pair>) -> Pair {
    values.fold(TOP, and)
}

fn any_of(values: impl Iterator<Item = Pair>) -> Pair {
    values.fold(not(TOP), or)
}

/// The bounds at every known sample; what is not known is in [−inf, inf].
pub fn naive(wff: &Wff, rows: &[[f64; 3]], lengths: Lengths) -> Vec<Pair> {
    let operands: Vec<_> = wff.operands().map(|a| naive(a, rows, lengths)).collect();
    operator(wff, &operands, rows, lengths)
}

/// The last sample held for ever, by holding it for long.
pub fn naive_held(wff: &Wff, rows: &[[f64; 3]], closed: bool) -> f64 {
    // Everything has come to rest after the sum of all bounds; every window
    // that begins until then is full within twice as much.
    let rest = rows.len() + wff.bounds() + 1;
    let mut long = rows.to_vec();
    long.resize(2 * rest, rows[rows.len() - 1]);
    let lengths = Lengths {
        bounded: long.len(),
        unbounded: long.len(),
        closed,
    };
    held(wff, &long, lengths, rest)[0].0
}

fn held(wff: &Wff, long: &[[f64; 3]], lengths: Lengths, rest: usize) -> Vec<Pair> {
    let operands: Vec<_> = wff
        .operands()
        .map(|a| held(a, long, lengths, rest))
        .collect();
    let mut values = operator(wff, &operands, long, lengths);
    let last = values[rest];
    values[rest..].fill(last);
    values
}

/// One operator, from the bounds of its operands.
fn operator(wff: &Wff, operands: &[Vec<Pair>], rows: &[[f64; 3]], lengths: Lengths) -> Vec<Pair> {
    let known = rows.len();
    let each = |f: &dyn Fn(usize) -> Pair| (0..known).map(f).collect::<Vec<_>>();
    let compare = |op: &str, d: f64| {
        // Taken for anything; what is certain is then the lower bound.
        if d.is_nan() {
            return ANY;
        }
        let margin = match op {
            "<" | "<=" => -d,
            ">" | ">=" => d,
            "==" => -d.abs(),
            _ => d.abs(),
        };
        (margin, margin)
    };
    // The samples a window ahead of t holds; one stands for all unknown ones.
    let ahead = |t: usize, range: Range| {
        let end = lengths
            .of(range)
            .min(range.to.map_or(usize::MAX, |to| t + to + 1));
        let open = (known < end && t + range.from < end).then_some(known.max(t + range.from));
        (t + range.from..end.min(known)).chain(open)
    };
    let behind = |t: usize, range: Range| {
        let first = range.to.map_or(0, |to| t.saturating_sub(to));
        (first..known).take_while(move |s| s + range.from <= t)
    };
    match wff {
        Wff::True => each(&|_| TOP),
        Wff::On => each(&|t| if rows[t][2] != 0.0 { TOP } else { not(TOP) }),
        Wff::X(op, c) => each(&|t| compare(op, rows[t][0] - f64::from(*c))),
        Wff::Both(op, c) => each(&|t| compare(op, rows[t][0] - 2.0 * rows[t][1] - f64::from(*c))),
        Wff::Signals(op) => each(&|t| compare(op, rows[t][0] - rows[t][1])),
        Wff::Ratio(op, c) => each(&|t| compare(op, rows[t][0] / rows[t][1] - f64::from(*c))),
        Wff::Not(_) => each(&|t| not(operands[0][t])),
        Wff::Gate(op, ..) => {
            let (a, b) = (&operands[0], &operands[1]);
            each(&|t| match *op {
                "and" => and(a[t], b[t]),
                "or" => or(a[t], b[t]),
                "implies" => or(not(a[t]), b[t]),
                "iff" => and(or(not(a[t]), b[t]), or(not(b[t]), a[t])),
                _ => and(or(a[t], b[t]), or(not(a[t]), not(b[t]))),
            })
        }
        Wff::Window(op, range, _) => {
            let at = |t: usize| operands[0].get(t).copied().unwrap_or(ANY);
            each(&|t| match *op {
                "always" => all(ahead(t, *range).map(at)),
                "eventually" => any_of(ahead(t, *range).map(at)),
                "historically" => all(behind(t, *range).map(at)),
                _ => any_of(behind(t, *range).map(at)),
            })
        }
        Wff::Step(op, _) => {
            let one = Range {
                from: 1,
                to: Some(1),
            };
            let at = |t: usize| operands[0].get(t).copied().unwrap_or(ANY);
            let before = |t: usize| all(behind(t, one).map(|s| not(at(s))));
            let before_not = |t: usize| all(behind(t, one).map(at));
            each(&|t| match *op {
                "next" => all(ahead(t, one).map(at)),
                "s_next" => any_of(ahead(t, one).map(at)),
                "prev" => all(behind(t, one).map(at)),
                "s_prev" => any_of(behind(t, one).map(at)),
                "rise" => and(at(t), before(t)),
                _ => and(not(at(t)), before_not(t)),
            })
        }
        Wff::Pair(op, range, ..) => {
            let guard = |t: usize| operands[0].get(t).copied().unwrap_or(ANY);
            let goal = |t: usize| operands[1].get(t).copied().unwrap_or(ANY);
            let flip = |pair: Pair| if *op == "release" { not(pair) } else { pair };
            let until = |t: usize| {
                any_of(ahead(t, *range).map(|s| {
                    let end = if lengths.closed { s + 1 } else { s };
                    and(flip(goal(s)), all((t..end).map(|r| flip(guard(r)))))
                }))
            };
            each(&|t| match *op {
                "until" => until(t),
                "release" => not(until(t)),
                "unless" => or(
                    until(t),
                    all(ahead(t, Range { from: 0, ..*range }).map(guard)),
                ),
                _ => any_of(behind(t, *range).map(|s| {
                    let start = if lengths.closed { s } else { s + 1 };
                    and(goal(s), all((start..=t).map(guard)))
                })),
            })
        }
    }
}
