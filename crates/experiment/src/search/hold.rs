//! Search by a random action that is held for some decisions.

use super::found::SearchResult;
use super::method::{MethodInfo, MethodSettings, SearchError, SearchMethod, StartSearch};
use super::random;
use super::trials::Trials;
use crate::testbench::HOLD_DECISIONS;

/// Method that holds a uniformly random action for five decisions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hold;

impl SearchMethod<'_> for Hold {
    const INFO: MethodInfo =
        MethodInfo::sampling("hold", "A random action, held for five decisions");

    fn with(_: &MethodSettings<'_>) -> Result<Hold, SearchError> {
        Ok(Hold)
    }

    fn solve(&self, one: StartSearch<'_>) -> Option<SearchResult> {
        Trials::spend(one, |trials| random::solve(trials, HOLD_DECISIONS))
    }
}
