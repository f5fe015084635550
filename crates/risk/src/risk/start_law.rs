//! Law of the starts: from uniform numbers to a start, and back.

use crate::ron_file::{Ordered, Problems, ValuePath};
use crate::scene::{Axis, Start};
use crate::stats::{normal_cdf, normal_quantile};
use crate::stl::{BoundExpr, Constants, Expr};
use crate::trace::{Schema, Signal};
use crate::world::{Scenario, StartLawFile};

/// Law of the starts of a world.
///
/// A start is made of as many uniform numbers as X_init has axes. A start outside X_init
/// has probability 0: risks refer to starts inside.
#[derive(Clone, Debug)]
pub(super) struct StartLaw {
    axes: Vec<Axis>,
    /// Axes in the order of their draws.
    order: Vec<AxisLaw>,
    /// The starts of a finite world, which are equally likely.
    points: Vec<Start>,
    world: Scenario,
}

/// Law of one axis.
#[derive(Clone, Debug)]
struct AxisLaw {
    axis: usize,
    shape: Shape,
    times: Option<BoundExpr>,
    plus: Option<BoundExpr>,
}

/// Distribution of a draw.
#[derive(Clone, Debug)]
enum Shape {
    Uniform(f64, f64),
    /// Edges, and the distribution function at each of them.
    Histogram(Vec<f64>, Vec<f64>),
    /// Mean, standard deviation, and the distribution function at both ends.
    Normal(f64, f64, [f64; 2]),
    /// As `Normal`, of the logarithm.
    LogNormal(f64, f64, [f64; 2]),
}

impl Shape {
    fn of(file: &StartLawFile) -> Result<Shape, String> {
        let ends = |mean: f64, sd: f64, lo: f64, hi: f64| {
            let ends = [lo, hi].map(|end| normal_cdf((end - mean) / sd));
            // Far in a tail, both ends round to one probability, and nothing could be drawn.
            let fits = lo < hi && sd > 0.0 && ends[0] < ends[1];
            fits.then_some(ends)
                .ok_or("`within` has no probability, or the spread is not above 0")
        };
        Ok(match file {
            StartLawFile::Uniform { within, .. } if within.0 < within.1 => {
                Shape::Uniform(within.0, within.1)
            }
            StartLawFile::Uniform { .. } => return Err("`within` is empty".to_owned()),
            StartLawFile::Histogram { edges, weights, .. } => {
                let sum: f64 = weights.iter().sum();
                // Equal edges would be a bin without a width, whose density is infinite.
                let rises = edges.windows(2).all(|pair| pair[0] < pair[1]);
                let fits = edges.len() == weights.len() + 1 && rises;
                if !fits || weights.iter().any(|it| *it < 0.0) || sum <= 0.0 {
                    let what = "a histogram has rising edges, one more than weights from 0 on";
                    return Err(what.to_owned());
                }
                let mut cumulated = vec![0.0];
                for weight in weights {
                    cumulated.push(cumulated[cumulated.len() - 1] + weight / sum);
                }
                Shape::Histogram(edges.clone(), cumulated)
            }
            StartLawFile::Normal {
                mean, sd, within, ..
            } => Shape::Normal(*mean, *sd, ends(*mean, *sd, within.0, within.1)?),
            StartLawFile::LogNormal {
                median,
                sigma,
                within: (lo, hi),
                ..
            } => {
                if *median <= 0.0 || *lo <= 0.0 {
                    return Err("a lognormal law has values above 0 only".to_owned());
                }
                let mean = libm::log(*median);
                let ends = ends(mean, *sigma, libm::log(*lo), libm::log(*hi))?;
                Shape::LogNormal(mean, *sigma, ends)
            }
        })
    }

