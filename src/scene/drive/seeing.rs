//! What ados see unless a world says otherwise, and of what they see nothing.

use super::script::Script;
use super::signals::{Declared, Of, Source, declared};
use super::spec::{Drive, DriveSpec};

impl DriveSpec {
    /// The observation of ados whose world names none: where everybody is from
    /// the ego, obstacles included, how fast all are, what the ego's acceleration
    /// is, the lights with their time, and the time left. Sideways, where there
    /// is a sideways.
    pub fn usual_observation(&self) -> Vec<String> {
        let Some(ego) = self.egos().next() else {
            return Vec::new();
        };
        let name = |i: usize| self.agents[i].name.as_str();
        let sideways = |i: usize| {
            let agent = &self.agents[i];
            let aside = agent.road != 0 || agent.facing_rad != 0.0;
            1 < self.road.lanes() || agent.body.is_on_foot() || aside
        };
        let mut seen = Vec::new();
        let stands = |i: usize| matches!(self.agents[i].drive, Drive::Scripted(Script::Stand));
        let others = (0..self.agents.len()).filter(|&i| i != ego && !stands(i));
        let others: Vec<usize> = others.collect();
        for &other in &others {
            let pair = format!("{}.{}", name(ego), name(other));
            seen.push(format!("{pair}.headway"));
            if sideways(other) {
                seen.push(format!("{pair}.lateral"));
                seen.push(format!("{}.lateral_speed", name(other)));
            }
        }
        // What stands tells where on the road that is.
        for stander in (0..self.agents.len()).filter(|&i| stands(i)) {
            seen.push(format!("{}.{}.headway", name(ego), name(stander)));
        }
        seen.push(format!("{}.speed", name(ego)));
        seen.push(format!("{}.accel", name(ego)));
        for &other in &others {
            seen.push(format!("{}.speed", name(other)));
            if matches!(&self.agents[other].drive, Drive::Ado { lag_s, .. } if 0.0 < *lag_s) {
                seen.push(format!("{}.accel", name(other)));
            }
        }
        for light in &self.lights {
            seen.push(format!("{}.phase", light.name));
            seen.push(format!("{}.phase_time", light.name));
            seen.push(format!("{}.{}.line", name(ego), light.name));
        }
        seen.push("time_left".to_owned());
        seen
    }

    /// Of the signals that are read, those of which the ados see nothing: neither
    /// the signal nor another one of the same agents.
    ///
    /// What stays the same whatever the ados do is not asked for.
    pub fn unseen<'a>(&self, read: &'a [String]) -> Vec<&'a str> {
        let all = declared(&self.names());
        let observed = self.observe.iter();
        let observed = observed.flat_map(|observed| self.sources(&all, &observed.name));
        let seen: Vec<Source> = observed.collect();
        let hidden = |name: &&'a String| {
            let sources = self.sources(&all, name);
            let mut sources = sources.iter();
            sources.any(|source| !source.is_untouched(self) && !self.is_told_by(&seen, *source))
        };
        read.iter().filter(hidden).map(String::as_str).collect()
    }

    /// The published signals that a name stands for: itself, or what it is
    /// derived from.
    fn sources(&self, all: &[Declared], name: &str) -> Vec<Source> {
        if let Some(declared) = all.iter().find(|declared| declared.signal.name == name) {
            return vec![declared.source];
        }
        let mut derived = self.derived.iter();
        let derived = derived.find(|derived| derived.signal.name == name);
        let parts = derived.map(|derived| derived.expr.signals());
        let parts = parts.into_iter().flatten();
        parts.flat_map(|part| self.sources(all, part)).collect()
    }

    fn is_told_by(&self, seen: &[Source], wanted: Source) -> bool {
        let related = |a: usize, b: usize| {
            seen.iter()
                .any(|s| s.quantity.of == Of::Pair && (s.whose == [a, b] || s.whose == [b, a]))
        };
        // Who is seen from the same third one is seen from each other.
        let by_another = |a: usize, b: usize| {
            (0..self.agents.len()).any(|third| related(third, a) && related(third, b))
        };
        let pair = |[a, b]: [usize; 2]| {
            related(a, b) || by_another(a, b) || (is_placed(seen, a) && is_placed(seen, b))
        };
        let [a, b] = wanted.whose;
        match wanted.quantity.of {
            Of::Clock | Of::Parameter => true,
            Of::Scene => {
                let ego = self.egos().next().unwrap_or(0);
                (0..self.agents.len()).any(|other| other != ego && pair([ego, other]))
            }
            Of::Pair => pair([a, b]),
            Of::Agent => seen.iter().any(|s| match s.quantity.of {
                Of::Agent => s.whose[0] == a && (places(*s) || !places(wanted)),
                Of::Pair => s.whose.contains(&a),
                _ => false,
            }),
            Of::Light => seen
                .iter()
                .any(|s| s.quantity.of == Of::Light && s.whose[0] == a),
            Of::AgentAndLight => {
                let line = |s: &Source| s.quantity.of == Of::AgentAndLight && s.whose == [a, b];
                seen.iter().any(line) || is_placed(seen, a)
            }
        }
    }
}

/// Whether an agent's place on the road is seen.
fn is_placed(seen: &[Source], agent: usize) -> bool {
    let mut seen = seen.iter();
    seen.any(|s| s.quantity.of == Of::Agent && s.whose[0] == agent && places(*s))
}

/// Whether an agent's signal says where it is.
fn places(source: Source) -> bool {
    matches!(source.quantity.name, "x" | "y" | "s" | "lateral" | "lane")
}
