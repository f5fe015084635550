//! Campaigns as functions: train, evaluate, search, replay.
//!
//! Everything here runs in parallel per episode and gives the same rows for any
//! number of threads: starts, noise and actors are pure functions of their keys.

mod adapt;
mod against;
mod alike;
mod baselines;
mod break_even;
mod by_rule;
mod calibration;
mod conditioning;
mod cost;
mod distinct;
mod ego_under_test;
mod entropy;
mod episodes;
mod error;
mod eval;
mod evaluation;
mod export;
mod goals;
mod heuristic;
mod identification;
mod identify;
mod in_the_way;
mod keep;
mod of_egos;
mod patience;
mod persistence;
mod picture;
mod points;
mod repeatable;
mod replay;
mod replays;
mod reporting;
mod reruns;
mod retrained;
mod reuse;
mod scout;
mod search;
mod search_table;
mod seeding;
mod serving;
mod session;
mod shrink;
mod starts;
mod surrogate;
mod sweep;
mod telling;
mod theorems;
mod train;
mod tries;
mod untrained;
mod view_kind;
mod watch;
mod why;

pub use adapt::{AdaptRequest, Adapted, ENOUGH_SIMULATIONS, LEAST_SIMULATIONS, adapt};
pub use against::TrainingGym;
pub use alike::{best_constant, best_then_brake};
pub use baselines::AdoKind;
pub use break_even::{BreakEven, PerStart, break_even};
pub use conditioning::{ConditionedAdo, ContextSource, RECORDED_RUNS, conditioned};
pub use cost::Cost;
pub use distinct::{NEAR, POINTS, Shape, clusters};
pub use ego_under_test::{EgoUnderTest, consent, consent_to};
pub(crate) use episodes::EpisodeLoop;
pub use error::CampaignError;
pub(crate) use eval::count_solved;
pub use eval::{Ado, EvalRequest, Evaluated, Outcome, RecordedFailure, eval, explain_first};
pub use evaluation::{
    Evaluation, EvaluationTable, ExplainedCounterexample, Flipped, Gate, TheoremsChecked,
};
pub use export::{ExportRefusal, Exports, NotExported, export, openx, write_openx};
pub use goals::GoalTracker;
pub use heuristic::{Heuristic, tune_heuristic};
pub use identification::{FoundParameter, IdentifiedAs};
pub use identify::{Identified, IdentifyError, IdentifyRequest, identify, is_telling};
pub use in_the_way::InTheWay;
pub use keep::{
    Again, Choice, Form, KeepSettings, Keeper, KeptFiles, PERSISTENT, about, file_stem, keep,
};
pub use persistence::{FRICTION, START, persistence};
pub use picture::picture;
pub use points::{
    PointFailure, PointOutcome, PointResult, PointsRequest, PointsTable, VariedPoint, points,
};
pub use repeatable::{answers_differ, note_if_unrepeatable};
pub use replay::{Difference, Kept, RegressionError, Regressions, Replayed, replay};
pub use reporting::{GivenRows, ReportRequest};
pub use reruns::KEEP_RUNS;
pub use retrained::retrained;
pub use reuse::{LEAST_REACHABLE, Relation, ReusedOn, Summary, reused_on, summarise};
pub(crate) use search::count_contacts;
pub use search::{
    BUDGET, Cem, Found, Hold, Method, MethodInfo, MethodOption, MethodSettings, Mutate, SWITCHES,
    SearchRequest, Searched, Switches, Uniform, anytime, search,
};
pub use search_table::{SearchCampaign, SearchTable, SearchedEgo, counterexamples_for};
pub use serving::{ServeError, Served, ServedAdo, asked_of, policy_told_by_name};
pub use session::{Closing, TrainRequest, TrainSession, on_plant};
pub use shrink::{CLOSING, effort, shrink};
pub use starts::{TestStarts, drawn_starts, test_noise, test_starts};
pub use surrogate::{
    Acts, AdaptedRow, AdaptedTo, BrakedFor, EmergencyBrake, LEAST_RUNS, LearnEgoRequest,
    LearnedEgo, LearnedFrom, Likeness, SurrogateError, TriedActions, learn_ego,
};
pub use sweep::{Point, Sweep, Swept};
pub use telling::{Telling, telling};
pub use theorems::{
    Approximation, Carried, CarriedOver, CarryOver, DELTAS, Distance, Forecast, GridTheorems,
    Nearby, Refused, Sharper, Spread, Theorem1, Theorem1Row, Theorem2, Theorem2Row, Theorem3,
    TheoremOutcome, TheoremsError, TheoremsRequest, Witness, bisimulations, carry_over,
    grid_theorems, lifted, optimal_values, theorem_1, theorem_2, theorem_3,
};
pub use train::{TrainError, TrainingOutcome, train};
pub use tries::{Tried, Tries, other_members};
pub use untrained::{Untrained, untrained};
pub use view_kind::ViewKind;
pub use watch::{Remark, StepPlace, Watch};
pub(crate) use why::leaf;
pub use why::{Driver, decisive, last_chance, why};