    /// Returns the value at a share of the probability.
    fn quantile(&self, share: f64) -> f64 {
        let normal = |mean: f64, sd: f64, [lo, hi]: [f64; 2]| {
            // The share is of the law within its ends, whose
            // probabilities are `lo` and `hi`.
            mean + sd * normal_quantile(lo + share * (hi - lo))
        };
        match self {
            Shape::Uniform(lo, hi) => lo + share * (hi - lo),
            Shape::Histogram(edges, cumulated) => {
                let bins = edges.len() - 1;
                // A share on an edge belongs to the bin above, and 1 to the last bin.
                let above = cumulated.partition_point(|it| *it <= share);
                let bin = above.clamp(1, bins) - 1;
                let width = cumulated[bin + 1] - cumulated[bin];
                let part = if width > 0.0 {
                    (share - cumulated[bin]) / width
                } else {
                    0.0
                };
                edges[bin] + part * (edges[bin + 1] - edges[bin])
            }
            Shape::Normal(mean, sd, ends) => normal(*mean, *sd, *ends),
            Shape::LogNormal(mean, sd, ends) => libm::exp(normal(*mean, *sd, *ends)),
        }
    }

    /// Returns the share of probability below a value. `None`: its density is 0.
    fn share(&self, value: f64) -> Option<f64> {
        let normal = |z: f64, [lo, hi]: [f64; 2]| (normal_cdf(z) - lo) / (hi - lo);
        let share = match self {
            Shape::Uniform(lo, hi) => (value - lo) / (hi - lo),
            Shape::Histogram(edges, cumulated) => {
                let above = edges.partition_point(|it| *it <= value);
                // As in a draw, the last edge belongs to the bin below.
                let is_end = edges.last() == Some(&value);
                let bin = above.checked_sub(1 + usize::from(is_end))?;
                let (lo, hi) = (*edges.get(bin)?, *edges.get(bin + 1)?);
                let width = cumulated[bin + 1] - cumulated[bin];
                // A bin without weight has density 0, although its edges have a share.
                if width <= 0.0 {
                    return None;
                }
                // The sum of the weights may be above 1 by rounding.
                (cumulated[bin] + width * (value - lo) / (hi - lo)).min(1.0)
            }
            Shape::Normal(mean, sd, ends) => normal((value - mean) / sd, *ends),
            Shape::LogNormal(mean, sd, ends) => {
                if value <= 0.0 {
                    return None;
                }
                normal((libm::log(value) - mean) / sd, *ends)
            }
        };
        (0.0..=1.0).contains(&share).then_some(share)
    }
}

impl StartLaw {
    /// Binds the laws of a file. Axes without a law are uniform, as in the world.
    pub(super) fn bind(
        world: &Scenario,
        top: &ValuePath,
        file: &Ordered<StartLawFile>,
        problems: &mut Problems<'_>,
    ) -> StartLaw {
        let (axes, place) = (world.axes(), top.to("starts"));
        let points = world.starts().unwrap_or_default();
        let mut binder = AxisBinder {
            axes: &axes,
            constants: &world.names().constants,
            known: vec![false; axes.len()],
            problems,
        };
        if let (Some((name, _)), false) = (file.0.first(), points.is_empty()) {
            let what = "the world has a table of starts, which are equally likely";
            let help = "leave `starts` out".to_owned();
            let place = place.to(name);
            binder
                .problems
                .add(&place, what, "not applicable", Some(help));
        }
        let is_declared = |axis: &Axis| file.0.contains_key(&axis.name);
        // Uniform axes come first, so that any declared law may refer to them.
        let mut order = Vec::new();
        for (at, axis) in axes.iter().enumerate().filter(|(_, it)| !is_declared(it)) {
            binder.known[at] = true;
            order.push(AxisLaw {
                axis: at,
                shape: Shape::Uniform(axis.lo, axis.hi),
                times: None,
                plus: None,
            });
        }
        for (name, law) in &file.0 {
            order.extend(binder.axis_law(&place.to(name), name, law));
        }
        StartLaw {
            axes,
            order,
            points,
            world: world.clone(),
        }
    }

    /// Returns the number of uniform numbers behind a start.
    pub(super) fn dimensions(&self) -> usize {
        if self.points.is_empty() {
            self.axes.len()
        } else {
            1
        }
    }

    /// Returns the start of uniform numbers. `None`: it is outside X_init.
    pub(super) fn start(&self, shares: &[f64]) -> Option<Start> {
        if !self.points.is_empty() {
            // Rounding may reach the number of points.
            let at = (shares[0] * self.points.len() as f64) as usize;
            return self.points.get(at.min(self.points.len() - 1)).cloned();
        }
        let mut values = vec![0.0; self.axes.len()];
        for law in &self.order {
            let (times, plus) = law.relation(&values);
            let value = plus + times * law.shape.quantile(shares[law.axis]);
            let axis = &self.axes[law.axis];
            // A relation may lead beyond a range of the world.
            if !(axis.lo..=axis.hi).contains(&value) {
                return None;
            }
            values[law.axis] = value;
        }
        let start = Start(values);
        self.admits(&start).then_some(start)
    }

