//! States of a grid game under its rulebook, and the result of every action.
//!
//! A state is a position of both agents with the state of every monitor, so the product
//! covers rules and specifications over time. The monitors are those of the test bench.
//! States are grouped by the number of decisions before them.

use std::collections::HashMap;
use std::sync::Arc;

use super::exact::Game;
use crate::rulebook::{NoState, Rulebook, StateJudge, Stop, Verdict};
use crate::scene::grid::{GridWorld, Position, Starts, position};

/// Greatest number of transitions of a graph, about 250 MB.
const MOST_TRANSITIONS: usize = 60_000_000;

/// Part of ψ_ego's robustness that states keep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// The whole robustness, so that verdicts are exact.
    Exact,
    /// Only its sign where ψ_ego is an `always`, which needs far fewer states.
    ///
    /// Kinds of verdicts and broken rules stay exact, and margins do not.
    Sign,
}

/// All states of a grid game that an episode can reach.
#[derive(Debug)]
pub struct GameGraph {
    game: Game,
    /// By the number of decisions before the states, below K.
    layers: Vec<DecisionLayer>,
    /// Each start, and what its first sample leads to.
    starts: Vec<(Position, Next)>,
    start_of: HashMap<usize, Next>,
    /// Different verdicts, numbered.
    verdicts: Vec<Verdict>,
}

/// States with the same number of decisions before them.
#[derive(Debug, Default)]
struct DecisionLayer {
    pairs: Vec<u32>,
    /// Results of all actions, state by state.
    next: Vec<Next>,
}

/// Number of a state in the next layer, or of the verdict that ends the episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Next(u32);

/// Decoded [`Next`].
pub(super) enum GameStep {
    /// The episode goes on in this state of the next layer.
    State(usize),
    /// The episode ends with this verdict.
    End(usize),
}

impl Next {
    // A tag in the highest bit, because an enum would double the memory of the graph.
    const END: u32 = 1 << 31;

    fn state(number: usize) -> Next {
        // A returned graph has at most `MOST_TRANSITIONS` states, far below the tag.
        Next(number as u32)
    }

    fn end(verdict: usize) -> Next {
        Next(verdict as u32 | Next::END)
    }

    pub(super) fn step(self) -> GameStep {
        if self.0 >= Next::END {
            GameStep::End((self.0 & !Next::END) as usize)
        } else {
            GameStep::State(self.0 as usize)
        }
    }
}

/// Reason that a grid world cannot be solved exactly.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NotSolvable {
    /// No short list of numbers decides a formula.
    #[error("{formula} cannot be judged from a state of the game, only from the whole run")]
    Formula {
        /// The formula in words.
        formula: String,
    },
    /// The game has too many states.
    #[error("the game with its rules has more than {limit} transitions")]
    TooLarge {
        /// Greatest number of transitions.
        limit: usize,
    },
}

impl GameGraph {
    /// Explores a world from all of its starts.
    ///
    /// A world that draws its starts is explored from every pair of cells at least one
    /// cell apart.
    ///
    /// # Errors
    /// A formula is not a function of the game's states, or there are too many of them.
    pub fn explore(
        world: &GridWorld,
        rulebook: &Rulebook,
        depth: Depth,
    ) -> Result<Arc<GameGraph>, NotSolvable> {
        match &world.spec().starts {
            Starts::Pairs(pairs) => {
                let starts = pairs.iter().map(|(ego, ado)| position(*ego, *ado));
                GameGraph::explore_from(world, rulebook, depth, starts)
            }
            Starts::AllPairs | Starts::Uniform => {
                GameGraph::explore_from(world, rulebook, depth, world.spec().arena.starts())
            }
        }
    }

