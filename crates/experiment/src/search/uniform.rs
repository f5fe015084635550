//! Search by a random action at each decision.

use super::found::SearchResult;
use super::method::{MethodInfo, MethodSettings, SearchError, SearchMethod, StartSearch};
use super::random;
use super::trials::Trials;

/// Method that draws a uniformly random action at each decision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Uniform;

impl SearchMethod<'_> for Uniform {
    const INFO: MethodInfo = MethodInfo::sampling("uniform", "A random action at each decision");

    fn with(_: &MethodSettings<'_>) -> Result<Uniform, SearchError> {
        Ok(Uniform)
    }

    fn solve(&self, one: StartSearch<'_>) -> Option<SearchResult> {
        Trials::spend(one, |trials| random::solve(trials, 1))
    }
}
