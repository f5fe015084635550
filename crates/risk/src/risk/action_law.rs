//! Law of the ados' joint action at every decision.

use super::manoeuvre::Manoeuvre;
use crate::rl::interrupted;
use crate::stats::student_cdf;
use crate::stl::BoundExpr;
use brakecheck_driver_model::AccelerationModel;

/// Law of the joint action: a product over the ados.
#[derive(Clone, Debug)]
pub(super) struct ActionLaw {
    pub(super) ados: Vec<AdoLaw>,
}

/// Law of one ado's actions.
#[derive(Clone, Debug)]
pub(super) struct AdoLaw {
    pub(super) name: String,
    pub(super) actions: usize,
    pub(super) neutral: usize,
    pub(super) kind: LawKind,
}

#[derive(Clone, Debug)]
pub(super) enum LawKind {
    Markov(MarkovLaw),
    Fitted(FittedLaw),
}

/// Actions of the ados so far, on which the next ones depend.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LawMemory {
    /// Action before the last one, and the last one, per ado.
    pub(super) last: Vec<[usize; 2]>,
    /// Phases of each ado so far.
    pub(super) manoeuvres: Vec<Manoeuvre>,
    decisions: usize,
}

/// Next action by the last one, interrupted by onsets.
#[derive(Clone, Debug)]
pub(super) struct MarkovLaw {
    /// Probabilities `[last, next]`.
    pub(super) transitions: Vec<Vec<f64>>,
    pub(super) onsets: Vec<Onset>,
    pub(super) decision_s: f64,
}

#[derive(Clone, Debug)]
pub(super) struct Onset {
    /// Text of the rate.
    pub(super) text: String,
    pub(super) rate_per_s: BoundExpr,
    pub(super) to: Vec<f64>,
}

/// Accelerations by the model of recorded traffic.
///
/// An action has the probability of all accelerations that are nearest to its own. The
/// model has decisions of 0.5 s, so shorter decisions repeat the action in between.
#[derive(Clone, Debug)]
pub(super) struct FittedLaw {
    pub(super) model: AccelerationModel,
    pub(super) accelerations_mps2: Vec<f64>,
    /// Ends of the accelerations that each action represents.
    pub(super) cells: Vec<[f64; 2]>,
    /// Decisions for which an action is repeated.
    pub(super) hold: usize,
    /// Law of the lateral moves, if the set has any.
    pub(super) lateral: Option<MarkovLaw>,
}

impl LawMemory {
    /// Writes a one-hot code of the last actions and the phases before them, as inputs of V.
    pub(super) fn features(&self, law: &ActionLaw, into: &mut Vec<f32>) {
        let each = law.ados.iter().zip(&self.last).zip(&self.manoeuvres);
        for ((ado, last), manoeuvre) in each {
            // The last action is the second of both, and the only one for a reach of 1.
            let reach = 2 - ado.reach();
            for action in &last[reach..] {
                into.extend((0..ado.actions).map(|it| if it == *action { 1.0 } else { 0.0 }));
            }
            // A failure by several phases depends on those that are over, which no state shows.
            manoeuvre.features(into);
        }
    }

    /// Returns the phases of the ados in symbols. Empty: no ado left its neutral action.
    pub(super) fn manoeuvre_in_symbols(&self) -> String {
        let all: Vec<String> = self.manoeuvres.iter().map(Manoeuvre::in_symbols).collect();
        if all.iter().all(String::is_empty) {
            return String::new();
        }
        all.join("/")
    }
}

impl AdoLaw {
    /// Number of earlier actions on which the next one depends.
    fn reach(&self) -> usize {
        match &self.kind {
            LawKind::Markov(_) => 1,
            LawKind::Fitted(_) => 2,
        }
    }

    /// Number of decisions for which an action is repeated.
    fn hold(&self) -> usize {
        match &self.kind {
            LawKind::Markov(_) => 1,
            LawKind::Fitted(law) => law.hold,
        }
    }

    pub(super) fn probabilities(
        &self,
        row: &[f64],
        last: [usize; 2],
        decisions: usize,
    ) -> Vec<f64> {
        match &self.kind {
            LawKind::Markov(law) => law.probabilities(row, last[1]),
            LawKind::Fitted(law) => law.probabilities(row, last, decisions),
        }
    }
}