    /// Returns the uniform numbers of a start. `None`: its probability is 0.
    pub(super) fn shares(&self, start: &Start) -> Option<Vec<f64>> {
        if !self.points.is_empty() {
            // Any number of a point's interval would do, and its middle is safe from
            // rounding.
            let at = self.points.iter().position(|point| point == start)?;
            return Some(vec![(at as f64 + 0.5) / self.points.len() as f64]);
        }
        let mut shares = vec![0.0; self.axes.len()];
        for law in &self.order {
            let (times, plus) = law.relation(&start.0);
            // A factor of 0 gives no finite draw, which has no share either.
            let draw = (start.0[law.axis] - plus) / times;
            shares[law.axis] = law.shape.share(draw)?;
        }
        self.admits(start).then_some(shares)
    }

    fn admits(&self, start: &Start) -> bool {
        let spec = self.world.drive().map(|driving| driving.spec());
        spec.is_none_or(|spec| spec.admits(start).is_ok())
    }
}

impl AxisLaw {
    fn relation(&self, values: &[f64]) -> (f64, f64) {
        let value = |expr: &Option<BoundExpr>, without: f64| {
            expr.as_ref().map_or(without, |expr| expr.eval(values))
        };
        (value(&self.times, 1.0), value(&self.plus, 0.0))
    }
}

/// Binds laws, axis by axis.
struct AxisBinder<'a, 'b> {
    axes: &'a [Axis],
    constants: &'a Constants,
    /// Axes that are drawn before the next one.
    known: Vec<bool>,
    problems: &'a mut Problems<'b>,
}

impl AxisBinder<'_, '_> {
    fn axis_law(&mut self, place: &ValuePath, name: &str, law: &StartLawFile) -> Option<AxisLaw> {
        let Some(axis) = self.axes.iter().position(|axis| axis.name == name) else {
            let names: Vec<&str> = self.axes.iter().map(|axis| axis.name.as_str()).collect();
            let help = format!("the axes of the starts are {}", names.join(", "));
            let what = format!("unknown axis `{name}`");
            self.problems.add(place, what, "not an axis", Some(help));
            return None;
        };
        let shape = match Shape::of(law) {
            Ok(shape) => shape,
            Err(what) => {
                self.problems.add(place, what, "not a distribution", None);
                return None;
            }
        };
        let [times, plus] = law
            .relation()
            .map(|(field, text)| self.expression(&place.to(field), text.as_deref()));
        // Set after the axis's own expressions, which must not refer to it.
        self.known[axis] = true;
        Some(AxisLaw {
            axis,
            shape,
            times,
            plus,
        })
    }

