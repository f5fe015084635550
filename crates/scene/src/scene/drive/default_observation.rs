//! Default observation of ados, and signals that an observation does not cover.

use super::script::Script;
use super::signals::{DeclaredSignal, Of, SignalReading, declared};
use super::spec::{Drive, DriveSpec};

impl DriveSpec {
    /// Returns the default observation of ados, for worlds that name none.
    ///
    /// It holds the headway of every agent from the ego, obstacles included,
    /// all speeds and the ego's acceleration. It also holds the lights with
    /// their time, the changing weather, the road that an ado lays and the time left.
    /// Lateral signals are added where agents can move sideways.
    pub fn usual_observation(&self) -> Vec<String> {
        let Some(ego) = self.egos().next() else {
            return Vec::new();
        };
        let name = |i: usize| self.agents[i].name.as_str();
        let sideways = |i: usize| {
            let agent = &self.agents[i];
            let aside = agent.road != 0 || agent.facing_rad != 0.0;
            self.road.lanes() > 1 || agent.body.is_on_foot() || aside
        };
        let mut seen = Vec::new();
        let stands = |i: usize| matches!(self.agents[i].drive, Drive::Scripted(Script::Stand));
        let others: Vec<usize> = (0..self.agents.len())
            .filter(|&i| i != ego && !stands(i))
            .collect();
        for &other in &others {
            let pair = format!("{}.{}", name(ego), name(other));
            seen.push(format!("{pair}.headway"));
            if sideways(other) {
                seen.push(format!("{pair}.lateral"));
                seen.push(format!("{}.lateral_speed", name(other)));
            }
        }
        // The headway of a parked body determines the position on the road.
        for stander in (0..self.agents.len()).filter(|&i| stands(i)) {
            seen.push(format!("{}.{}.headway", name(ego), name(stander)));
        }
        seen.push(format!("{}.speed", name(ego)));
        seen.push(format!("{}.accel", name(ego)));
        for &other in &others {
            seen.push(format!("{}.speed", name(other)));
            // With a lag the acceleration is a state of its own, which no
            // speed implies.
            if matches!(&self.agents[other].drive, Drive::Ado { lag_s, .. } if 0.0 < *lag_s) {
                seen.push(format!("{}.accel", name(other)));
            }
        }
        for light in &self.lights {
            seen.push(format!("{}.phase", light.name));
            seen.push(format!("{}.phase_time", light.name));
            seen.push(format!("{}.{}.line", name(ego), light.name));
        }
        if let Some(weather) = &self.weather {
            let parts = [
                ("friction", weather.friction),
                ("visibility", weather.visibility_m),
                ("noise", weather.noise_scale),
            ];
            let changing = parts.iter().filter(|(_, bounds)| bounds.is_some());
            seen.extend(changing.map(|(part, _)| format!("{}.{part}", weather.name)));
        }
        if let Some(road) = &self.road_ado {
            let parts = ["curvature", "curvature_change", "ahead", "turned"];
            seen.extend(parts.map(|part| format!("{}.{part}", road.name)));
            seen.push(format!("{}.lateral", name(ego)));
        }
        seen.push("time_left".to_owned());
        seen
    }