impl ActionLaw {
    /// Returns the number of inputs that [`LawMemory::features`] writes.
    pub(super) fn features(&self) -> usize {
        let each = |ado: &AdoLaw| ado.reach() * ado.actions + Manoeuvre::FEATURES;
        self.ados.iter().map(each).sum()
    }

    /// Returns the positions of the signals on which rates depend.
    pub(super) fn signals(&self) -> Vec<usize> {
        let laws = self.ados.iter().filter_map(|ado| match &ado.kind {
            LawKind::Markov(law) => Some(law),
            LawKind::Fitted(law) => law.lateral.as_ref(),
        });
        let onsets = laws.flat_map(|law| &law.onsets);
        onsets.flat_map(|it| it.rate_per_s.signals()).collect()
    }

    /// Returns the memory before the first decision.
    pub(super) fn begin(&self) -> LawMemory {
        LawMemory {
            // Before a run, every ado counts as having driven on evenly.
            last: self.ados.iter().map(|ado| [ado.neutral; 2]).collect(),
            manoeuvres: vec![Manoeuvre::default(); self.ados.len()],
            decisions: 0,
        }
    }

    /// Notes a joint action.
    pub(super) fn note(&self, memory: &mut LawMemory, joint: usize) {
        let mut rest = joint;
        let each = self.ados.iter().zip(&mut memory.last);
        for ((ado, last), manoeuvre) in each.zip(&mut memory.manoeuvres) {
            // The model looks back by its own period, not by a shorter decision.
            let before = if memory.decisions.is_multiple_of(ado.hold()) {
                last[1]
            } else {
                last[0]
            };
            let action = rest % ado.actions;
            *last = [before, action];
            manoeuvre.note(action.cmp(&ado.neutral));
            rest /= ado.actions;
        }
        memory.decisions += 1;
    }

    /// Returns the probability of every joint action in a row of signals.
    ///
    /// The first ado is the lowest digit of a joint action, as in the scene.
    pub(super) fn probabilities(&self, row: &[f64], memory: &LawMemory) -> Vec<f64> {
        let mut joint = vec![1.0];
        for (ado, last) in self.ados.iter().zip(&memory.last) {
            let own = ado.probabilities(row, *last, memory.decisions);
            // Each further ado is a higher digit, so its shares are the outer factors.
            let times = |share: &f64| joint.iter().map(|it| it * share).collect::<Vec<f64>>();
            joint = own.iter().flat_map(times).collect();
        }
        joint
    }
}

impl MarkovLaw {
    pub(super) fn probabilities(&self, row: &[f64], last: usize) -> Vec<f64> {
        let rates: Vec<f64> = self
            .onsets
            .iter()
            .map(|it| it.rate_per_s.eval(row))
            .collect();
        let onsets = self.onsets.iter().map(|it| &it.to[..]);
        interrupted(&self.transitions[last], &rates, onsets, self.decision_s)
    }
}

impl FittedLaw {
    pub(super) fn probabilities(
        &self,
        row: &[f64],
        [before, last]: [usize; 2],
        decisions: usize,
    ) -> Vec<f64> {
        let count = self.accelerations_mps2.len();
        let along = if decisions.is_multiple_of(self.hold) {
            self.along([before, last].map(|it| it % count))
        } else {
            // Between decisions of the model an action goes on.
            let mut same = vec![0.0; count];
            same[last % count] = 1.0;
            same
        };
        let Some(lateral) = &self.lateral else {
            return along;
        };
        // Actions are numbered with the lateral move as the higher digit.
        let aside = lateral.probabilities(row, last / count);
        let times = |share: &f64| along.iter().map(|it| it * share).collect::<Vec<f64>>();
        aside.iter().flat_map(times).collect()
    }

    /// Returns the law of the acceleration after two others, by their numbers.
    pub(super) fn along(&self, [before, last]: [usize; 2]) -> Vec<f64> {
        // The model takes the earlier acceleration first.
        let [b, a] = [before, last].map(|it| self.accelerations_mps2[it]);
        let (centre, scale) = self.model.centre_and_scale([b, a]);
        let below = |x: f64| student_cdf((x - centre) / scale, self.model.freedom);
        let cells = self.cells.iter();
        cells.map(|[lo, hi]| below(*hi) - below(*lo)).collect()
    }
}