    /// Returns an error if the world can be seen not to be solvable without exploring it.
    ///
    /// # Errors
    /// Returns the errors of [`GameGraph::explore`]. A game that is only found to be too
    /// large on the way is not among them.
    pub fn admits(world: &GridWorld, rulebook: &Rulebook) -> Result<(), NotSolvable> {
        // The monitors are checked first, since that takes no exploration.
        judge_of(world, rulebook, Depth::Sign)?;
        let most = MOST_TRANSITIONS / world.spec().moves.len().max(1);
        let listed = match &world.spec().starts {
            Starts::Pairs(pairs) => pairs.len(),
            // The count ends beyond the limit, so that a huge map takes no longer.
            Starts::AllPairs | Starts::Uniform => {
                world.spec().arena.starts().take(most + 1).count()
            }
        };
        if listed > most {
            let limit = MOST_TRANSITIONS;
            return Err(NotSolvable::TooLarge { limit });
        }
        Ok(())
    }

    /// Explores a world from some starts.
    ///
    /// # Errors
    /// Returns the errors of [`GameGraph::explore`].
    pub fn explore_from(
        world: &GridWorld,
        rulebook: &Rulebook,
        depth: Depth,
        starts: impl Iterator<Item = Position>,
    ) -> Result<Arc<GameGraph>, NotSolvable> {
        let judge = judge_of(world, rulebook, depth)?;
        let mut explorer = Explorer {
            game: Game::of(world),
            scene: world.scene(),
            row: vec![0.0; world.schema().len()],
            state: judge.begin(),
            judge,
            rulebook,
            memories: Memories::default(),
            verdicts: Vec::new(),
        };
        let mut graph = GameGraph {
            game: explorer.game.clone(),
            layers: Vec::new(),
            starts: Vec::new(),
            start_of: HashMap::new(),
            verdicts: Vec::new(),
        };
        let mut frontier = Frontier::default();
        for both in starts {
            let first = explorer.first(both, &mut frontier);
            graph.starts.push((both, first));
            graph.start_of.insert(graph.game.pair(both), first);
        }
        let mut transitions = 0;
        for step in 0..graph.game.steps {
            let here = std::mem::take(&mut frontier);
            // Counted before the layer is built, so that a game too large does not fill the memory.
            transitions += here.states.len() * graph.game.moves.len();
            if transitions > MOST_TRANSITIONS {
                let limit = MOST_TRANSITIONS;
                return Err(NotSolvable::TooLarge { limit });
            }
            // Pushed even if it has no state, because its position is a number of
            // decisions.
            graph
                .layers
                .push(explorer.layer(step, &here, &mut frontier));
        }
        graph.verdicts = explorer.verdicts;
        Ok(Arc::new(graph))
    }

    /// Returns the game.
    pub fn game(&self) -> &Game {
        &self.game
    }

    /// Returns every start.
    pub fn starts(&self) -> impl Iterator<Item = Position> + '_ {
        self.starts.iter().map(|(both, _)| *both)
    }

    /// Returns the number of states.
    pub fn states(&self) -> usize {
        self.layers.iter().map(|layer| layer.pairs.len()).sum()
    }

    /// Returns the verdicts that end episodes, each once.
    pub(super) fn verdicts(&self) -> &[Verdict] {
        &self.verdicts
    }

    /// Returns the number of layers, K.
    pub(super) fn depth(&self) -> usize {
        self.layers.len()
    }

    /// Returns the number of states of a layer.
    pub(super) fn len(&self, layer: usize) -> usize {
        self.layers[layer].pairs.len()
    }

    /// Returns the position of a state.
    pub(super) fn position(&self, layer: usize, state: usize) -> Position {
        self.game.position(self.layers[layer].pairs[state] as usize)
    }

    /// Returns the results of all actions in a state.
    pub(super) fn next(&self, layer: usize, state: usize) -> &[Next] {
        let actions = self.game.moves.len();
        &self.layers[layer].next[state * actions..][..actions]
    }

    /// Returns the result of the first sample of a start. `None`: no start.
    pub(super) fn start(&self, both: Position) -> Option<Next> {
        self.start_of.get(&self.game.pair(both)).copied()
    }
}

fn judge_of(
    world: &GridWorld,
    rulebook: &Rulebook,
    depth: Depth,
) -> Result<StateJudge, NotSolvable> {
    // The horizon fixes the windows of the formulas, so the judge depends on it.
    let judge = StateJudge::new(rulebook, world.clock().samples(), depth == Depth::Exact);
    judge.map_err(|formula| NotSolvable::Formula {
        formula: match formula {
            NoState::Spec => "the ego's specification".to_owned(),
            NoState::Rule(name) => format!("the rule `{name}`"),
        },
    })
}