    /// Binds an expression of axes that are drawn before.
    fn expression(&mut self, place: &ValuePath, text: Option<&str>) -> Option<BoundExpr> {
        let signals = self
            .axes
            .iter()
            .zip(&self.known)
            .filter(|(_, known)| **known);
        let known: Vec<String> = signals.map(|(axis, _)| axis.name.clone()).collect();
        // All axes are in the schema, because positions are those in a start.
        let all = self
            .axes
            .iter()
            .map(|axis| Signal::real(&axis.name, "", ""));
        let schema = Schema::new(1.0, all).ok()?;
        let expr: Expr = match text?.parse() {
            Ok(expr) => expr,
            Err(error) => {
                self.problems.stl(place, &error);
                return None;
            }
        };
        let axes = self.axes.iter().map(|axis| axis.name.as_str());
        let later = axes.filter(|axis| !known.iter().any(|name| name == axis));
        let read = expr.signals();
        if let Some(name) = later.into_iter().find(|name| read.contains(name)) {
            let what = format!("`{name}` is drawn later");
            let help = format!("move the law of `{name}` above this one");
            self.problems.add(place, what, "not known yet", Some(help));
            return None;
        }
        match expr.bind(&schema, self.constants) {
            Ok(bound) => Some(bound),
            Err(error) => {
                self.problems.stl(place, &error);
                None
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::world;
    use super::super::{RiskTraffic, RiskTrafficError};
    use super::*;
    use crate::world::LoadError;

    fn shape(text: &str) -> Result<Shape, String> {
        Shape::of(&crate::ron_file::parse_ron(text).expect(text))
    }

    #[test]
    fn quantiles_and_shares_are_inverse_and_end_where_the_law_ends() {
        for (text, [lo, hi], middle) in [
            ("Uniform(within: (2, 6))", [2.0, 6.0], 4.0),
            (
                "Histogram(edges: [0, 1, 4], weights: [1, 3])",
                [0.0, 4.0],
                2.0,
            ),
            (
                "Histogram(edges: [0, 2, 3, 4], weights: [1, 0, 1])",
                [0.0, 4.0],
                3.0,
            ),
            ("Normal(mean: 5, sd: 2, within: (1, 9))", [1.0, 9.0], 5.0),
            (
                "LogNormal(median: 2, sigma: 0.5, within: (1, 4))",
                [1.0, 4.0],
                2.0,
            ),
        ] {
            let law = shape(text).expect(text);
            for (share, value) in [(0.0, lo), (0.5, middle), (1.0, hi)] {
                let found = law.quantile(share);
                assert!((found - value).abs() < 1e-6, "{text}, {share}: {found}");
            }
            for share in [0.01, 0.2, 0.49, 0.51, 0.9] {
                let found = law.share(law.quantile(share)).expect("inside");
                assert!((found - share).abs() < 1e-6, "{text}: {found} for {share}");
            }
            let end = law.share(hi).expect("the end is inside");
            assert!((end - 1.0).abs() < 1e-12, "{text}: {end}");
            for outside in [lo - 0.01, hi + 0.01] {
                assert_eq!(law.share(outside), None, "{text}: {outside}");
            }
        }
        // A bin without weight has no density, and only its edges have a share.
        let gap = shape("Histogram(edges: [0, 2, 3, 4], weights: [1, 0, 1])").expect("a law");
        assert_eq!((gap.share(2.5), gap.share(1.0)), (None, Some(0.25)));
        let positive = shape("LogNormal(median: 2, sigma: 0.5, within: (1, 4))").expect("a law");
        assert_eq!((positive.share(0.0), positive.share(-1.0)), (None, None));
        // 0.75 of the weight is above the edge at 1, spread over 3.
        let law = shape("Histogram(edges: [0, 1, 4], weights: [1, 3])").expect("a law");
        assert!((law.quantile(0.125) - 0.5).abs() < 1e-12);
        assert!((law.quantile(0.625) - 2.5).abs() < 1e-12);
    }

    #[test]
    fn texts_that_are_no_law_are_refused() {
        let spread = "`within` has no probability, or the spread is not above 0";
        let histogram = "a histogram has rising edges, one more than weights from 0 on";
        for (text, says) in [
            ("Uniform(within: (2, 2))", "`within` is empty"),
            ("Uniform(within: (3, 2))", "`within` is empty"),
            ("Histogram(edges: [0, 1], weights: [1, 1])", histogram),
            ("Histogram(edges: [0, 1, 1], weights: [1, 1])", histogram),
            ("Histogram(edges: [0, 2, 1], weights: [1, 1])", histogram),
            ("Histogram(edges: [0, 1, 2], weights: [1, -0.5])", histogram),
            ("Histogram(edges: [0, 1, 2], weights: [0, 0])", histogram),
            ("Normal(mean: 0, sd: 0, within: (0, 1))", spread),
            ("Normal(mean: 0, sd: 1, within: (1, 0))", spread),
            ("Normal(mean: 0, sd: 1, within: (80, 90))", spread),
            ("LogNormal(median: 2, sigma: -1, within: (1, 4))", spread),
            (
                "LogNormal(median: 0, sigma: 1, within: (1, 4))",
                "a lognormal law has values above 0 only",
            ),
            (
                "LogNormal(median: 2, sigma: 1, within: (0, 4))",
                "a lognormal law has values above 0 only",
            ),
        ] {
            assert_eq!(shape(text).err().as_deref(), Some(says), "{text}");
        }
        assert!(shape("Histogram(edges: [0, 1, 2], weights: [0, 1])").is_ok());
    }

    /// Law of both axes of `acc`, whose ego speed is relative to the ado's.
    fn traffic(starts: &str) -> Result<RiskTraffic, RiskTrafficError> {
        let text = super::super::tests::TRAFFIC.replace(
            "\"ado.headway\": Normal(mean: 35.0, sd: 2.5, within: (24.0, 46.0))",
            starts,
        );
        let world = Scenario::shipped("acc").expect("shipped").expect("sound");
        RiskTraffic::parse(&world, "t.ron", &text)
    }

    #[test]
    fn a_draw_is_scaled_and_moved_by_axes_that_are_drawn_before() {
        let law = traffic(
            "\"ado.speed\": Uniform(within: (10, 20)),
             \"ego.speed\": Uniform(within: (0, 4), plus: \"ado.speed\"),
             \"ado.headway\": Uniform(within: (1, 2), times: \"ego.speed\", plus: \"4\")",
        )
        .expect("sound")
        .starts;
        let axes: Vec<String> = law.axes.iter().map(|it| it.name.clone()).collect();
        let at = |name: &str| axes.iter().position(|it| it == name).expect("an axis");
        let mut shares = vec![0.0; law.dimensions()];
        shares[at("ado.speed")] = 0.5;
        shares[at("ego.speed")] = 0.25;
        shares[at("ado.headway")] = 0.5;
        let start = law.start(&shares).expect("inside");
        let value = |name: &str| start.0[at(name)];
        assert_eq!((value("ado.speed"), value("ego.speed")), (15.0, 16.0));
        assert_eq!(value("ado.headway"), 1.5 * 16.0 + 4.0);
        let back = law.shares(&start).expect("possible");
        let differ = back.iter().zip(&shares).map(|(a, b)| (a - b).abs());
        assert!(differ.fold(0.0, f64::max) < 1e-12, "{back:?}");
        // Beyond the world's range of 25 m/s, or beyond the law.
        let fast = traffic("\"ado.speed\": Uniform(within: (10, 40))")
            .expect("sound")
            .starts;
        let with = |share: f64| {
            let mut shares = vec![0.5; fast.dimensions()];
            shares[at("ado.speed")] = share;
            fast.start(&shares)
        };
        assert!(with(0.4).is_some() && with(0.6).is_none());
        let mut beyond = start;
        beyond.0[at("ego.speed")] = 20.0;
        assert_eq!(law.shares(&beyond), None);
    }

    #[test]
    fn laws_of_axes_refer_to_earlier_ones_only() {
        for (starts, says) in [
            (
                "\"ego.speed\": Uniform(within: (0, 4), plus: \"ado.speed\"),
                 \"ado.speed\": Uniform(within: (10, 20))",
                "`ado.speed` is drawn later",
            ),
            (
                "\"ado.speed\": Uniform(within: (10, 20), plus: \"ado.speed\")",
                "`ado.speed` is drawn later",
            ),
            ("\"speed\": Uniform(within: (0, 4))", "unknown axis `speed`"),
        ] {
            let Err(RiskTrafficError::File(LoadError::Scenario(placed))) = traffic(starts) else {
                panic!("{starts}");
            };
            let what = &placed.problems[0].what;
            assert!(what.contains(says), "{what}");
        }
    }

    #[test]
    fn a_table_of_starts_is_drawn_evenly() {
        let world = world();
        let axes = world.axes();
        let points = [25.0, 30.0, 35.0, 40.0].map(|it| Start(vec![it]));
        let law = StartLaw {
            axes,
            order: Vec::new(),
            points: points.to_vec(),
            world,
        };
        assert_eq!(law.dimensions(), 1);
        for (share, point) in [(0.0, 0), (0.24, 0), (0.25, 1), (0.99, 3), (1.0, 3)] {
            assert_eq!(
                law.start(&[share]).as_ref(),
                Some(&points[point]),
                "{share}"
            );
        }
        assert_eq!(law.shares(&points[2]), Some(vec![0.625]));
        assert_eq!(law.shares(&Start(vec![26.0])), None);
    }
}