    /// Returns the signals in `read` that the ados' observation does not cover.
    ///
    /// A signal is covered if it, or a different signal of the same agents, is
    /// observed. Signals that no ado can change need no coverage.
    pub fn unseen<'a>(&self, read: &'a [String]) -> Vec<&'a str> {
        let all = declared(&self.names());
        let observed = self.observe.iter();
        let sources = observed.flat_map(|observed| self.sources(&all, &observed.name));
        let seen: Vec<SignalReading> = sources.collect();
        let hidden = |name: &&'a String| {
            let sources = self.sources(&all, name);
            sources
                .iter()
                .any(|source| !source.is_untouched(self) && !self.is_implied_by(&seen, *source))
        };
        read.iter().filter(hidden).map(String::as_str).collect()
    }

    /// Returns whether a signal in `read` is one of the ego, alone or with another agent.
    ///
    /// A signal of the whole scene, such as `contact`, is one of the ego as well.
    pub fn reads_the_ego(&self, read: &[String]) -> bool {
        let all = declared(&self.names());
        let ego = self.egos().next();
        let of_ego = |source: SignalReading| {
            let [a, b] = source.whose;
            match source.quantity.of {
                Of::Scene => true,
                Of::Agent | Of::AgentAndLight => Some(a) == ego,
                Of::Pair => Some(a) == ego || Some(b) == ego,
                Of::Clock | Of::Parameter | Of::Light | Of::Weather | Of::Road => false,
            }
        };
        let mut sources = read.iter().flat_map(|name| self.sources(&all, name));
        sources.any(of_ego)
    }

    /// Returns the published signals behind a name.
    ///
    /// These are the signal itself or the inputs of a derived signal.
    fn sources(&self, all: &[DeclaredSignal], name: &str) -> Vec<SignalReading> {
        if let Some(declared) = all.iter().find(|declared| declared.signal.name == name) {
            return vec![declared.source];
        }
        let mut all_derived = self.derived.iter();
        let derived = all_derived.find(|derived| derived.signal.name == name);
        let parts = derived
            .map(|derived| derived.expr.signals())
            .into_iter()
            .flatten();
        parts.flat_map(|part| self.sources(all, part)).collect()
    }

    fn is_implied_by(&self, seen: &[SignalReading], wanted: SignalReading) -> bool {
        let related = |a: usize, b: usize| {
            seen.iter()
                .any(|s| s.quantity.of == Of::Pair && (s.whose == [a, b] || s.whose == [b, a]))
        };
        // Two agents seen from the same third agent are seen from each other.
        let by_another = |a: usize, b: usize| {
            (0..self.agents.len()).any(|third| related(third, a) && related(third, b))
        };
        let pair = |[a, b]: [usize; 2]| {
            related(a, b) || by_another(a, b) || (is_placed(seen, a) && is_placed(seen, b))
        };
        let [a, b] = wanted.whose;
        match wanted.quantity.of {
            // Neither is changed by an ado, so they need no observation.
            Of::Clock | Of::Parameter => true,
            Of::Scene => {
                let ego = self.egos().next().unwrap_or(0);
                (0..self.agents.len()).any(|other| other != ego && pair([ego, other]))
            }
            Of::Pair => pair([a, b]),
            Of::Agent => seen.iter().any(|s| match s.quantity.of {
                // A speed is no substitute for a place, and a place covers
                // every other signal of its agent.
                Of::Agent => s.whose[0] == a && (places(*s) || !places(wanted)),
                Of::Pair => s.whose.contains(&a),
                _ => false,
            }),
            Of::Light => seen
                .iter()
                .any(|s| s.quantity.of == Of::Light && s.whose[0] == a),
            // The ado chooses the rates, so a value covers its rate.
            Of::Weather => {
                let value = wanted.quantity.name.trim_end_matches("_rate");
                seen.iter()
                    .any(|s| s.quantity.of == Of::Weather && s.quantity.name == value)
            }
            Of::Road => seen.iter().any(|s| s.quantity.of == Of::Road),
            Of::AgentAndLight => {
                let line =
                    |s: &SignalReading| s.quantity.of == Of::AgentAndLight && s.whose == [a, b];
                seen.iter().any(line) || is_placed(seen, a)
            }
        }
    }
}

/// Returns whether an agent's place on the road is observed.
fn is_placed(seen: &[SignalReading], agent: usize) -> bool {
    let mut seen = seen.iter();
    seen.any(|s| s.quantity.of == Of::Agent && s.whose[0] == agent && places(*s))
}

/// Returns whether a signal of an agent is a position.
fn places(source: SignalReading) -> bool {
    matches!(source.quantity.name, "x" | "y" | "s" | "lateral" | "lane")
}