/// States of the layer that is being explored.
#[derive(Default)]
struct Frontier {
    /// Pair of cells, and number of the monitors' state.
    states: Vec<(u32, u32)>,
    number_of: HashMap<(u32, u32), u32>,
}

impl Frontier {
    fn number(&mut self, pair: usize, memory: u32) -> usize {
        let state = (pair as u32, memory);
        let number = self.number_of.entry(state).or_insert_with(|| {
            self.states.push(state);
            self.states.len() as u32 - 1
        });
        *number as usize
    }
}

/// Different states of the monitors, numbered.
#[derive(Default)]
struct Memories {
    all: Vec<Vec<f64>>,
    number_of: HashMap<Vec<u64>, u32>,
    bits: Vec<u64>,
}

impl Memories {
    fn number(&mut self, state: &[f64]) -> u32 {
        self.bits.clear();
        // Bits and not values, because floats are no hash keys.
        self.bits
            .extend(state.iter().map(|number| number.to_bits()));
        if let Some(number) = self.number_of.get(&self.bits) {
            return *number;
        }
        let number = self.all.len() as u32;
        self.all.push(state.to_vec());
        self.number_of.insert(self.bits.clone(), number);
        number
    }
}

struct Explorer<'a> {
    game: Game,
    scene: crate::scene::grid::GridScene,
    row: Vec<f64>,
    /// Numbers of the run that is judged at the moment.
    state: Vec<f64>,
    judge: StateJudge,
    rulebook: &'a Rulebook,
    memories: Memories,
    verdicts: Vec<Verdict>,
}

impl Explorer<'_> {
    /// Judges the first sample of a start.
    fn first(&mut self, both: Position, frontier: &mut Frontier) -> Next {
        // Nothing has moved before the first sample, so the ado's speed is 0.
        self.scene.sample_at([both, both], 0, &mut self.row);
        self.state = self.judge.begin();
        self.judged(both, 0, None, frontier)
    }

    /// Plays every action in every state of a layer.
    fn layer(&mut self, step: u32, here: &Frontier, frontier: &mut Frontier) -> DecisionLayer {
        let mut layer = DecisionLayer::default();
        for (pair, memory) in &here.states {
            let both = self.game.position(*pair as usize);
            layer.pairs.push(*pair);
            for action in 0..self.game.moves.len() {
                let next = self.game.arena.next(both, self.game.moves[action]);
                // A capture by the last move ends in contact, as on the test bench.
                let stop = if self.game.arena.touching(next) {
                    Some(Stop::Contact)
                } else {
                    (step + 1 == self.game.steps).then_some(Stop::Horizon)
                };
                self.scene.sample_at([both, next], step + 1, &mut self.row);
                // Each action continues from the memory of this state, not of the action
                // before.
                self.state.clone_from(&self.memories.all[*memory as usize]);
                let next = self.judged(next, step + 1, stop, frontier);
                layer.next.push(next);
            }
        }
        layer
    }

    /// Judges the sample in `row` after the run in `state`.
    fn judged(
        &mut self,
        now: Position,
        sample: u32,
        stop: Option<Stop>,
        frontier: &mut Frontier,
    ) -> Next {
        let sample = sample as usize;
        // The judge changes the numbers in place, and they are the memory of the next
        // state.
        let state = &mut self.state;
        let verdict = self
            .judge
            .push(self.rulebook, state, sample, &self.row, stop);
        let Some(verdict) = verdict else {
            let memory = self.memories.number(&self.state);
            return Next::state(frontier.number(self.game.pair(now), memory));
        };
        // Margins are multiples of a cell, so countless ends share few verdicts.
        let known = self.verdicts.iter().position(|known| *known == verdict);
        Next::end(known.unwrap_or_else(|| {
            self.verdicts.push(verdict);
            self.verdicts.len() - 1
        }))
    }
}
