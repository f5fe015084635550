//! Search method that exists in tests only.

use super::found::SearchResult;
use super::method::{MethodInfo, MethodSettings, SearchError, SearchMethod, StartSearch};
use super::trials::Trials;

/// Method that plays each action for a whole episode, in order.
#[derive(Clone, Copy, Debug)]
pub struct EachAction;

impl SearchMethod<'_> for EachAction {
    const INFO: MethodInfo = MethodInfo::sampling("constants", "Each action for a whole episode");

    fn with(_: &MethodSettings<'_>) -> Result<EachAction, SearchError> {
        Ok(EachAction)
    }

    fn solve(&self, one: StartSearch<'_>) -> Option<SearchResult> {
        Trials::spend(one, |trials| {
            for action in 0..trials.actions() {
                if trials.replay(&[action]).is_none() {
                    return;
                }
            }
        })
    }
}
