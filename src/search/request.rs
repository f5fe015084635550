//! What is searched.

use super::list::Method;
use crate::experiment::TestStarts;
use crate::world::Scenario;

/// What to search.
#[derive(Clone, Copy)]
pub struct SearchRequest<'a> {
    /// The world, with the ego to be tested.
    pub scenario: &'a Scenario,
    /// What rows call that ego.
    pub ego: &'a str,
    /// How sequences are chosen.
    pub method: Method<'a>,
    /// Simulations per start; 0 for methods that take none.
    pub budget: u64,
    /// The test starts.
    pub starts: &'a TestStarts,
}
